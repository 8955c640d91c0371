"""A single axis: one inertia behind the torque lag of its drive, with the effects of input, motor and sensor.

State ``x = (position, speed, drive, bristle, request)``: position [rad or m], its speed, the drive's torque or force
[N.m or N], the bristle of friction that builds up [rad or m], the filtered request [N.m or N].
An axis is as well a motor with its load (rad, kg.m2, N.m) as a carriage on a screw (m, kg, N): the equations are the
same, the model file states the unit.

::

    J speed' = drive + ripple(position) - b speed - sign(speed) friction(|speed|) - drag speed |speed|
               - difference |speed| - load_torque - gravity(position) - spring(position) - stops(position, speed) - T_l
    tau drive' = u - drive          (tau = 0: drive = u)
"""

from math import exp, sqrt

from .bristles import bent_sign, has_settled, leaving_speed
from .drivetrain_parameters import BIG, TINY
from .effects import (
    UNASKED,
    bristle_rate,
    dependent_friction,
    directional_friction,
    end_stop_torque,
    gravity_torque,
    periodic,
    periodic_slope,
    quadratic_drag,
    ramp_end,
    ramp_target,
    ramp_time,
    request_rate,
    sliding_friction,
    spring_torque,
    torque_ripple,
)
from .servo_axis_parameters import (
    P_B,
    P_BREAKAWAY,
    P_BRISTLE_C,
    P_COULOMB,
    P_DIRECTION,
    P_DRAG,
    P_FILTER,
    P_GRAVITY,
    P_GRAVITY_PHASE,
    P_J,
    P_J_WAVE,
    P_J_WAVE_N,
    P_J_WAVE_PHASE,
    P_LOAD_TORQUE,
    P_PRESLIDING,
    P_RATE,
    P_RIPPLE,
    P_RIPPLE_2,
    P_RIPPLE_2_PHASE,
    P_RIPPLE_3,
    P_RIPPLE_3_PHASE,
    P_RIPPLE_N,
    P_RIPPLE_PHASE,
    P_SPRING,
    P_SPRING_ANGLE,
    P_SPRING_CUBIC,
    P_STOP_D,
    P_STOP_K,
    P_STOP_LOWER,
    P_STOP_UPPER,
    P_STRIBECK,
    P_STRIBECK_SPEED,
    P_TAU,
    P_WAVY,
    P_WAVY_N,
    P_WAVY_PHASE,
)

State = tuple[float, float, float, float, float]
Parameters = tuple[float, ...]

# Integration steps that one communication step may take, and how many more for each second of it.
MAX_STEPS = 20000
MAX_STEPS_PER_SECOND = 20000.0


def start(position: float, speed: float, drive: float, p: Parameters) -> State:
    """Return the state in which a simulation starts: the bristle of an axis that moves has settled.

    Args:
        position: [rad].
        speed: [rad/s].
        drive: torque of the drive [N.m].
        p: parameters, in the order of the FMU's table.

    Returns:
        The state.
    """
    x = (position, speed, drive, 0.0, UNASKED)
    if speed == 0.0 or not builds_up(p):
        return x
    return (position, speed, drive, reach(x, p) if speed > 0.0 else -reach(x, p), UNASKED)


def friction(x: State, p: Parameters) -> float:
    """Return the magnitude of dry friction [N.m] at the axis's speed and position.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.

    Returns:
        The magnitude.
    """
    level = sliding_friction(x[1], p[P_COULOMB], p[P_STRIBECK], p[P_BREAKAWAY], p[P_STRIBECK_SPEED])
    if p[P_WAVY] == 0.0:
        return level
    return dependent_friction(level, 0.0, 0.0, x[0], p[P_WAVY], p[P_WAVY_N], p[P_WAVY_PHASE])


def filtered(p: Parameters) -> bool:
    """Tell whether the request is filtered or limited in rate.

    Args:
        p: parameters, in the order of the FMU's table.

    Returns:
        True when it is.
    """
    return p[P_FILTER] > 0.0 or p[P_RATE] < BIG


def drive_torque(x: State, p: Parameters, u: float) -> float:
    """Return the drive's torque [N.m]: the state behind the lag, or the (filtered) request itself without one.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.

    Returns:
        The torque.
    """
    if p[P_TAU] > 0.0:
        return x[2]
    return x[4] if filtered(p) and x[4] != UNASKED else u


