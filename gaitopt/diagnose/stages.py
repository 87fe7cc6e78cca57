"""The stages of a diagnosis, as its progress names them."""

from __future__ import annotations

from gaitopt.diagnose.fit.runner import FINISHING, FITTING, FITTING_SETS

FLOOR, PREDICTING, NEXT = "measuring the floor", "predicting gaits", "looking for what to measure next"


def stages(logged: bool, next_gait: bool) -> list[str]:
    """Return the names of the stages in order; what is not needed is skipped.

    Args:
        logged: whether commands were logged.
        next_gait: whether to look for what to measure next.
    """
    fitting = [FITTING_SETS] if logged else [FITTING, FINISHING, FITTING_SETS]
    return [FLOOR, *fitting, PREDICTING, *([NEXT] if next_gait else [])]
