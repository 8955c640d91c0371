"""``python -m orchestrator``."""

import gc
import sys

from orchestrator.cli import main

if __name__ == "__main__":
    code = main()
    gc.freeze()  # else the interpreter takes a second to collect numba's objects before it ends
    sys.exit(code)
