"""What a program makes of the end of its work: one line for an error, and the exit code."""

import io
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any, TextIO, cast

from orchestrator.commands._lines import fold
from orchestrator.commands._parser import word_error
from orchestrator.errors import InputError, OrchestratorError
from orchestrator.plain_text import plain_text, shorten
from orchestrator.shared.stopping import stop_in_words


def exit_code(run: Callable[[], int], flags: Mapping[str, str]) -> int:
    """Run a program's work and return its exit code: that of the work, 2 for bad input, 1 for other errors.

    It is 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of any script, whatever the terminal's encoding
        sys.stdout = cast(TextIO, ForgivingStream(sys.stdout))
    try:
        code = int(run())
        sys.stdout.flush()
        return code
    except OrchestratorError as error:
        _say(f"error: {plain_text(word_error(error, flags))}")
        return 2 if isinstance(error, InputError) else 1
    except KeyboardInterrupt as interruption:  # an engine's says what is kept and how to go on
        text = word_error(interruption, flags)
        word, code = stop_in_words()
        _say(f"{word}: {text}" if text else word)
        return code
    except BrokenPipeError:
        raise  # whoever read the output has gone: the program ends without a word
    except (OSError, MemoryError) as error:  # no descriptors, no memory, a full disk behind standard output
        _say(f"error: {shorten(plain_text(str(error) or 'out of memory'))}")
        return 1


def _say(text: str) -> None:
    """Write one line to standard error, folded between words on a terminal."""
    sys.stderr.write(f"{fold(text, sys.stderr)}\n")


class ForgivingStream:
    """Standard output that may close while a command goes on: files count, what is printed after that is dropped."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write ``text``; after the reader has gone away, write nothing."""
        try:
            return int(self._stream.write(text))
        except BrokenPipeError:
            self._drop()
            return len(text)

    def flush(self) -> None:
        """Hand on what is buffered; after the reader has gone away, drop it."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._drop()

    def _drop(self) -> None:
        with open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), self._stream.fileno())
