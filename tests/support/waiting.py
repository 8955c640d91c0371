"""Waiting in tests: for the event, and only in the end for the clock."""

import time
from collections.abc import Callable
from typing import Any

HANGS = 600.0  # s, after which what ends by itself hangs: far more than a busy computer takes


def wait_until(holds: Callable[[], Any], said: Callable[[], object] = str, pause: float = 0.02) -> Any:
    """Return what ``holds`` returns as soon as that is true; fail with what ``said`` returns where it never is."""
    end = time.monotonic() + HANGS
    while not (found := holds()):
        assert time.monotonic() < end, said()
        time.sleep(pause)
    return found
