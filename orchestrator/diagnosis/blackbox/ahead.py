"""Whether the outputs of a record come before its inputs: no effect of a machine, but one of a log."""

from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.search import BoxSearch
from orchestrator.diagnosis.blackbox.verdict import recovered

HELD = 'half a row: a sensed input runs in straight lines between rows, `hold = "linear"`'
LOGGED = "a row: inputs were logged a row late, or outputs a row early"


def comes_ahead(search: BoxSearch, base: BoxFit) -> tuple[str, ...]:
    """Return what a record that no effect explains would say, were its inputs to come a little earlier.

    Args:
        search: that has found nothing.
        base: fit of the model without effects.

    Returns:
        A sentence where that explains most of what is missing.
    """
    fitter, problem = search.fitter, search.fitter.problem
    data = problem.data
    if data.factor > 1:
        return ()
    between = 0.5 * (data.inputs + np.vstack([data.inputs[1:], data.inputs[-1:]]))
    behind = np.vstack([data.outputs[:1], data.outputs[:-1]])  # the FMU starts with the first input as it is
    found = []
    for moved, words in ((replace(data, inputs=between), HELD), (replace(data, outputs=behind), LOGGED)):
        other = Fitter(replace(problem, data=moved), fitter.ladder, fitter.parts, fitter.settings)
        again = other.fit(base.model, base.level)
        again = None if again is None else other.settled(again)
        if again is not None and again.total - base.total > search.settings.pays:
            explains = recovered(base, again, len(problem.outputs), len(fitter.parts.looked_at))
            found.append((again.total, explains, words))
    _, explains, words = max(found, default=(0.0, 0.0, ""))
    if explains < search.settings.ahead_of_it:
        return ()
    much = 100.0 * min(explains, 1.0)
    return (f"{much:.0f} % of what is missing would be explained by inputs that come earlier by {words}",)
