"""Sizes of :mod:`.kernel` for a drivetrain: two bodies and a gap."""

from typing import Annotated, Any

from orchestrator.building.translation.kinds import REAL, ArrayKind

BODIES, STAGES, MODES, MOVING, STATES = 2, 1, 5, 4, 5

Vector = Annotated[Any, ArrayKind(REAL, (5,))]
Matrix = Annotated[Any, ArrayKind(REAL, (5, 5))]
Inputs = Annotated[Any, ArrayKind(REAL, (3, 5))]
Halves = Annotated[Any, ArrayKind(REAL, (1,))]
Stages = Annotated[Any, ArrayKind(REAL, (1, 5))]
ModeVectors = Annotated[Any, ArrayKind(REAL, (5, 5))]
ModeMatrices = Annotated[Any, ArrayKind(REAL, (5, 5, 5))]
ModeInputs = Annotated[Any, ArrayKind(REAL, (5, 3, 5))]
States = Annotated[Any, ArrayKind(REAL, (None, 5))]
FlankList = Annotated[Any, ArrayKind(REAL, (1,))]
