"""Single steps of the FMUs' plants in C: kernels for tests."""

from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals
from orchestrator.building.translation.kinds import REAL, WHOLE, ArrayKind
from pyfmu_sources.axis.axis_equations import COUNT as AXIS_COUNT
from pyfmu_sources.axis.axis_equations import AxisParameters
from pyfmu_sources.axis.servo_axis import advance as advance_servo_axis
from pyfmu_sources.drivetrain.drivetrain import advance, prepare
from pyfmu_sources.drivetrain.equations import COUNT, DrivetrainParameters

__all__ = ["advance_axis", "advance_drivetrain"]

Twelve = Annotated[Any, ArrayKind(REAL, (12,))]
Five = Annotated[Any, ArrayKind(REAL, (5,))]
Modes = Annotated[Any, ArrayKind(WHOLE, (3,))]
One = Annotated[Any, ArrayKind(WHOLE, (1,))]


def advance_drivetrain(state: Twelve, modes: Modes, values: Reals, u: float, T_l: float, h: float) -> None:
    """Move state and mode of the drivetrain on in place."""
    p = DrivetrainParameters._make(values[n] for n in range(COUNT))
    x, mode = advance(
        tuple(state[n] for n in range(12)), (modes[0], modes[1], modes[2]), p, u, T_l, h, prepare(p, h)
    )  # fmt: skip
    for n in range(12):
        state[n] = x[n]
    modes[0], modes[1], modes[2] = mode[0], mode[1], mode[2]


def advance_axis(state: Five, modes: One, values: Reals, u: float, T_l: float, h: float) -> None:
    """Move state and direction of sliding of the axis on in place."""
    p = AxisParameters._make(values[n] for n in range(AXIS_COUNT))
    x, mode = advance_servo_axis(tuple(state[n] for n in range(5)), modes[0], p, u, T_l, h)
    for n in range(5):
        state[n] = x[n]
    modes[0] = mode
