"""Levels of trust: one bad finding outweighs all good ones, and each check finds what it is for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from orchestrator.estimation.protocol import Estimate
from orchestrator.estimation.settings import DEFAULT_SETTINGS, TrustSettings
from orchestrator.estimation.stages.location import Location, StageGap
from orchestrator.estimation.trust import trust_of_estimates, trust_of_location
from orchestrator.records.model_file import default_model
from orchestrator.records.record import Record
from orchestrator.shared.results import TrustFound
from orchestrator.shared.trust import Level, Reason, Trust, trust_of

GOOD = Estimate(
    "maximum_likelihood",
    0.02,
    1e-5,
    (0.01998, 0.02002),
    True,
    "",
    {"converged": True, "traversals": 40, "lacking": "", "parameters": {}},
)


def level_of(estimate: Estimate, **settings: float) -> Level:
    return trust_of_estimates([estimate], default_model(), TrustSettings(**settings))[estimate.method].level


def with_diagnostics(**changed: object) -> Estimate:
    return replace(GOOD, diagnostics={**GOOD.diagnostics, **changed})


def fitted(name: str, factor: float, error: float = 0.0) -> Estimate:
    nominal = default_model().parameters[name].value
    entry = {"value": nominal * factor, "standard_error": error * nominal, "nominal": nominal}
    return with_diagnostics(parameters={name: entry})


def test_the_worst_reason_decides_and_comes_first() -> None:
    found = trust_of([Reason(Level.AMBER, "a"), Reason(Level.GREEN, "b"), Reason(Level.RED, "c")])
    assert found == Trust(Level.RED, ("c", "a"))
    assert found.to_result() == TrustFound("red", ("c", "a"))
    assert str(found) == "red: c; a"
    assert str(trust_of([])) == "green"


def test_a_fit_with_nothing_against_it_is_green() -> None:
    assert level_of(GOOD) is Level.GREEN


@pytest.mark.parametrize(
    ("estimate", "level"),
    [
        (with_diagnostics(lacking="the model does not explain the record"), Level.AMBER),
        (with_diagnostics(converged=False), Level.AMBER),
        (with_diagnostics(traversals=2), Level.AMBER),
        (with_diagnostics(traversals=3), Level.GREEN),
        (replace(GOOD, standard_error=0.0041), Level.AMBER),
        (replace(GOOD, interval=(0.0, math.inf), visible=False), Level.AMBER),
        (replace(GOOD, interval=(0.0, 1e-3), visible=False), Level.GREEN),
        (fitted("J_l", 1.049), Level.GREEN),
        (fitted("J_l", 1.078), Level.AMBER),
        (fitted("J_l", 1.078, error=0.015), Level.GREEN),
        (fitted("b_m", 0.782), Level.RED),
    ],
)
def test_what_keeps_a_fit_from_green(estimate: Estimate, level: Level) -> None:
    assert level_of(estimate) is level


@pytest.mark.parametrize(("correlation", "level"), [(0.1, Level.GREEN), (0.9, Level.RED)])
def test_a_value_far_outside_is_red_only_where_the_half_gap_hangs_on_it(correlation: float, level: Level) -> None:
    tau = default_model().parameters["tau"].value
    parameters = {"alpha": {"value": 0.02, "standard_error": 1e-5, "nominal": 0.0}}
    parameters["tau"] = {"value": 0.85 * tau, "standard_error": 0.01 * tau, "nominal": tau}
    errors = np.array([1e-5, 0.01 * tau])
    covariance = np.outer(errors, errors) * np.array([[1.0, correlation], [correlation, 1.0]])
    assert level_of(replace(with_diagnostics(parameters=parameters), curves={"covariance": covariance})) is level


def test_a_value_outside_its_stated_range_is_named_with_both() -> None:
    (reason,) = trust_of_estimates([fitted("J_l", 1.078)], default_model())["maximum_likelihood"].reasons
    said = "`J_l` is fitted as 6.037, but stated as 5.6 to within 0.28: the half-gap hangs on it, and something may be"
    assert reason == f"{said} missing that it stands for; check its value and its unit"


def test_a_range_that_nobody_stated_is_no_reason() -> None:
    model = default_model()
    assumed = replace(model.parameters["J_l"], assumed=True)
    model = replace(model, parameters={**model.parameters, "J_l": assumed})
    assert trust_of_estimates([fitted("J_l", 1.5)], model)["maximum_likelihood"].level is Level.GREEN


@pytest.mark.parametrize(("visible", "said"), [(True, "no upper end"), (False, "cannot show a gap")])
def test_an_interval_without_an_upper_end_is_said_of_a_gap_that_is_seen(visible: bool, said: str) -> None:
    estimate = replace(GOOD, interval=(0.0199, math.inf), visible=visible)
    (reason,) = trust_of_estimates([estimate], default_model())["maximum_likelihood"].reasons
    assert said in reason


@pytest.mark.parametrize(
    ("answers", "wide", "said"),
    [
        (("1",), "", ""), (("1",), "total", "both half-gaps together"), (("1", "both"), "total", "both half-gaps"),
        (("1",), "stage", "the half-gap of stage 1"), (("1", "both"), "stage", ""),
    ],
)  # fmt: skip
def test_a_size_that_may_be_anything_is_not_green(answers: tuple[str, ...], wide: str, said: str) -> None:
    """A set of answers is honest, and so are the sizes of its stages; both half-gaps together are one value."""
    close, apart = StageGap(0.01, (0.0099, 0.0101)), StageGap(0.01, (0.004, 0.016))
    total, stage = (apart if wide == name else close for name in ("total", "stage"))
    location = Location(answers, total, (stage, close), {}, True, True, 9, (0.0, 0.0), {}, {})
    record = Record(np.arange(400) * 1e-3, np.ones(400), np.ones(400), np.ones(400), "train")
    trust = trust_of_location(location, record, default_model(), DEFAULT_SETTINGS)
    assert trust.level is (Level.AMBER if said else Level.GREEN)
    assert all(reason.startswith(said) for reason in trust.reasons)


def test_methods_without_a_check_of_their_own_are_held_against_the_fit() -> None:
    near = Estimate("operating_data", 0.0201, 2e-4, (0.0197, 0.0205))
    far = Estimate("torque_pulse", 0.03, 1e-4, (0.0298, 0.0302))
    assert level_of(near) is Level.AMBER
    found = trust_of_estimates([near, far, GOOD], default_model())
    assert [found[name].level.word for name in ("operating_data", "torque_pulse")] == ["green", "red"]
    doubtful = with_diagnostics(lacking="the model does not explain the record")
    assert trust_of_estimates([near, doubtful], default_model())["operating_data"].level is Level.AMBER
