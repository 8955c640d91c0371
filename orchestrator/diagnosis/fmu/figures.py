"""Figures of a diagnosis: what was measured, and what each model says."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.problem import BoxProblem

Array = NDArray[np.float64]
COLOURS = ("#c8553d", "#e0a030", "#1b6ca8")


def draw_signals(path: Path, problem: BoxProblem, stages: Mapping[str, Array], test: int) -> None:
    """Draw outputs, and the residuals of each model in units of the noise at a scale of its own; shaded: test data.

    Args:
        stages: name -> outputs (n, outputs) of a model, the best one last.
    """
    from matplotlib.figure import Figure

    data, count, last = problem.data, len(problem.outputs), list(stages)[-1]
    figure = Figure(figsize=(10.0, 2.2 * 3 * count), layout="constrained")
    axes = np.atleast_1d(figure.subplots(3 * count, 1, sharex=True))
    for k, name in enumerate(problem.outputs):
        above, before, after = axes[3 * k : 3 * k + 3]
        above.plot(data.time, data.outputs[:, k], color="0.6", linewidth=2.0, label="measured")
        for (label, y), colour in zip(stages.items(), COLOURS, strict=False):
            above.plot(data.time, y[:, k], color=colour, linewidth=0.8, label=label)
            below = after if label == last else before
            residual = (data.outputs[:, k] - y[:, k]) / problem.noise[k]
            below.plot(data.time, residual, color=colour, linewidth=0.7, label=label)
        above.set_ylabel(f"{name} [{problem.units.get(name, '1')}]")
        before.set_ylabel("residual / noise")
        after.set_ylabel("residual / noise")
        for axis in (above, before, after):
            axis.axvspan(data.time[min(test, len(data.time) - 1)], data.time[-1], color="0.93", zorder=-1)
            axis.legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0, fontsize=8)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=110)
