"""How many cores this process may use, work that is spread over them, and results that their threads share."""

import os
from collections.abc import Callable, Sequence
from functools import cache, wraps
from threading import RLock, Semaphore, Thread
from typing import ParamSpec, TypeVar

import numpy as np

T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")


def usable_cores() -> int:
    """Return the number of cores that this process may use, at least 1 and maybe fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):  # not on every system
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_SPARE = Semaphore(usable_cores() - 1)


def map_on_threads(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Return ``function`` of each item, in order; threads help where cores of this process are idle.

    Work that is spread may spread its own: what helps is counted over the whole process. After an error no item is
    begun any more.
    """
    waiting = list(enumerate(items))[::-1]
    results: dict[int, R] = {}
    errors: list[BaseException] = []

    def work() -> None:
        while not errors:
            try:
                place, item = waiting.pop()
            except IndexError:
                return
            try:
                results[place] = function(item)
            except BaseException as error:
                errors.append(error)

    silenced = np.geterr()  # which threads do not inherit

    def help_out() -> None:
        try:
            with np.errstate(**silenced):
                work()
        finally:
            _SPARE.release()

    helpers: list[Thread] = []
    while len(helpers) < len(waiting) - 1 and _SPARE.acquire(blocking=False):
        helpers.append(Thread(target=help_out, daemon=True))
    for helper in helpers:
        helper.start()
    work()
    if helpers:
        _SPARE.release()  # what this thread waits for may spread its own
        for helper in helpers:
            helper.join()
        _SPARE.acquire()
    if errors:
        raise errors[0]
    return [results[place] for place in range(len(items))]


def cache_once(function: Callable[P, R]) -> Callable[P, R]:
    """Return ``function`` with its results kept: of threads that ask at once, one computes, and all get the same."""
    kept: Callable[..., R] = cache(function)
    lock = RLock()

    @wraps(function)
    def ask(*args: P.args, **kwargs: P.kwargs) -> R:
        with lock:
            return kept(*args, **kwargs)

    return ask
