"""Work that is spread over cores: in order, once each, and with the first error."""

import threading
import time

import numpy as np
import pytest

from orchestrator.shared import cores
from orchestrator.shared.cores import cache_once, map_on_threads
from tests.support.waiting import wait_until

LATE = 60.0  # s: threads that do not meet by then, never will


def test_results_come_in_order_of_their_items() -> None:
    def slow(n: int) -> int:
        time.sleep(0.002 * (5 - n % 5))
        return n * n

    assert map_on_threads(slow, range(20)) == [n * n for n in range(20)]
    assert map_on_threads(slow, []) == []


def test_helpers_are_counted_over_the_whole_process(monkeypatch) -> None:
    monkeypatch.setattr(cores, "_SPARE", threading.Semaphore(2))
    running, most, lock, three = set(), [], threading.Lock(), threading.Event()

    def inner(n: int) -> int:
        with lock:
            running.add(threading.get_ident())
            most.append(len(running))
            if len(running) == 3:
                three.set()
        if not three.wait(LATE):  # so many come together, however late each is
            three.set()
        time.sleep(0.005)  # in which too many would meet
        with lock:
            running.discard(threading.get_ident())
        return n

    def outer(n: int) -> list[int]:
        return map_on_threads(inner, range(4))

    assert map_on_threads(outer, range(6)) == [[0, 1, 2, 3]] * 6
    assert max(most) == 3
    assert all(cores._SPARE.acquire(blocking=False) for _ in range(2))  # both have been given back


def test_after_an_error_nothing_is_begun(monkeypatch) -> None:
    monkeypatch.setattr(cores, "_SPARE", threading.Semaphore(1))
    begun = []

    def fails(n: int) -> int:
        begun.append(n)
        if n == 1:
            raise ValueError("one")
        if n == 0:
            wait_until(lambda: cores._SPARE._value == 1)  # the other thread has ended, or waits for this one
        return n

    with pytest.raises(ValueError, match="one"):
        map_on_threads(fails, range(50))
    assert sorted(begun) == [0, 1]


def test_a_thread_that_waits_gives_its_core_to_what_it_waits_for(monkeypatch) -> None:
    monkeypatch.setattr(cores, "_SPARE", threading.Semaphore(1))
    begun, at_once = threading.Barrier(2), threading.Barrier(2)

    def ends() -> None:
        begun.wait(timeout=LATE)

    def spreads() -> None:
        begun.wait(timeout=LATE)
        wait_until(lambda: cores._SPARE._value == 1)  # the other has ended, or waits
        map_on_threads(lambda n: at_once.wait(timeout=LATE), range(2))  # breaks where one thread must do both

    map_on_threads(lambda call: call(), (ends, spreads))
    map_on_threads(lambda call: call(), (spreads, ends))
    assert cores._SPARE.acquire(blocking=False)
    assert not cores._SPARE.acquire(blocking=False)


def test_threads_that_ask_at_once_get_one_result(monkeypatch) -> None:
    monkeypatch.setattr(cores, "_SPARE", threading.Semaphore(1))
    asked = threading.Barrier(2)
    made = []

    @cache_once
    def make(name: str) -> object:
        time.sleep(0.1)
        made.append(name)
        return object()

    def ask(name: str) -> object:
        asked.wait(timeout=LATE)
        return make(name)

    first, second = map_on_threads(ask, ("same", "same"))
    assert first is second
    assert made == ["same"]
    assert make("other") is not first


def test_what_numpy_is_to_be_silent_about_holds_in_every_thread(monkeypatch) -> None:
    monkeypatch.setattr(cores, "_SPARE", threading.Semaphore(1))
    both_run = threading.Barrier(2)

    def silent(n: int) -> str:
        both_run.wait(timeout=LATE)
        return np.geterr()["over"]

    with np.errstate(over="ignore"):
        assert map_on_threads(silent, range(2)) == ["ignore", "ignore"]
