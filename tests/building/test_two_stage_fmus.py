"""The FMU of the two-stage drivetrain in its interfaces: exchange, events, directional derivatives, findings."""

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.validation import validate_fmu

import orchestrator as oc
from orchestrator.building.build import ensure_built
from orchestrator.building.compilers import find_compiler
from orchestrator.checking.check import CheckOptions, check_fmu
from tests.support.fmi3_calls import Slave3
from tests.support.model_exchange import (
    END,
    STEP,
    compare_directional_derivatives,
    event_times,
    request,
    stepped_and_exchanged,
)
from tests.support.two_stage_solution import solve_two_stages

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")

NAME = "TwoStageTrain"
OUTPUTS = ["theta_m", "theta_s", "theta_l", "contact_1", "contact_2"]
FRICTION = {
    "effects.coulomb_friction.motor.torque": 1.0,
    "effects.coulomb_friction.shaft.torque": 0.4,
    "effects.coulomb_friction.load.torque": 4.0,
}
CASES = {
    "both gaps": {"alpha_1": 0.01, "alpha_2": 0.01},
    "gap of stage 1": {"alpha_2": 0.0},
    "gap of stage 2": {"alpha_1": 0.0, "tau": 0.05},
    "friction": {"tau": 0.05, **FRICTION},
}


@pytest.fixture(scope="module")
def train(build_native: Callable[..., dict[str, Path]]) -> Path:
    return build_native([NAME])[NAME]


@pytest.fixture(scope="module")
def train3(build_native: Callable[..., dict[str, Path]]) -> Path:
    return build_native([NAME], fmi=3)[NAME]


@pytest.fixture(scope="module")
def kinds(train: Path, train3: Path) -> dict[str, Path]:
    return {"2 python": ensure_built([NAME])[NAME], "2 native": train, "3 native": train3}


@pytest.mark.parametrize("kind", ["2 python", "2 native", "3 native"])
def test_fmpy_finds_nothing(kinds: dict[str, Path], kind: str) -> None:
    assert validate_fmu(str(kinds[kind])) == []


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=pytest.mark.night) for kind in ("2 native", "3 native")])
def test_the_check_finds_nothing(kinds: dict[str, Path], kind: str) -> None:
    report = check_fmu(kinds[kind], CheckOptions())
    assert report.findings == ()
    assert report.executed


@pytest.mark.parametrize("name", CASES)
def test_model_exchange_moves_as_co_simulation_does(train: Path, name: str) -> None:
    stepped, integrated = stepped_and_exchanged(train, CASES[name], OUTPUTS)
    for output in OUTPUTS[:3]:
        assert np.max(np.abs(integrated[output] - stepped[output])) < 1e-6
    for output in OUTPUTS[3:]:
        assert np.mean(integrated[output] == stepped[output]) > 0.99  # an event may lie at a communication point
    assert np.count_nonzero(np.diff(stepped["contact_1"])) + np.count_nonzero(np.diff(stepped["contact_2"])) > 3


def test_events_of_model_exchange_are_those_of_an_independent_solution(train: Path) -> None:
    names = {v.name: v for v in read_model_description(str(train)).modelVariables}
    values = {name: float(v.start) for name, v in names.items() if v.causality == "parameter"}
    count = round(END / STEP)
    _, _, instants = solve_two_stages(values, np.array([request(n) for n in range(count)]), np.zeros(count), STEP)
    found = event_times(train, {})
    assert len(instants) > 20
    for instant in instants[:20]:
        assert min(abs(time - instant) for time in found) < 1e-8


@pytest.mark.parametrize("case", ["both gaps", "friction"])
def test_a_step_ends_at_each_event_once(train3: Path, case: str) -> None:
    outputs = ("theta_m", "theta_s", "theta_l", "contact_1", "contact_2", "twist_1", "twist_2")
    starts: dict[str, Any] = {"u": 3.0, "omega_m_start": 4.0, **CASES[case]}
    slave = Slave3(train3, events=True, early_return=True)
    slave.start(starts)
    rows, events = slave.run_with_events(1.0, 1e-2, outputs)
    assert slave.messages == []
    slave.close()
    other = Slave3(train3)
    other.start(starts)
    for n, row in enumerate(rows):
        other.step(n * 1e-2, 1e-2)
        np.testing.assert_allclose(row, [other.get(name)[0] for name in outputs], rtol=0.0, atol=1e-8)
    other.close()
    times = [time for time, _, _ in events]
    assert len(times) > 5
    assert np.min(np.diff(times)) > 0.0
    changes = [(before, after) for _, before, after in events if before[3:5] != after[3:5]]
    assert len(changes) > 3
    for before, after in changes:
        stage = 0 if before[3] != after[3] else 1
        assert abs(before[5 + stage]) == pytest.approx(0.01, abs=1e-12), "the flank is reached"


@pytest.mark.parametrize("name", CASES)
def test_directional_derivatives_are_those_of_differences(train: Path, name: str) -> None:
    description = read_model_description(str(train))
    references = {v.name: v.valueReference for v in description.modelVariables}
    states = [n for n in references if n.startswith("state.")]
    outputs = [v.name for v in description.modelVariables if v.causality == "output" and v.type == "Real"]
    fmu = started(train, {**CASES[name], "theta_m_start": 0.3})
    fmu.setReal([references["u"]], [30.0])
    fmu.newDiscreteStates()
    fmu.enterContinuousTimeMode()
    nominal = np.array([1.0, 10.0, 1.0, 10.0, 1.0, 10.0, 100.0, 100.0, 100.0])
    unknown = [*(f"der({n})" for n in states), *outputs]
    compare_directional_derivatives(fmu, references, [*states, "u", "T_l"], unknown, nominal, sorted(CASES).index(name))
    fmu.terminate()
    fmu.freeInstance()


def test_the_example_runs_through_both_gaps() -> None:
    path = Path(__file__).resolve().parents[2] / "docs" / "examples" / "two_stages.toml"
    result = oc.simulate(path, stop=1.0)
    for stage in (1, 2):
        assert set(result[f"train.contact_{stage}"].tolist()) == {-1.0, 0.0, 1.0}


def test_a_dead_time_is_refused_in_model_exchange(train: Path) -> None:
    with pytest.raises(FMICallException):
        started(train, {"effects.input_delay.delay": 0.1})


@pytest.mark.parametrize("fmi", [2, 3])
def test_states_that_events_change_say_so(build_native: Callable[..., dict[str, Path]], fmi: int) -> None:
    """Standards ask for `reinit` at every state that an event sets anew, here by friction and by impacts."""
    expected = {
        NAME: {"omega_m", "omega_s", "omega_l"},
        "Drivetrain": {"omega_m", "theta_l", "omega_l", "s", "z_m", "z_l", "w"},
        "ServoAxis": {"omega_m", "z"},
    }
    for name, path in build_native(list(expected), fmi=fmi).items():
        root = ElementTree.fromstring(ZipFile(path).read("modelDescription.xml"))
        says = {v.get("name") for v in root.iter() if any(e.get("reinit") == "true" for e in (v, *v)) and v.get("name")}
        assert says == {f"state.{state}" for state in expected[name]}


def started(path: Path, start: dict[str, float]) -> FMU2Model:
    """An instance behind its initialisation."""
    description = read_model_description(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    fmu = FMU2Model(guid=description.guid, unzipDirectory=extract(str(path)), modelIdentifier=NAME)
    fmu.instantiate()
    for name, value in start.items():
        fmu.setReal([references[name]], [value])
    fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu
