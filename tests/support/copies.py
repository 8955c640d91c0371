"""Copies of the project that a test changes, and programs run in them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def copy_project(target: Path) -> None:
    """Copy the packages and what tests share into ``target``, with what Python compiled of them: a warm start."""
    for package in ("orchestrator", "pyfmu_sources", "tests/support"):
        shutil.copytree(ROOT / package, target / package)


def run_in_copy(program: str, root: Path) -> str:
    """Return what a program prints when it imports the copy."""
    environment = os.environ | {"PYTHONPATH": str(root)}
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=root, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    return run.stdout
