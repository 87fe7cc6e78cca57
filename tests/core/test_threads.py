"""Linear algebra gives the same bits whatever the number of cores."""

import numpy as np
import pytest
from helpers import blas_threads
from threadpoolctl import threadpool_limits

from gaitopt.core.threads import on_one_thread


def factor() -> bytes:
    """Return the bits of a factor of a covariance as large as that of a trial."""
    changes = np.random.default_rng(0).standard_normal((56, 644))
    return np.linalg.cholesky(changes.T @ changes + np.eye(644)).tobytes()


def test_linear_algebra_runs_on_one_thread_and_then_as_before() -> None:
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        assert on_one_thread(blas_threads)() == {1}
        assert blas_threads() == before


def test_as_many_threads_are_back_after_an_error() -> None:
    @on_one_thread
    def fail() -> None:
        raise ValueError("no")

    before = blas_threads()
    with pytest.raises(ValueError, match="no"):
        fail()
    assert blas_threads() == before


def test_no_bit_depends_on_the_threads_outside() -> None:
    factors = set()
    for threads in (1, 2, 4):
        with threadpool_limits(limits=threads, user_api="blas"):
            factors.add(on_one_thread(factor)())
    assert len(factors) == 1
