"""The plants' source with its steps in machine code, to be called as the source is."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from orchestrator.building.translation.kernels import Kernels
from pyfmu_sources.axis import servo_axis
from pyfmu_sources.drivetrain import drivetrain

STEPS = Kernels("tests.support.plant_kernels", checked=True)


def compiled_plant(name: str) -> Any:
    """Return what the module ``drivetrain`` or ``servo_axis`` has, its ``advance`` compiled."""
    source = {"drivetrain": drivetrain, "servo_axis": servo_axis}[name]
    return SimpleNamespace(**{**vars(source), "advance": _drivetrain if name == "drivetrain" else _axis})


def _drivetrain(x: Any, mode: Any, p: Any, u: float, T_l: float, h: float, table: Any) -> Any:
    state, modes = np.array(x, dtype=float), np.array(mode)
    STEPS.advance_drivetrain(state, modes, p, u, T_l, h)
    return tuple(state.tolist()), tuple(modes.tolist())


def _axis(x: Any, mode: int, p: Any, u: float, T_l: float, h: float) -> Any:
    state, modes = np.array(x, dtype=float), np.array([mode])
    STEPS.advance_axis(state, modes, p, u, T_l, h)
    return tuple(state.tolist()), int(modes[0])
