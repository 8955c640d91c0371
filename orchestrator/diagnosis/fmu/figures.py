"""Figures of a diagnosis: what was measured, and what each model says."""

from pathlib import Path

import numpy as np

from orchestrator.diagnosis.fmu.judged import BoxOutcome


def draw_signals(path: Path, outcome: BoxOutcome) -> None:
    """Draw outputs, and the residuals of each model in units of the noise at a scale of its own; shaded: held out.

    Args:
        path: the picture.
        outcome: of the diagnosis.
    """
    from matplotlib.figure import Figure

    problem = outcome.problem
    data = problem.data
    count = len(problem.outputs)
    figure = Figure(figsize=(10.0, 2.2 * 3 * count), layout="constrained")
    axes = np.atleast_1d(figure.subplots(3 * count, 1, sharex=True))
    held = data.time[3 * len(data.time) // 4]
    for k, name in enumerate(problem.outputs):
        above, before, after = axes[3 * k : 3 * k + 3]
        above.plot(data.time, data.outputs[:, k], color="0.6", linewidth=2.0, label="measured")
        for y, label, colour in zip(
            outcome.stages, ("nominal", "re-fitted", "corrected"), ("#c8553d", "#e0a030", "#1b6ca8"), strict=True
        ):
            above.plot(data.time, y[:, k], color=colour, linewidth=0.8, label=label)
            below = after if label == "corrected" else before
            residual = (data.outputs[:, k] - y[:, k]) / problem.noise[k]
            below.plot(data.time, residual, color=colour, linewidth=0.7, label=label)
        above.set_ylabel(f"{name} [{problem.units.get(name, '1')}]")
        before.set_ylabel("residual / noise")
        after.set_ylabel("residual / noise")
        for axis in (above, before, after):
            axis.axvspan(held, data.time[-1], color="0.93", zorder=-1)
            axis.legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0, fontsize=8)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=110)
