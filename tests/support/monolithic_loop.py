"""The sampled-data loop of an experiment in one piece: event-located plant, filter and control law in matrices.

It shares the gains with the project, which are parameters, and no code of the loop.
"""

import numpy as np

from tests.support.reference_plant import ReferencePlant, first_flank, reference_sample


def monolithic_loop(experiment, alpha, errors=None):
    """Return theta_m, theta_l and the estimated theta_l at the communication points, shape (steps + 1, 3)."""
    e = experiment
    plant = ReferencePlant(alpha=alpha, model=e.backlash_model if alpha else "dead_zone")
    estimator, K = e.estimator(), np.array(e.regulator().gains)
    C = np.zeros((2, 6))
    C[0, 0] = C[1, 2] = 1.0
    angle, speed = e.reference()
    errors = np.zeros((2, e.steps + 1)) if errors is None else np.asarray(errors)
    x, x_hat, u = np.zeros(6), np.zeros(6), 0.0
    flank = first_flank(plant, x)
    out = np.zeros((e.steps + 1, 3))
    for n in range(e.steps):
        x, flank = reference_sample(plant, x, flank, u, 0.0, e.sample_time, 1e-12, 1e-14)
        predicted = estimator.A @ x_hat + estimator.B * u
        measured = np.array([x[0], x[2]]) + errors[:, n + 1]
        x_hat = predicted + estimator.L @ (measured - C @ predicted)
        u = state_feedback(K, x_hat, angle[n + 1], speed[n + 1], plant)
        u = float(np.clip(u, -e.torque_limit, e.torque_limit))
        out[n + 1] = x[0], x[2], x_hat[2]
    return out


def state_feedback(K, x_hat, angle, speed, plant):
    """Regulate the deviation from the equilibrium at the wanted load angle against the estimated load torque."""
    T_l = x_hat[4]
    wanted = np.array([plant.i * (angle + T_l / plant.k), plant.i * speed, angle, speed, T_l / plant.i])
    return T_l / plant.i - K @ (x_hat[[0, 1, 2, 3, 5]] - wanted)
