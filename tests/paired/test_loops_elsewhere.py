"""The paired loops as a scenario for SSP."""

import numpy as np
import pytest

from orchestrator.errors import ScenarioError
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.scenario import scenario_of_pair


def test_a_scenario_leads_both_loops_to_one_angle(fmus) -> None:
    scenario = scenario_of_pair(Experiment(), fmus, 0.02, 0.5)
    starts = {instance.name: instance.start for instance in scenario.system.instances}
    assert (starts["plant"]["alpha"], starts["twin_plant"]["alpha"]) == (0.02, 0.0)
    angles = {source.target: source.signal.sample(np.zeros(1))[0] for source in scenario.system.sources}
    assert angles == {
        "controller.reference": 0.5, "controller.reference_speed": 0.0,
        "twin_controller.reference": 0.5, "twin_controller.reference_speed": 0.0,
    }  # fmt: skip
    assert (scenario.stop, len(scenario.record)) == (2.0, 8)


@pytest.mark.parametrize(
    ("alpha", "reference", "said"),
    [
        (0.0, -1e12, ""),
        (1e12, 1e12, ""),
        (-1e-9, 0.0, r"`alpha` must lie in \[0, 1e12\] rad, but is -1e-09"),
        (1.1e12, 0.0, "`alpha` must lie in"),
        (0.0, -1.1e12, r"`reference` must lie in \[-1e\+12, 1e12\] rad"),
        (0.0, float("nan"), "`reference` must lie in"),
    ],
)
def test_numbers_that_a_scenario_cannot_hold_are_refused(fmus, alpha: float, reference: float, said: str) -> None:
    if said:
        with pytest.raises(ScenarioError, match=said):
            scenario_of_pair(Experiment(), fmus, alpha, reference)
    else:
        assert scenario_of_pair(Experiment(), fmus, alpha, reference).name == "paired"
