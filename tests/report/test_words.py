"""Results in sentences."""

import math
from dataclasses import replace

from gaitopt.optimise.compare import ComparedGait
from gaitopt.report.words import answer_of, constraints_text, reach_of, verdicts
from gaitopt.runs.summary import BestRow, GaitRow, MeasuredRow, Summary

FIRST = ComparedGait(
    name="first", period_s=1.0, speed_ci90_m_s=(0.009, 0.011), speed_worst_m_s=0.008, difference_m_s=0.0,
    difference_ci90_m_s=(0.0, 0.0), ratio=1.0, ratio_ci90=(1.0, 1.0), more_than_noise=False,
    constraints_met=True, violations={}, status="ok", scenario_speeds_m_s=(0.008, 0.012),
    metrics={"speed_m_s": 0.01},
)  # fmt: skip


def summary(best_speed: float, violations: dict[str, float], baselines: tuple[GaitRow, ...]) -> Summary:
    """A summary with little more than the answer needs."""
    best = BestRow(
        name="best", period_s=1.0, speed_m_s=best_speed, speed_ci90_m_s=(0.019, 0.021),
        constraints_met=not violations, violations=violations, status="diverged",
    )  # fmt: skip
    ratio = best_speed / baselines[0].speed_m_s if baselines else None
    return Summary(best=best, baselines=baselines, ratio_to_best_baseline=ratio)


def hand_tuned(speed: float) -> GaitRow:
    """A hand-tuned gait."""
    return GaitRow(
        name="square", period_s=1.0, speed_m_s=speed, speed_ci90_m_s=(speed, speed),
        constraints_met=True, violations={}, status="ok",
    )  # fmt: skip


def test_the_answer_of_a_search_is_one_sentence() -> None:
    assert answer_of(summary(0.02, {}, (hand_tuned(0.01),))) == (
        "The best gait moves at 20.0 mm/s (90 % interval 19.0 to 21.0), 2.00 times the fastest hand-tuned "
        "gait, square, and meets every constraint."
    )
    assert answer_of(summary(0.02, {"tilt_rad": 1.0}, ())) == (
        "The best gait moves at 20.0 mm/s (90 % interval 19.0 to 21.0), and violates largest tilt."
    )
    failed = answer_of(summary(math.nan, {}, ()))
    assert failed == "The best gait of the search failed where it was verified: diverged."


def test_how_far_the_winner_lies_from_what_was_measured_is_one_sentence() -> None:
    def reach(period_s: float, speed_m_s: float, torque_n_m: float) -> str:
        found = summary(speed_m_s, {}, ())
        best = found.best.model_copy(
            update={"period_s": period_s, "metrics": {"rms_torque_n_m": torque_n_m}},
        )
        measured = MeasuredRow(
            gaits=("slow", "fast"), period_s=(0.5, 4.0), speed_m_s=(0.009, 0.03), rms_torque_n_m=0.2
        )
        return reach_of(found.model_copy(update={"best": best, "measured": measured}))

    of = "what was measured on the real robot (slow, fast)"
    assert reach(0.25, 0.12, 0.19) == (
        f"The winner lies beyond {of}: its period of 0.25 s is 0.5 times the shortest (0.5 s); its speed of "
        "120 mm/s is 4 times the largest (30 mm/s)."
    )
    assert reach(6.0, 0.02, 0.3) == (
        f"The winner lies beyond {of}: its period of 6 s is 1.5 times the longest (4 s); its RMS torque of "
        "0.3 N m is 1.5 times the largest (0.2 N m)."
    )
    for period_s in (0.49, 4.1):
        within = reach(period_s, 0.031, math.nan)
        assert within == f"The winner lies within {of}: in period, speed and torque."
    assert reach_of(summary(0.02, {}, ())) == "", "the problem says nothing of it"
    assert reach(0.25, math.nan, 0.2) == ""


def test_a_verdict_says_how_gaits_differ_and_whether_by_more_than_noise() -> None:
    faster = replace(
        FIRST, name="faster", difference_m_s=0.01, difference_ci90_m_s=(0.008, 0.012), ratio=2.0,
        ratio_ci90=(1.8, 2.2), more_than_noise=True,
    )  # fmt: skip
    slower = replace(
        faster, name="slower", difference_m_s=-0.01, difference_ci90_m_s=(-0.012, -0.008), ratio=None
    )
    alike = replace(FIRST, name="alike", difference_ci90_m_s=(-0.001, 0.002), ratio=None, ratio_ci90=None)
    failed = replace(FIRST, name="failed", difference_m_s=math.nan)
    assert verdicts([FIRST]) == []
    assert verdicts([FIRST, faster, slower, alike, failed]) == [
        "faster is faster than first by 10.00 mm/s (90 % interval 8.00 to 12.00), 2.00 times its speed "
        "(1.80 to 2.20): more than noise.",
        "slower is slower than first by 10.00 mm/s (90 % interval 8.00 to 12.00): more than noise.",
        "alike differs from first by no more than noise: +0.00 mm/s (90 % interval -1.00 to +2.00).",
        "failed cannot be compared with first: a simulation failed.",
    ]


def test_constraints_are_met_or_named() -> None:
    assert constraints_text(FIRST) == "met"
    bad = replace(FIRST, constraints_met=False, violations={"slip_m": 1.0})
    assert constraints_text(bad) == "violated: slip back per cycle"
    assert constraints_text(replace(bad, violations={}, status="diverged")) == "violated: diverged"
