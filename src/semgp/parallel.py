"""Spread blocks of work over threads, one BLAS thread each."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from importlib import import_module
from typing import TypeVar

from threadpoolctl import ThreadpoolController

T = TypeVar("T")
R = TypeVar("R")


THREADS_VARIABLE = "SEMGP_THREADS"
"""The environment variable that says how many threads a process may use, where that is not one a core."""


def n_workers() -> int:
    """Return the number of threads for this process: what `SEMGP_THREADS` says, or the cores that it may use."""
    wanted = os.environ.get(THREADS_VARIABLE, "")
    if wanted.isdecimal() and int(wanted) > 0:
        return int(wanted)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_blas_thread() -> AbstractContextManager[object]:
    """Return a context in which BLAS uses one thread: small matrices are slower with more."""
    limits: AbstractContextManager[object] = _blas_libraries().limit(limits=1, user_api="blas")
    return limits


@cache
def _blas_libraries() -> ThreadpoolController:
    """The BLAS libraries of this process, both numpy's and scipy's: looking for them takes a millisecond."""
    import_module("scipy.linalg")
    return ThreadpoolController()


def parallel_map(work: Callable[[T], R], items: Iterable[T], workers: int | None = None) -> list[R]:
    """Return `[work(item) for item in items]`, computed by threads with one BLAS thread each.

    The work must release the interpreter lock where it spends its time (numpy, BLAS, `nogil` numba). More
    BLAS threads than workers would fight for the same cores.
    """
    with one_blas_thread(), ThreadPoolExecutor(workers or n_workers()) as pool:
        return list(pool.map(work, items))


def slices(n: int, size: int) -> Iterator[slice]:
    """Yield slices of at most `size` that cover `range(n)` in order."""
    for start in range(0, n, size):
        yield slice(start, min(start + size, n))