def sliding_torque(x: State, p: Parameters, u: float, T_l: float) -> float:
    """Return the torque on the axis [N.m] of all but dry friction.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        The torque.
    """
    torque = drive_torque(x, p, u) + torque_ripple(x[0], p[P_RIPPLE], p[P_RIPPLE_N], p[P_RIPPLE_PHASE])
    if p[P_RIPPLE_2] != 0.0 or p[P_RIPPLE_3] != 0.0:
        torque += torque_ripple(x[0], p[P_RIPPLE_2], 2.0 * p[P_RIPPLE_N], p[P_RIPPLE_2_PHASE])
        torque += torque_ripple(x[0], p[P_RIPPLE_3], 3.0 * p[P_RIPPLE_N], p[P_RIPPLE_3_PHASE])
    torque -= p[P_B] * x[1] + quadratic_drag(x[1], p[P_DRAG]) + p[P_LOAD_TORQUE] + T_l
    torque -= directional_friction(x[1], p[P_DIRECTION])
    torque -= gravity_torque(x[0], p[P_GRAVITY], p[P_GRAVITY_PHASE])
    if p[P_SPRING] != 0.0 or p[P_SPRING_CUBIC] != 0.0:
        torque -= spring_torque(x[0], p[P_SPRING], p[P_SPRING_CUBIC], p[P_SPRING_ANGLE])
    if x[0] > p[P_STOP_UPPER] or x[0] < p[P_STOP_LOWER]:
        torque -= end_stop_torque(x[0], x[1], p[P_STOP_LOWER], p[P_STOP_UPPER], p[P_STOP_K], p[P_STOP_D])
    if p[P_J_WAVE] != 0.0:
        torque -= 0.5 * periodic_slope(x[0], p[P_J_WAVE], p[P_J_WAVE_N], p[P_J_WAVE_PHASE]) * x[1] * x[1]
    return torque


def inertia(x: State, p: Parameters) -> float:
    """Return the inertia [kg.m2] at a position; a wave larger than it leaves a thousandth of it.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.

    Returns:
        The inertia.
    """
    if p[P_J_WAVE] == 0.0:
        return p[P_J]
    return max(1e-3 * p[P_J], p[P_J] + periodic(x[0], p[P_J_WAVE], p[P_J_WAVE_N], p[P_J_WAVE_PHASE]))


