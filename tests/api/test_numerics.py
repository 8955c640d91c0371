"""Fits use one thread of linear algebra, and give the others back."""

from threadpoolctl import threadpool_info, threadpool_limits

from orchestrator.api.numerics import numeric_errors


def _threads() -> list[int]:
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_fits_use_one_thread_of_linear_algebra() -> None:
    with threadpool_limits(2, user_api="blas"):  # tests begin with one
        before = _threads()
        assert set(before) == {2}
        with numeric_errors("a record"):
            assert set(_threads()) == {1}
        assert _threads() == before
