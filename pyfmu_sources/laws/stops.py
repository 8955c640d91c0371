"""What meets a body at an angle: end stops, springs and cables.

In all functions: ``angle`` [rad]; ``speed`` [rad/s]; ``stiffness`` [N.m/rad]; ``cubic`` [N.m/rad3].
"""

from .parameter_rows import BIG, Parameter, mark_linear

SPRING = (
    Parameter("effects.spring_load.stiffness", "N.m/rad", 0.0, -BIG, BIG, "Spring or cable that pulls the load back"),
    Parameter("effects.spring_load.cubic", "N.m/rad3", 0.0, -BIG, BIG, "Its cubic stiffness"),
    *mark_linear(
        Parameter("effects.spring_load.angle", "rad", 0.0, -BIG, BIG, "Load angle at which it is at rest"),
    ),
)
END_STOPS = (
    Parameter("effects.end_stop.lower", "rad", -BIG, -BIG, BIG, "Load angle of the lower end stop"),
    Parameter("effects.end_stop.upper", "rad", BIG, -BIG, BIG, "Load angle of the upper end stop"),
    *mark_linear(
        Parameter("effects.end_stop.stiffness", "N.m/rad", 1e4, 0.0, BIG, "Stiffness of the end stops"),
        Parameter("effects.end_stop.dissipation", "s/rad", 0.1, 0.0, BIG, "Their damping, per stiffness and depth"),
    ),
)


def spring_torque(angle: float, stiffness: float, cubic: float, neutral: float) -> float:
    """Return the torque [N.m] against a part of a spring or a cable that is at rest at the angle ``neutral`` [rad]."""
    if stiffness == 0.0 and cubic == 0.0:
        return 0.0
    way = angle - neutral
    return stiffness * way + cubic * way * way * way


def end_stop_torque(
    angle: float, speed: float, lower: float, upper: float, stiffness: float, dissipation: float
) -> float:
    """Return the torque [N.m] against a part of two end stops (Hunt and Crossley, J. Applied Mechanics 42(2), 1975).

    Inside the stop by ``d`` and moving further in with ``v`` the stop pushes back by ``stiffness d (1 + dissipation
    v)``; it never pulls. ``lower``: angle of the lower stop [rad]; ``upper``: angle of the upper stop [rad];
    ``dissipation``: [s/rad].
    """
    if angle > upper:
        return max(0.0, stiffness * (angle - upper) * (1.0 + dissipation * speed))
    if angle < lower:
        return min(0.0, stiffness * (angle - lower) * (1.0 - dissipation * speed))
    return 0.0