def rates(x: State, sign: float, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x``, the bristle apart.

    Args:
        x: state.
        sign: direction of dry friction, -1 to 1; a smooth approximation passes ``tanh(speed/width)``.
        p: parameters in the order of ``PARAMETERS``.
        u: requested torque [N.m], delayed and saturated already, held.
        T_l: external load torque [N.m], held.

    Returns:
        The derivative.
    """
    asked = u
    follows = 0.0
    if filtered(p):
        asked = x[4]
        follows = request_rate(x[4], u, p[P_FILTER], p[P_RATE])
    lag = (asked - x[2]) / p[P_TAU] if p[P_TAU] > 0.0 else 0.0
    accelerated = (sliding_torque(x, p, u, T_l) - sign * friction(x, p)) / inertia(x, p)
    return (x[1], accelerated, lag, 0.0, follows)


def rest(p: Parameters) -> float:
    """Return the breakaway torque [N.m] without what depends on the position.

    Args:
        p: parameters, in the order of the FMU's table.

    Returns:
        The torque.
    """
    return p[P_COULOMB] + max(p[P_STRIBECK], p[P_BREAKAWAY])


def capacity(x: State, p: Parameters) -> float:
    """Return the breakaway torque [N.m] below which an axis that stands still keeps standing.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.

    Returns:
        The torque.
    """
    if p[P_WAVY] == 0.0:
        return rest(p)
    return dependent_friction(rest(p), 0.0, 0.0, x[0], p[P_WAVY], p[P_WAVY_N], p[P_WAVY_PHASE])


def builds_up(p: Parameters) -> bool:
    """Tell whether friction builds up over a distance.

    Args:
        p: parameters, in the order of the FMU's table.

    Returns:
        True when it does.
    """
    return p[P_PRESLIDING] > 0.0 and rest(p) > 0.0


def reach(x: State, p: Parameters) -> float:
    """Return the bending [rad] at which the bristle slides at its speed.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.

    Returns:
        The bending.
    """
    return p[P_PRESLIDING] * friction(x, p) / rest(p)


def falls(p: Parameters) -> bool:
    """Tell whether friction depends on the speed.

    Args:
        p: parameters, in the order of the FMU's table.

    Returns:
        True when it does.
    """
    return p[P_STRIBECK] != p[P_BREAKAWAY]


def leaves_sliding(p: Parameters) -> float:
    """Return the speed [rad/s] below which the bristle of an axis that slides must be followed.

    Args:
        p: parameters, in the order of the FMU's table.

    Returns:
        The speed; 0.0 where there is no bristle.
    """
    return leaving_speed(p[P_PRESLIDING], falls(p), p[P_STRIBECK_SPEED]) if builds_up(p) else 0.0


def mode_rates(x: State, mode: int, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x``; an axis in mode 0 bends its bristle, or sticks where it has none.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        mode: direction of sliding, 0: none.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        The derivative.
    """
    if mode != 0:
        return rates(x, float(mode), p, u, T_l)
    if builds_up(p):
        far = reach(x, p)
        bends = bristle_rate(x[3], x[1], far)
        r = rates(x, bent_sign(x[3], bends, far, rest(p) / p[P_PRESLIDING], p[P_BRISTLE_C]), p, u, T_l)
        return (r[0], r[1], r[2], bends, r[4])
    r = rates(x, 0.0, p, u, T_l)
    return (0.0, 0.0, r[2], 0.0, r[4])


def slip_at_rest(x: State, p: Parameters, u: float, T_l: float) -> int:
    """Return the direction in which an axis at rest starts to slide, 0 when friction holds it.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].

    Returns:
        -1, 0 or 1.
    """
    push = sliding_torque((x[0], 0.0, x[2], x[3], x[4]), p, u, T_l)
    if push > capacity(x, p):
        return 1
    if push < -capacity(x, p):
        return -1
    return 0


def initial_mode(x: State, p: Parameters, u: float) -> int:
    """Return the direction of sliding (0: none) in which a simulation starts from ``x``, asked for ``u`` [N.m].

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.

    Returns:
        -1, 0 or 1.
    """
    if builds_up(p):
        return 0
    if x[1] != 0.0:
        return 1 if x[1] > 0.0 else -1
    return slip_at_rest(x, p, u, 0.0)


def longest_step(x: State, mode: int, p: Parameters, h: float) -> float:
    """Return a step [s] that resolves all rates well (a Runge-Kutta step errs by its 5th power).

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        mode: direction of sliding, 0: none.
        p: parameters, in the order of the FMU's table.
        h: length of the step [s].

    Returns:
        The step, at most ``h``.
    """
    rate = (p[P_B] + abs(p[P_DIRECTION]) + 2.0 * p[P_DRAG] * abs(x[1])) / p[P_J]
    if p[P_TAU] > 0.0:
        rate = max(rate, 1.0 / p[P_TAU])
    if p[P_RIPPLE] != 0.0:
        rate = max(rate, p[P_RIPPLE_N] * (abs(x[1]) + sqrt(abs(p[P_RIPPLE]) / (p[P_RIPPLE_N] * p[P_J] + TINY))))
    if falls(p):
        rate = max(rate, abs(p[P_BREAKAWAY] - p[P_STRIBECK]) / (p[P_STRIBECK_SPEED] * p[P_J]))
    return min(h, 0.05 / (max(rate, further_rate(x, mode, p)) + TINY))


def further_rate(x: State, mode: int, p: Parameters) -> float:
    """Return the fastest rate [1/s] of bristle, filter, harmonics, spring, end stops and varying inertia.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        mode: direction of sliding, 0: none.
        p: parameters, in the order of the FMU's table.

    Returns:
        The rate.
    """
    rate = 0.0
    if mode == 0 and builds_up(p):
        stiffness = rest(p) / p[P_PRESLIDING]
        rate = max(sqrt(stiffness / p[P_J]), p[P_BRISTLE_C] / p[P_J]) + abs(x[1]) / (reach(x, p) + TINY)
    if p[P_FILTER] > 0.0:
        rate = max(rate, 1.0 / p[P_FILTER])
    if p[P_RIPPLE_2] != 0.0 or p[P_RIPPLE_3] != 0.0:
        torque = abs(p[P_RIPPLE_2]) + abs(p[P_RIPPLE_3])
        rate = max(rate, 3.0 * p[P_RIPPLE_N] * (abs(x[1]) + sqrt(torque / (p[P_RIPPLE_N] * p[P_J] + TINY))))
    if p[P_SPRING] != 0.0 or p[P_SPRING_CUBIC] != 0.0:
        way = x[0] - p[P_SPRING_ANGLE]
        rate = max(rate, sqrt((abs(p[P_SPRING]) + 3.0 * abs(p[P_SPRING_CUBIC]) * way * way) / p[P_J]))
    if past_stop(x, p) != 0:
        rate = max(rate, sqrt(p[P_STOP_K] * (1.0 + p[P_STOP_D] * abs(x[1])) / p[P_J]))
    if p[P_J_WAVE] != 0.0:
        rate = max(rate, p[P_J_WAVE_N] * abs(x[1]))
    if p[P_WAVY] != 0.0:
        rate = max(rate, p[P_WAVY_N] * (abs(x[1]) + sqrt(abs(p[P_WAVY]) / (p[P_WAVY_N] * p[P_J] + TINY))))
    return rate


def along(x: State, h: float, r: State) -> State:
    """Return ``x + h r``.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        h: length of the step [s].
        r: derivative.

    Returns:
        The state.
    """
    return (x[0] + h * r[0], x[1] + h * r[1], x[2] + h * r[2], x[3] + h * r[3], x[4] + h * r[4])


def smooth_step(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> State:
    """Return the state after one classical Runge-Kutta step in one direction of sliding.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        mode: direction of sliding, 0: none.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        The state.
    """
    a = mode_rates(x, mode, p, u, T_l)
    b = mode_rates(along(x, 0.5 * h, a), mode, p, u, T_l)
    c = mode_rates(along(x, 0.5 * h, b), mode, p, u, T_l)
    d = mode_rates(along(x, h, c), mode, p, u, T_l)
    w = h / 6.0
    return (
        x[0] + w * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]),
        x[1] + w * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]),
        x[2] + w * (a[2] + 2.0 * b[2] + 2.0 * c[2] + d[2]),
        x[3] + w * (a[3] + 2.0 * b[3] + 2.0 * c[3] + d[3]),
        x[4] + w * (a[4] + 2.0 * b[4] + 2.0 * c[4] + d[4]),
    )


