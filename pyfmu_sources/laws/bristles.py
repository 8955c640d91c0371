"""Bristles of friction that builds up, of one body: how far they bend, and when a body slides on settled ones.

Sources: Dahl's and LuGre's bristle (Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Automatic Control 40(3),
1995): the torque is ``stiffness z + damping z'`` with ``z' = v - |v| z / reach(v)``, where ``reach(v) = distance
friction(v) / breakaway`` and ``stiffness = breakaway / distance``. Friction that grows with the torque that is carried
builds up at this stiffness, too, with 1 N.m of it in the breakaway; where there is no other, it is set-valued, for its
reach goes to zero with that torque.

In all functions: ``bristle``: its bending [rad]; ``reach``: bending at which it slides [rad].
"""

# A bristle has settled when it is this near to its reach.
SETTLED = 1e-6
# Where friction falls with speed, a bristle follows its reach with a lag: it counts as settled so near to it where its
# equation is quicker than this [1/s]; beyond these many Stribeck speeds friction falls no more.
SETTLED_FALLING = 0.02
QUICKEST = 5e3
FALLEN = 4.0
# Faster than it was left, so that no part goes to and fro between both ways of computing it.
ENTER = 1.2
LEAST_SPEED = 1e-9


def leaving_speed(distance: float, falls: bool, stribeck_speed: float) -> float:
    """Return the speed [rad/s] below which the bristle of a part that slides must be followed.

    Args:
        distance: over which friction builds up [rad].
        stribeck_speed: [rad/s].
    """
    return min(FALLEN * stribeck_speed, QUICKEST * distance) if falls else 0.0


def bent_sign(bristle: float, rate: float, reach: float, stiffness: float, damping: float) -> float:
    """Return the direction of friction (-1 to 1 without damping) of a bristle that bends at ``rate`` [rad/s].

    Args:
        stiffness: of the bristle [N.m/rad].
        damping: of the bristle [N.m.s/rad].
    """
    if reach <= 0.0:
        return 0.0
    return (bristle + damping / stiffness * rate) / reach


def has_settled(bristle: float, speed: float, reach: float, leaving: float, falls: bool) -> bool:
    """Tell whether a bristle has settled at the reach of a part that slides.

    Args:
        speed: of the part [rad/s].
        leaving: speed below which the bristle must be followed [rad/s].
    """
    side = 1.0 if speed > 0.0 else -1.0
    if abs(speed) < max(LEAST_SPEED, ENTER * leaving) or reach <= 0.0:
        return False
    near = SETTLED_FALLING if falls and abs(speed) > QUICKEST * reach else SETTLED
    return abs(side * bristle - reach) <= near * reach
