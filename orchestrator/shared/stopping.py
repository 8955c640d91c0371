"""Signals that ask this process to end: each ends it as Ctrl-C does, so that nothing half done is left.

Standard library alone, and little of it: signals may come while the rest is loaded.
"""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_ONE_STOP = 1.0  # s: `timeout` signals a process and then its group, terminals and shells do likewise
_stops: list[tuple[int, float]] = []
"""Number of each signal that has stopped this process, and when [s]."""


class Stopped(KeyboardInterrupt):
    """A signal asked this process to end.

    Not of the very class ``KeyboardInterrupt``: after one of these the interpreter would end by a signal, whatever the
    exit code is.
    """


def stop_on_signals() -> None:
    """Raise ``Stopped`` in the main thread at Ctrl-C, SIGTERM and SIGHUP, as far as whoever started it lets them be."""
    for number in _SIGNALS:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _stop)


def take_held_signals() -> None:
    """Take the signals that whoever started this process has had held back until it answers them in words."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)


def end_on_signals() -> None:
    """Let signals end the process at once: all that is to be cleaned up has been."""
    for number in _SIGNALS:
        if signal.getsignal(number) is _stop:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def signals_held() -> Iterator[None]:
    """Let the signals wait that end this process until the block has ended; outside the main thread none comes."""
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    came: list[int] = []
    try:
        for number, handler in before.items():
            if handler not in (signal.SIG_IGN, None):
                signal.signal(number, lambda number, _: came.append(number))
    except ValueError:  # another thread
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:
                signal.signal(number, handler)
        for number in came:
            signal.raise_signal(number)


def _stop(number: int, _: FrameType | None) -> None:
    now = time.monotonic()
    if not _stops or now - _stops[-1][1] > _ONE_STOP:  # else it is cleaning up
        _stops.append((number, now))
        raise Stopped


def stop_was_asked() -> bool:
    """Return whether a signal has asked this process to end; code of others may have kept the exception to itself."""
    return bool(_stops)


def stop_in_words() -> tuple[str, int]:
    """Return what a ``KeyboardInterrupt`` came of, in a word or two, and the exit code for it."""
    number = _stops[-1][0] if _stops else signal.SIGINT
    return "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}", 128 + number