def slowing_time(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float, least: float) -> float:
    """Return when within ``h`` [s] an axis that slides falls to the speed ``least`` [rad/s] (bisection).

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        mode: direction of sliding, 0: none.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].
        least: [rad/s].

    Returns:
        The time [s].
    """
    low, high = 0.0, h
    for _ in range(50):
        middle = 0.5 * (low + high)
        if smooth_step(x, mode, p, u, T_l, middle)[1] * mode > least:
            low = middle
        else:
            high = middle
    return high


def held(x: State, p: Parameters, u: float, T_l: float, h: float) -> State:
    """Return the state after ``h`` [s] at rest: the drive's torque alone moves.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        The state.
    """
    if filtered(p):
        return smooth_step((x[0], 0.0, x[2], x[3], x[4]), 0, p, u, T_l, h)
    share = 1.0 - exp(-h / p[P_TAU]) if p[P_TAU] > 0.0 else 0.0
    return (x[0], 0.0, x[2] + share * (u - x[2]), x[3], x[4])


def breaking_time(x: State, p: Parameters, u: float, T_l: float, h: float) -> float:
    """Return when within ``h`` [s] the growing torque of the drive breaks an axis away that sticks (bisection).

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        The time [s].
    """
    low, high = 0.0, h
    for _ in range(50):
        middle = 0.5 * (low + high)
        if slip_at_rest(held(x, p, u, T_l, middle), p, u, T_l) == 0:
            low = middle
        else:
            high = middle
    return high


