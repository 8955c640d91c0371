"""The thesis's errata, each with the computation that shows it."""

import numpy as np

from benchmarks.thesis import published
from benchmarks.thesis.recompute import (
    C_L,
    C,
    error_covariance,
    model_behind_the_gains,
    observer_gain,
    size_hidden_in_the_filter,
    table_comparison,
)
from benchmarks.thesis.tables import Erratum
from orchestrator.errors import DesignError
from orchestrator.paired.compiled_loop import make_loop
from orchestrator.paired.experiment import thesis_experiment
from orchestrator.plants.design import (
    DrivetrainValues,
    design_regulator,
    five_state_model,
    rank_report,
    six_state_model,
)


def errata() -> list[Erratum]:
    """Return all errata, computed afresh."""
    return [
        _erratum_of_damping(), _controllability(), _dual_gain(), _input_sign(), _gear_ratio(),
        _erratum_of_known_gap(), _mean_square(), _noise_inverse(), _erratum_of_delay(),
    ]  # fmt: skip


def _erratum_of_damping() -> Erratum:
    v = DrivetrainValues()
    from_parameters = -(v.c / v.i**2 + v.b_m) / v.J_m
    true_model = observer_gain(six_state_model(v).A, C, 1.0, published.R)
    printed_model = observer_gain(model_behind_the_gains(), C, 1.0, published.R)
    return Erratum(
        1,
        "A(2,2), Fig. A.1",
        "-5.73",
        f"{from_parameters:.4f} by eq. 3.5 and the printed parameters",
        f"Fig. 3.4's second gain, printed 4400.9, is {printed_model[1]:.1f} with {published.A22_BEHIND_THE_GAINS} "
        f"and {true_model[1]:.1f} with {from_parameters:.4f}",
    )


def _controllability() -> Erratum:
    report = rank_report(six_state_model(DrivetrainValues()))
    try:
        design_regulator(six_state_model(DrivetrainValues()), np.eye(6), published.R, 1e-3)
        outcome = "the design went through"
    except DesignError as error:
        outcome = f"the design is refused: {error}"
    gains = design_regulator(five_state_model(DrivetrainValues()), np.eye(5), published.R, 1e-3).gains
    listed = ", ".join(f"{g:.1f}" for g in gains)
    return Erratum(
        2,
        "section 3, controllability",
        "the six-state model is used for the regulator",
        f"(A, B) has rank {report.controllable} of {report.order}; the five-state model has K = [{listed}] at 1 ms",
        outcome,
    )


def _dual_gain() -> Erratum:
    A = model_behind_the_gains()
    B = six_state_model(DrivetrainValues()).B
    K = np.array([published.K])
    controllable = [0, 1, 2, 3, 5]
    worst = float(np.linalg.eigvals((A - B @ K)[np.ix_(controllable, controllable)]).real.max())
    observer = float(np.linalg.eigvals(A - K.T @ C).real.max())
    return Erratum(
        3,
        "K, Fig. 3.4",
        "a feedback gain",
        "the gain of the dual, an observer gain for C = [1 0 1 0 0 0]",
        f"as an observer A - K'C has its slowest pole at {observer:.4g} 1/s, as feedback of the "
        f"controllable states A - BK has one at {worst:+.4g} 1/s",
    )


def _input_sign() -> Erratum:
    tau = DrivetrainValues().tau
    right, wrong = (-b / (-1 / tau) for b in (1 / tau, -1 / tau))  # where T' = -T/tau + b u is at rest
    return Erratum(
        4,
        "B(6), eq. 3.6",
        "-1/tau",
        "+1/tau, as in Fig. A.1",
        f"a request of 1 N.m ends at a motor torque of {right:+g} N.m with +1/tau and {wrong:+g} N.m with -1/tau",
    )


def _gear_ratio() -> Erratum:
    v = DrivetrainValues()
    theta_l, omega_l = 1.0, 1.0
    theta_m, omega_m = v.i * theta_l, v.i * omega_l
    printed = v.k * (theta_m - theta_l)
    mended = v.k * (theta_m / v.i - theta_l)
    damper_printed = v.c * (omega_m + omega_l)
    damper_mended = v.c * (omega_m / v.i - omega_l)
    return Erratum(
        5,
        "eq. 2.6",
        "twist theta_m - theta_l; third branch with theta_m' + theta_l'",
        "twist theta_m/i - theta_l and its derivative in every branch",
        f"with the gear turned as one piece by 1 rad the spring as printed pulls with {printed:.0f} N.m, mended with "
        f"{mended:.0f}; at 1 rad/s the damper as printed with {damper_printed:.3f} N.m, mended "
        f"with {damper_mended:.0f}",
    )


def _erratum_of_known_gap() -> Erratum:
    return Erratum(
        6,
        "V_d = alpha I6, Figs. 3.7 and 3.8",
        "the filter's noise covariance is the actual size",
        "an estimator that never sees alpha",
        f"the printed K_fl alone gives the size away: V_d = {size_hidden_in_the_filter():.4f} reproduces it best, "
        f"printed {published.V_D_EXAMPLE}",
    )


def _mean_square() -> Erratum:
    table = table_comparison()
    squares = table.mse * len(published.TABLE_4_1)
    return Erratum(
        7,
        "Table 4.1",
        f"MSE {published.MSE_TABLE:.3e}",
        f"MSE {table.mse:.3e}, mean error {table.mean_error_percent:.2f} %",
        f"the eight squares add up to {squares:.7f}, not to {8 * published.MSE_TABLE:.6f}",
    )


def _noise_inverse() -> Erratum:
    A = model_behind_the_gains()
    gain = observer_gain(A, C_L, published.V_D_EXAMPLE, published.V_N)
    covariance = error_covariance(A, C_L, published.V_D_EXAMPLE, published.V_N)
    literal = (covariance @ C_L.T).ravel() * published.V_N
    return Erratum(
        8,
        "eq. 3.24",
        "K_f = Y C* V_n",
        "K_f = Y C* V_n^-1",
        f"third entry of the printed gain {published.K_FL[2]:.4f}: with the inverse {gain[2]:.4f}, as printed "
        f"{literal[2]:.3g}",
    )


def _erratum_of_delay() -> Erratum:
    experiment = thesis_experiment()
    loop = make_loop(experiment)
    errors = experiment.encoder_errors(0)  # there are none
    level = 0.05 * experiment.amplitude
    with_gap, without = (loop.run(alpha, errors)[:, 1] for alpha in (published.TABLE_4_1[-1].alpha, 0.0))
    reached = [float(experiment.times[np.argmax(theta > level)]) for theta in (with_gap, without)]
    return Erratum(
        9,
        "Figs. 4.2 ff.",
        "text: the delayed line is without backlash (black); captions: black is with backlash",
        "the delayed line is the loop with backlash",
        f"the load passes {level:.3g} rad after {reached[0]:.3f} s with a half-gap of "
        f"{published.TABLE_4_1[-1].alpha} rad and after {reached[1]:.3f} s without",
    )
