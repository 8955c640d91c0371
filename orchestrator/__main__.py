"""``python -m orchestrator``, and the program ``backlash-cosim``."""

import importlib
import os
import sys

from orchestrator.shared.stopping import end_on_signals, stop_in_words, stop_on_signals, take_held_signals


def run(module: str = "orchestrator.cli") -> None:
    """Run a command line and end the process with its exit code."""
    stop_on_signals()
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # of small matrices threads are no help
        os.environ.setdefault(name, "1")
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:  # closed by the caller: what is written then goes nowhere
            null = os.open(os.devnull, os.O_WRONLY)
            if null != number:
                os.dup2(null, number)
            setattr(sys, name, open(number, "w", encoding="utf-8"))  # noqa: SIM115 - until the process ends
    try:
        # Here, for Ctrl-C and a lack of memory or descriptors may come while modules are loaded.
        take_held_signals()
        code = importlib.import_module(module).main()
    except SystemExit as ended:  # help, the version, or words that are refused
        code = ended.code
    except KeyboardInterrupt:
        word, code = stop_in_words()
        sys.stderr.write(f"{word}\n")
    except BrokenPipeError:
        code = 1
    except (OSError, ImportError, MemoryError) as error:
        code = _tell(error)
    end_on_signals()
    try:
        sys.stdout.flush()
    except OSError as error:
        if not code:  # else a command has told it
            code = 1 if isinstance(error, BrokenPipeError) else _tell(error)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # else the interpreter complains once more when it ends
    sys.exit(code)


def _tell(error: BaseException) -> int:
    """Say what went wrong, in one line, and return the exit code."""
    sys.stderr.write(f"error: {' '.join(str(error).split())[:300] or 'out of memory'}\n")
    return 1


if __name__ == "__main__":
    run()
