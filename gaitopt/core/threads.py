"""Linear algebra on one thread, so that no result depends on how many cores a machine has.

BLAS adds up what each of its threads summed. With another number of threads the last bits differ, and so,
after a few seconds of a fast gait, does the robot.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

_Args = ParamSpec("_Args")
_Result = TypeVar("_Result")


def on_one_thread(function: Callable[_Args, _Result]) -> Callable[_Args, _Result]:
    """Return a function whose linear algebra runs on one thread, in the whole process while it runs."""

    @wraps(function)
    def limited(*args: _Args.args, **kwargs: _Args.kwargs) -> _Result:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
