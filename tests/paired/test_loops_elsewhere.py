"""The paired loops where others run them: in a page, and as a scenario for SSP."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.errors import ScenarioError
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.live import pair_system, regulator_design
from orchestrator.paired.scenario import scenario_of_pair

NOISY = replace(Experiment(), encoder_noise=1e-4)
REFERENCES = ["controller.reference", "controller.reference_speed"]
ERRORS = ["estimator.theta_m", "estimator.theta_l"]


def test_a_page_runs_both_loops_with_the_gap_and_the_errors_in_the_first() -> None:
    system = pair_system(NOISY, 0.02, 3, {"twin_plant.J_l": 5.0})
    names = ["plant", "estimator", "controller", "twin_plant", "twin_estimator", "twin_controller"]
    assert [instance.name for instance in system.instances] == names
    values = {instance.name: instance.values for instance in system.instances}
    assert (values["plant"]["alpha"], values["plant"]["backlash_model"]) == (0.02, "dead_zone")
    assert (values["twin_plant"]["alpha"], values["twin_plant"]["backlash_model"]) == (0.0, "none")
    assert (values["plant"]["J_l"], values["twin_plant"]["J_l"]) == (Experiment().values.J_l, 5.0)
    assert values["estimator"] == values["twin_estimator"]
    assert values["controller"] == values["twin_controller"]
    assert len(system.connections) == 20
    assert sum(source.startswith("twin_") and to.startswith("twin_") for source, to in system.connections) == 10
    for name, errors in zip(ERRORS, NOISY.encoder_errors(3), strict=True):
        np.testing.assert_array_equal(system.signals[name], errors)
    assert sorted(system.signals) == sorted([*REFERENCES, *(f"twin_{name}" for name in REFERENCES), *ERRORS])
    assert (system.step, system.steps, len(system.record)) == (1e-3, 2000, 12)


def test_a_page_without_noise_carries_no_errors() -> None:
    signals = pair_system(Experiment(), 0.02, 3, {}).signals
    assert sorted(signals) == sorted([*REFERENCES, *(f"twin_{name}" for name in REFERENCES)])
    angle, speed = Experiment().reference()
    np.testing.assert_array_equal(signals["twin_controller.reference"], angle)
    np.testing.assert_array_equal(signals["controller.reference_speed"], speed)


def test_a_page_designs_the_regulator_from_the_weights() -> None:
    design = regulator_design(Experiment())
    assert design.weights == (10.0, 50.0, 1.0, 1.0, 0.01, 2e-3)
    assert (len(design.matrix), len(design.column), design.sample_time) == (25, 5, 1e-3)


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
