#!/usr/bin/env bash
# Guess: FixedLagSmoother of FilterPy, which estimates a sample with the N that follow, is at least as good as the Kalman filter of the
#   same model, and approaches the RTS smoother as N grows.
# What happens: its gains are made of the filter's covariance and gain where the method needs those of the prediction, F - K H in place of
#   F (I - K H). With a good encoder the smoothed angle is three times worse than the unsmoothed one, and a longer lag makes the speed worse
#   still. With a poor one it is an improvement, as far as it goes. Nothing is said; the filter that comes with it is right. An RTS
#   smoother over the window of each sample is exact.
# Version: filterpy 2.0.0, numpy 2.4.6, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q filterpy==2.0.0 numpy==2.4.6 scipy==1.17.1

cat > run.py <<'PYTHON'
import filterpy
import numpy as np
from filterpy.kalman import FixedLagSmoother, KalmanFilter

STEP, SAMPLES, LAGS = 0.1, 3000, (1, 5, 20)
F = np.array([[1.0, STEP], [0.0, 1.0]])
Q = np.array([[STEP**3 / 3, STEP**2 / 2], [STEP**2 / 2, STEP]])  # angle and speed under a random torque


def prepare(estimator, variance):
    estimator.x, estimator.P = np.zeros((2, 1)), np.eye(2)
    estimator.F, estimator.H, estimator.Q, estimator.R = F, np.array([[1.0, 0.0]]), Q, np.array([[variance]])
    return estimator


def errors_of(estimate, truth):
    """Root mean square error of angle and speed."""
    return np.sqrt(np.mean((np.reshape(estimate, (SAMPLES, 2)) - truth)[50:-50] ** 2, axis=0))


print("filterpy", filterpy.__version__)
generator = np.random.default_rng(1)
root, truth = np.linalg.cholesky(Q), [np.zeros(2)]
for _ in range(SAMPLES - 1):
    truth.append(F @ truth[-1] + root @ generator.normal(size=2))
truth = np.array(truth)
ratios = {}
for variance in (1e-4, 0.25):
    measured = list(truth[:, 0] + np.sqrt(variance) * generator.normal(size=SAMPLES))
    kalman = prepare(KalmanFilter(2, 1), variance)
    means, covariances, _, _ = kalman.batch_filter(measured)
    unsmoothed = errors_of(means, truth)
    print(f"R = {variance}: filter {unsmoothed}, RTS {errors_of(kalman.rts_smoother(means, covariances)[0], truth)}")
    for lag in LAGS:
        smoothed, filtered = prepare(FixedLagSmoother(2, 1, N=lag), variance).smooth_batch(measured, lag)
        assert np.allclose(filtered, means)
        exact = np.zeros((SAMPLES, 2))
        for k in range(SAMPLES):
            window = slice(k, min(k + lag + 1, SAMPLES))
            exact[k] = kalman.rts_smoother(means[window], covariances[window])[0][0, :, 0]
        found, best = errors_of(smoothed, truth), errors_of(exact, truth)
        ratios[variance, lag] = found / unsmoothed
        print(f"  lag {lag}: FixedLagSmoother {found}, exact for that lag {best}")
        assert (best < unsmoothed).all() and (found > 1.02 * best).all()
assert all(ratios[1e-4, lag][0] > 2.5 for lag in LAGS)
assert ratios[1e-4, 20][1] > ratios[1e-4, 5][1] > 1.3
assert (ratios[0.25, 20] < 0.8).all()
PYTHON
venv/bin/python run.py
echo "as described"