def settled(x: State, p: Parameters) -> int:
    """Return the direction of sliding of an axis whose bristle has settled, or 0.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.

    Returns:
        -1, 0 or 1.
    """
    if has_settled(x[3], x[1], reach(x, p), leaves_sliding(p), falls(p)):
        return 1 if x[1] > 0.0 else -1
    return 0


def advance(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, int]:
    """Return state and direction of sliding after ``h`` [s] with the inputs held; stops are located.

    The state is NaN where damping, lag or ripple are so quick that no sensible number of steps resolves them.

    Args:
        x: state.
        mode: direction of sliding, from :func:`initial_mode` or the step before.
        p: parameters.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: step [s], positive.

    Returns:
        Both.
    """
    if x[4] == UNASKED and filtered(p):
        x = (x[0], x[1], x[2], x[3], u)
    if p[P_RATE] >= BIG:
        return advance_request(x, mode, p, u, T_l, h)
    before = x[4]
    ramp = min(h, ramp_time(before, u, p[P_FILTER], p[P_RATE]))
    if ramp > 0.0:
        x, mode = advance_request(x, mode, p, ramp_target(before, u, p[P_FILTER], p[P_RATE], ramp), T_l, ramp)
    if ramp < h:
        if ramp > 0.0:
            x = (x[0], x[1], x[2], x[3], ramp_end(before, u, p[P_FILTER], p[P_RATE]))
        x, mode = advance_request(x, mode, p, u, T_l, h - ramp)
    return (x, mode)


def past_stop(x: State, p: Parameters) -> int:
    """Return the end stop at which the axis is: -1, 0 (none) or 1.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        p: parameters, in the order of the FMU's table.

    Returns:
        -1, 0 or 1.
    """
    return 1 if x[0] > p[P_STOP_UPPER] else -1 if x[0] < p[P_STOP_LOWER] else 0


def stop_time(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> float:
    """Return when within ``h`` [s] an axis reaches or leaves an end stop (bisection).

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        mode: direction of sliding, 0: none.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        The time [s].
    """
    low, high = 0.0, h
    begin = past_stop(x, p)
    for _ in range(50):
        middle = 0.5 * (low + high)
        if past_stop(smooth_step(x, mode, p, u, T_l, middle), p) == begin:
            low = middle
        else:
            high = middle
    return high


def advance_request(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, int]:
    """Return :func:`advance` for a request whose ramp does not end inside the step.

    Args:
        x: position, speed, drive torque, bristle and filtered request.
        mode: direction of sliding, 0: none.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        Both.
    """
    bends = builds_up(p)
    dry = rest(p) + abs(p[P_WAVY]) > 0.0
    least = leaves_sliding(p)
    if mode == 0 and not dry:
        mode = 1
    elapsed = 0.0
    pieces = 0
    most = MAX_STEPS + int(MAX_STEPS_PER_SECOND * h)
    while h - elapsed > 1e-12 * h:
        pieces += 1
        if pieces > most:
            nan = float("nan")
            return ((nan, nan, nan, nan, nan), mode)
        step = min(longest_step(x, mode, p, h), h - elapsed)
        if dry and not bends and mode == 0:
            mode = slip_at_rest(x, p, u, T_l)
            if mode == 0:
                stays = held(x, p, u, T_l, step)
                if slip_at_rest(stays, p, u, T_l) != 0:
                    step = breaking_time(x, p, u, T_l, step)
                    stays = held(x, p, u, T_l, step)
                x = stays
                elapsed += step
                continue
        moved = smooth_step(x, mode, p, u, T_l, step)
        if past_stop(x, p) != past_stop(moved, p):
            step = stop_time(x, mode, p, u, T_l, step)
            moved = smooth_step(x, mode, p, u, T_l, step)
        if dry and mode != 0 and moved[1] * mode < least:
            step = slowing_time(x, mode, p, u, T_l, step, least)
            moved = smooth_step(x, mode, p, u, T_l, step)
            if bends:
                x = (moved[0], moved[1], moved[2], mode * reach(moved, p), moved[4])
                mode = 0
            else:
                x = (moved[0], 0.0, moved[2], moved[3], moved[4])
                mode = slip_at_rest(x, p, u, T_l)
        else:
            x = moved
            if bends and mode == 0:
                mode = settled(x, p)
        elapsed += step
    return (x, mode)
