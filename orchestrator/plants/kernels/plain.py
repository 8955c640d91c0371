"""What a plant has that says nothing else: no dry friction, no teeth or end stops that meet, one body."""

from orchestrator.plants.kernels.drivetrain import Values
from orchestrator.plants.kernels.point import Point

SLOTS = "orchestrator.plants.kernels.drivetrain"
LAST_ANGLE, LAST_SPEED = 0, 1


def friction(x: Point, values: Values) -> tuple[float, float]:
    """Return the levels of dry friction [N.m]. ``x``: state, ``values``: parameters."""
    return (0.0, 0.0)


def rest_levels(values: Values) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """Return the levels at rest [N.m], and whether they depend on more than speed. ``values``: parameters."""
    return ((0.0, 0.0), (False, False))


def reaches(values: Values) -> tuple[float, float]:
    """Return the distances [rad] over which friction builds up. ``values``: parameters."""
    return (1.0, 1.0)


def has_flanks(values: Values) -> bool:
    """Tell whether there are teeth or end stops. ``values``: parameters."""
    return False


def meets(x: Point, rate: Point, values: Values, h: float) -> bool:
    """Tell whether any may meet within ``h`` [s]. ``x``: state, ``rate``: its rates, ``values``: parameters."""
    return False
