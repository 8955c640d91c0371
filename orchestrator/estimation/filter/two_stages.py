"""Sizes of :mod:`.kernel` for a train of two stages: three bodies and two gaps."""

from typing import Annotated, Any

from orchestrator.building.translation.kinds import REAL, ArrayKind

BODIES, STAGES, MODES, MOVING, STATES = 3, 2, 25, 6, 7

Vector = Annotated[Any, ArrayKind(REAL, (7,))]
Matrix = Annotated[Any, ArrayKind(REAL, (7, 7))]
Inputs = Annotated[Any, ArrayKind(REAL, (3, 7))]
Halves = Annotated[Any, ArrayKind(REAL, (2,))]
Stages = Annotated[Any, ArrayKind(REAL, (2, 7))]
ModeVectors = Annotated[Any, ArrayKind(REAL, (25, 7))]
ModeMatrices = Annotated[Any, ArrayKind(REAL, (25, 7, 7))]
ModeInputs = Annotated[Any, ArrayKind(REAL, (25, 3, 7))]
States = Annotated[Any, ArrayKind(REAL, (None, 7))]
FlankList = Annotated[Any, ArrayKind(REAL, (2,))]
