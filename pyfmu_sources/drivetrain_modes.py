"""The drivetrain as model exchange sees it: state derivatives, event indicators, what follows at an event.

The laws and their guards are those of :mod:`smooth_events`; here they are without the integrator, which is the host's.
"""

from .dormand_prince import mode_rates
from .drive_request import UNASKED, saturated
from .drivetrain_parameters import P_LIMIT, P_OFFSET_L, P_OFFSET_M, P_RES_J
from .dry_friction import NEVER, shaft_torque
from .equations import Mode, Parameters, State
from .smooth_events import guard, guard_room, settled

Indicators = tuple[float, float, float, float]
Outputs = tuple[float, float, float, float, float, float]

# An indicator turns negative when its guard is this many roundings below zero, so that the event update, which
# wants one, surely finds it violated.
ROOMS = 2.0
# Events that follow each other within this time [s] are chattering, as events within one communication step are.
QUIET = 1e-3


def state_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x`` in ``mode``; the states of an extra inertia that is not there stand still.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        The derivative.
    """
    r = mode_rates(x, mode, p, u, T_l)
    if p[P_RES_J] > 0.0:
        return r
    return (r[0], r[1], r[2], r[3], r[4], 0.0, 0.0, r[7], r[8], r[9], r[10], r[11])


def rates_and_outputs(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> tuple[State, Outputs]:
    """Return the derivatives, and the outputs theta_m, theta_l, omega_m, omega_l, T_m and T_shaft.

    Args:
        x: state.
        mode: mode, which is held.
        p: parameters.
        u: requested torque [N.m].
        T_l: load torque [N.m].

    Returns:
        Both, SI units.
    """
    shaft = shaft_torque(x, mode, p, T_l)
    outputs = (x[0] + p[P_OFFSET_M], x[2] + p[P_OFFSET_L], x[1], x[3], x[4], shaft)
    return (state_rates(x, mode, p, saturated(u, p[P_LIMIT]), T_l), outputs)


def indicator(x: State, mode: Mode, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return the event indicator ``which`` (0, 1: contact; 2: motor's friction; 3: load's), 1 if it is not in use.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        which: number of the guard.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        The indicator; negative ends the mode.
    """
    value = guard(x, mode, which, p, u, T_l)
    if value >= NEVER:
        return 1.0
    return value + ROOMS * guard_room(x, mode, which, p)


def indicators(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> Indicators:
    """Return all event indicators; the mode ends when one turns negative.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        The indicators.
    """
    return (
        indicator(x, mode, 0, p, u, T_l),
        indicator(x, mode, 1, p, u, T_l),
        indicator(x, mode, 2, p, u, T_l),
        indicator(x, mode, 3, p, u, T_l),
    )


def after_events(
    x: State, mode: Mode, events: int, quiet: bool, p: Parameters, u: float, T_l: float
) -> tuple[State, Mode, int]:
    """Return state, mode and number of events in a row once no guard is violated.

    Args:
        x: state at the event.
        mode: the mode that ends.
        events: how many events came before this one without a pause.
        quiet: whether there was a pause, so that counting begins anew.
        p: parameters.
        u: requested torque [N.m], saturated already.
        T_l: load torque [N.m].

    Returns:
        The three.
    """
    if x[11] == UNASKED:  # the drive has settled at what is asked first
        x = (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], u)
    return settled(x, mode, 0 if quiet else events, p, u, T_l)
