"""``python -m fmu_check``, and the program ``fmu-check``."""

import sys
from pathlib import Path


def run() -> None:
    """Run the program and end the process with its exit code."""
    sys.path.insert(0, str(Path(__file__).with_name("code")))
    from orchestrator.__main__ import run as run_program

    run_program("orchestrator.commands._fmu_check")


if __name__ == "__main__":
    run()
