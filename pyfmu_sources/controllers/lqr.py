"""The sampled-data state feedback, with the load torque fed forward.

``u = sat( -K (x_hat - x_ref) + u_ref )``: the regulator of the controllable five-state model works on the deviation
from an equilibrium. At a load angle ``reference`` against a load torque ``T_l`` the shaft has to be wound by
``T_l / k``, so that ``theta_m = i (reference + T_l / k)``, and the motor has to hold ``T_l / i``.
"""

Gains = tuple[float, float, float, float, float]
Estimate = tuple[float, float, float, float, float, float]


def control(
    reference: float,
    reference_speed: float,
    estimate: Estimate,
    gains: Gains,
    i: float,
    compliance: float,
    u_max: float,
) -> float:
    """Return the torque request [N.m] of the state feedback.

    Args:
        reference: wanted load angle [rad].
        reference_speed: wanted load speed [rad/s].
        estimate: ``(theta_m, omega_m, theta_l, omega_l, T_l, T_m)`` as estimated.
        gains: ``K`` for ``(theta_m, omega_m, theta_l, omega_l, T_m)``.
        compliance: 1/k of the shaft [rad/(N.m)].
        u_max: torque limit [N.m].
    """
    theta_m, omega_m, theta_l, omega_l, T_l, T_m = estimate
    k1, k2, k3, k4, k5 = gains
    hold = T_l / i
    u = (
        hold
        - k1 * (theta_m - i * (reference + T_l * compliance))
        - k2 * (omega_m - i * reference_speed)
        - k3 * (theta_l - reference)
        - k4 * (omega_l - reference_speed)
        - k5 * (T_m - hold)
    )
    if u > u_max:
        return u_max
    if u < -u_max:
        return -u_max
    return u
