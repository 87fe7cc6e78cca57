"""Units in files: a column's suffix gives its scale."""

from __future__ import annotations

from collections.abc import Mapping

from hypothesis import given
from hypothesis import strategies as st

from gaitopt.core.units import ANGLE, LENGTH, TIME, suffix_scale


@given(st.sampled_from([TIME, LENGTH, ANGLE]), st.data())
def test_every_suffix_has_its_scale(units: Mapping[str, float], data: st.DataObject) -> None:
    unit = data.draw(st.sampled_from(sorted(units)))
    stem = data.draw(st.from_regex(r"[a-z]{1,5}(_[a-z]{1,3})?", fullmatch=True))
    assert suffix_scale("file", "key", f"{stem}_{unit}", units) == units[unit]
