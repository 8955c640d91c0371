"""Sweeps of the fault-injection FMU: the engine, the master and a real FMU together."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.engine import Case, ResultColumn, Work
from orchestrator.errors import SlaveError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.system import System

SCRIPT = Path(__file__).with_name("faulty_slave.py")
STEPS = 20
STEP = 0.05


def build(directory: Path) -> Path:
    """Build the FMU and return its path."""
    command = [sys.executable, "-W", "ignore", "-m", "pythonfmu", "build", "-f", str(SCRIPT), "-d", str(directory)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return directory / "Faulty.fmu"


def work(fmu: Path) -> Work:
    """Return the work of a sweep over ``faulty.fault`` and ``faulty.gain``."""
    return Work(prepare, run, (ResultColumn("y"),), files={"faulty": fmu})


def prepare(payload: Any, files: Mapping[str, Path]) -> Session:
    """Instantiate once per process."""
    del payload
    system = System((fmu_instance("faulty", files["faulty"]),))
    return Session(system, ["faulty.y"], GaussSeidel(STEP), STEPS * STEP)


def run(session: Session, case: Case) -> dict[str, float]:
    """Run for one second of simulated time."""
    start = {name: int(value) if name.endswith("fault") else value for name, value in case.parameters.items()}
    found = session.run(start)
    if len(found["faulty.y"]) <= STEPS:
        raise SlaveError(str(found.remarks[0]))
    return {"y": float(found["faulty.y"][-1])}
