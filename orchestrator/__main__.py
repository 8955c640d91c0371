"""``python -m orchestrator``, and the program ``backlash-cosim``."""

import importlib
import os
import sys

from orchestrator.shared.stopping import end_on_signals, stop_in_words, stop_on_signals


def run(module: str = "orchestrator.cli") -> None:
    """Run a command line and end the process with its exit code."""
    stop_on_signals()
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:  # closed by the caller: what is written then goes nowhere
            null = os.open(os.devnull, os.O_WRONLY)
            if null != number:
                os.dup2(null, number)
            setattr(sys, name, open(number, "w", encoding="utf-8"))  # noqa: SIM115 - until the process ends
    try:
        # Here, for Ctrl-C and a lack of memory or descriptors may come while modules are loaded.
        code = importlib.import_module(module).main()
        sys.stdout.flush()
    except KeyboardInterrupt:
        word, code = stop_in_words()
        sys.stderr.write(f"{word}\n")
    except BrokenPipeError:
        code = 1
    except (OSError, ImportError, MemoryError) as error:
        text = " ".join(str(error).split())[:300] or "out of memory"
        sys.stderr.write(f"error: {text}\n")
        code = 1
    end_on_signals()
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # else the interpreter complains once more when it ends
    sys.exit(code)


if __name__ == "__main__":
    run()
