"""What an ambiguous answer leaves open, in words."""

from types import SimpleNamespace
from typing import Any

import pytest

from gaitopt.diagnose.judge.gap import Gap
from gaitopt.diagnose.words import answer


@pytest.mark.parametrize(
    ("beside", "said"),
    [
        (
            ["play"],
            "These trials cannot tell which effect causes the gap: {0}, or play.",
        ),
        (
            ["trim"],
            "The gap is explained by {0}. It is not certain that trim is at work.",
        ),
        (
            [],
            "The gap is explained by {0}, but not certainly: each effect changes little.",
        ),
    ],
)
def test_other_effects_differ_from_those_that_are_not_certain(beside: list[str], said: str) -> None:
    hypotheses = [
        SimpleNamespace(name=name, effect=SimpleNamespace(name=name, parameter="s", unit=""), value=float)
        for name in ("lag", "trim")
    ]
    both = "lag (s = 0.1) and trim (s = 0.1)"
    best = SimpleNamespace(hypotheses=hypotheses, at=[0.1, 0.1])
    found = SimpleNamespace(best=best, candidates=(best,), ambiguous_with=beside, causes=["lag"])
    gap = Gap(3e-3, 1e-3, 5e-4, (0.7, 0.9))
    diagnosis: Any = SimpleNamespace(
        verdict="ambiguous", found=found, gap=gap, gap_angles=None, measures_positions=True
    )
    assert answer(diagnosis).startswith(f"{said.format(both)} The gap: 3 mm RMS of the marker before")
