"""What an answer leaves open, in words."""

from types import SimpleNamespace
from typing import Any

import pytest

from gaitopt.diagnose.judge.gap import Gap
from gaitopt.diagnose.words import answer


def candidate(*names: str) -> Any:
    """Effects at 0.1."""
    hypotheses = [
        SimpleNamespace(name=name, effect=SimpleNamespace(name=name, parameter="s", unit=""), value=float)
        for name in names
    ]
    return SimpleNamespace(hypotheses=hypotheses, at=[0.1] * len(names))


def diagnosed(verdict: str, found: SimpleNamespace, gap: Gap, correction: Any, corrected: Gap) -> Any:
    """A diagnosis of a marker, with its gap after the best candidate and after the correction."""
    return SimpleNamespace(
        verdict=verdict,
        found=found,
        gap=gap,
        gap_angles=None,
        measures_positions=True,
        correction=correction,
        correction_or_best=correction or found.best,
        gap_with=lambda chosen: corrected if chosen is correction else gap,
    )


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
    both, best = "lag (s = 0.1) and trim (s = 0.1)", candidate("lag", "trim")
    found = SimpleNamespace(best=best, candidates=(best,), ambiguous_with=beside, causes=["lag"])
    gap = Gap(3e-3, 1e-3, 5e-4, (0.7, 0.9))
    diagnosis = diagnosed("ambiguous", found, gap, best, gap)
    assert answer(diagnosis).startswith(f"{said.format(both)} The gap: 3 mm RMS of the marker before")


@pytest.mark.parametrize("corrects", [True, False])
def test_an_answer_that_explains_nothing_names_the_best_correction_and_its_gap(corrects: bool) -> None:
    """The most probable effect may predict held-out trials worse than the nominal robot does."""
    first, second = candidate("lag"), candidate("trim")
    found = SimpleNamespace(best=first, candidates=(first, second), ambiguous_with=[], causes=[])
    worse, better = Gap(3e-3, 4e-3, 5e-4, (-0.9, -0.1)), Gap(3e-3, 1e-3, 5e-4, (0.7, 0.9))
    said = answer(diagnosed("unexplained", found, worse, second if corrects else None, better))
    assert said.startswith("No effect of the library explains the gap of held-out trials")
    if corrects:
        assert (
            "The best correction: trim (s = 0.1). The gap: 3 mm RMS of the marker before, 1 mm after" in said
        )
    else:
        assert "none predicts them better than the nominal robot does. The most probable one is lag" in said
        assert "4 mm after" in said
