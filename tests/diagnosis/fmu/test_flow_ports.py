"""Ports of which only the flow is known: a voltage and a current; values of any type that are set; drafts by units."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.calibrate import calibrate
from orchestrator.api.diagnose import diagnose
from orchestrator.diagnosis.fmu.corrected_ssp import parameter_values
from orchestrator.diagnosis.fmu.effects import OF_POSITION, find_effects
from orchestrator.diagnosis.fmu.mapping import Map, read_map
from orchestrator.diagnosis.fmu.system import FmuSystem, draft_map_text, read_system
from orchestrator.diagnosis.selection.outcome import Grade
from orchestrator.errors import ScenarioError
from orchestrator.master.protocol import ModelInterface, Variable
from tests.support.answers_fmu import build_answers_fmu
from tests.support.box_fmu import DOMAINS, write_fmu
from tests.support.box_records import FINE, excitation, simulate
from tests.support.c_fmu import have_compiler

compiled = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
NOISE = 2e-3  # A
CIRCUIT = replace(DOMAINS[2], outputs=(("i", "A"),), noise=(NOISE,))


def record_of_a_circuit(folder: Path, rows: int = 900) -> tuple[Path, float]:
    """A coil, a resistor and a capacitor in series, a resistance that grows with the current: its size, too."""
    rng = np.random.default_rng(5)
    p = np.array([v for v, _ in CIRCUIT.parameters.values()]) * (1.02, 0.97, 1.03)
    u = excitation(CIRCUIT, rng, rows)
    plain = simulate(CIRCUIT, p, np.repeat(u[:-1], FINE), 0, np.zeros(3), rows)
    size = 0.2 * float(np.std(u)) / float(np.std(plain[:, 1])) ** 2
    i = simulate(CIRCUIT, p, np.repeat(u[:-1], FINE), 2, np.array([size, 0.0, 0.0]), rows)[:, 1]
    table = np.column_stack([np.arange(rows) * CIRCUIT.h, u, i + NOISE * rng.standard_normal(rows)])
    path = folder / "record.csv"
    np.savetxt(path, table, fmt="%.10g", delimiter=",", header="time,U,i", comments="")
    return path, size


@compiled
@pytest.mark.slow
def test_a_resistance_that_grows_with_the_current_is_named_by_its_flow_alone(tmp_path: Path) -> None:
    path, size = record_of_a_circuit(tmp_path)
    fmu = write_fmu(tmp_path / "circuit.fmu", CIRCUIT)
    text = f"[inputs]\nU = {{}}\n[outputs]\ni = {{ noise = {NOISE} }}\n[parameters]\n"
    text += "".join(f'{name} = {{ uncertainty = "5 %" }}\n' for name in CIRCUIT.parameters)
    (tmp_path / "map.toml").write_text(text + '[ports.coil]\ninput = "U"\nvelocity = "i"\n')
    found = diagnose(path, fmu, tmp_path / "map.toml")
    try:
        assert [effect.label for effect in found.diagnosis.graded(Grade.LIKELY)] == ["quadratic_drag@coil"]
        value = found.effects[0].parameters["coefficient"]
        assert (value.value, value.unit) == (pytest.approx(size, rel=0.05), "V.s2/(A.s)2")
        assert max(one.final / one.noise for one in found.test[0].signals) < 1.3
        problem = found.diagnosis.workings.problem
        offered = {e.row.name for e in find_effects(problem, problem.must_read(problem.nominal)) if e.place == "coil"}
        assert {"viscous_drag", "quadratic_drag", "load"} <= offered
        assert not offered & set(OF_POSITION)
    finally:
        found.close()


MAP = '[inputs]\nu = {{}}\n[outputs]\nx = {{ noise = 1e-3 }}\n[parameters]\ngain = {{ uncertainty = "5 %" }}\n{}\n'


def mapped(folder: Path, more: str) -> Map:
    (folder / "map.toml").write_text(MAP.format(more))
    return read_map(folder / "map.toml", read_system(build_answers_fmu(folder, parameters=True)))


@compiled
def test_a_port_needs_a_position_or_a_velocity(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"ports.p must have `position`, `velocity` or both, but has neither"):
        mapped(tmp_path, '[ports.p]\ninput = "u"')
    assert mapped(tmp_path, '[ports.p]\ninput = "u"\nvelocity = "x"').ports["p"].flow_only
    assert not mapped(tmp_path, '[ports.p]\ninput = "u"\nposition = "x"').ports["p"].flow_only


@compiled
@pytest.mark.parametrize(("entry", "value"), [("on = { value = true }", True), ("mode = { value = 3 }", 3),
                                              ('label = { value = "abc" }', "abc"), ("on = {}", False)])  # fmt: skip
def test_values_of_any_type_are_set(tmp_path: Path, entry: str, value: object) -> None:
    assert mapped(tmp_path, entry).fixed == {entry.partition(" ")[0]: value}


def test_a_corrected_system_holds_values_of_any_type() -> None:
    text = parameter_values({"on": True, "mode": 3, "label": "abc", "gain": 2.0}).decode()
    for entry in ('Boolean value="true"', 'Integer value="3"', 'String value="abc"', 'Real value="2.0"'):
        assert f"<ssv:{entry}/>" in text


@compiled
def test_what_is_no_real_is_not_fitted_and_the_advice_works(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="must be of type Real to be fitted, but is Boolean: it can be set, with"):
        mapped(tmp_path, 'on = { value = true, uncertainty = "5 %" }')
    assert mapped(tmp_path, "on = { value = true }").fixed == {"on": True}
    for entry in ('on = { value = "yes" }', "mode = { value = 1.5 }"):
        with pytest.raises(ScenarioError, match="value must be"):
            mapped(tmp_path, entry)


@compiled
def test_values_that_are_set_act_and_warnings_are_among_the_notes(tmp_path: Path) -> None:
    """x' = 2 gain u + 3, as `on` and `mode` say."""
    mapped(tmp_path, "on = { value = true }\nmode = { value = 3 }")
    fmu = build_answers_fmu(tmp_path, "WARNS_FROM=1.0", parameters=True)
    rng = np.random.default_rng(1)
    t, u = 0.02 * np.arange(400), np.repeat(rng.uniform(-1.0, 1.0, 40), 10)
    x = np.concatenate([[0.0], np.cumsum(0.02 * (2.0 * 2.06 * u + 3.0))[:-1]]) + 1e-3 * rng.standard_normal(400)
    np.savetxt(tmp_path / "r.csv", np.column_stack([t, u, x]), delimiter=",", header="time,u,x", comments="")
    found = calibrate(tmp_path / "r.csv", fmu, tmp_path / "map.toml").calibration
    assert found.diagnosis.parameters["gain"].value == pytest.approx(2.06, abs=3e-3)
    assert any("returned Warning: near the limit" in text for text in found.notes)


@compiled
def test_a_scenario_may_set_values_of_any_type(tmp_path: Path) -> None:
    build_answers_fmu(tmp_path, parameters=True)
    (tmp_path / "s.toml").write_text(
        'stop = 1.0\nrecord = ["a.x"]\n[master]\nstep = 0.1\n[instances.a]\nfmu = "Answers.fmu"\n'
        "[instances.a.parameters]\non = true\nmode = 2\n"
    )
    assert read_system(tmp_path / "s.toml").given == {"a.on": True, "a.mode": 2}


def variables(*entries: tuple[str, str, str]) -> FmuSystem:
    found = {name: Variable(name, causality, unit=unit) for name, causality, unit in entries}
    return FmuSystem(Path("a.fmu"), {"": Path("a.fmu")}, ModelInterface("M", found))


@pytest.mark.parametrize(
    ("entries", "port"),
    [
        ((("U", "input", "V"), ("w", "output", "rad/s"), ("i", "output", "A")), 'input = "U"\nvelocity = "i"\n'),
        ((("i", "input", "A"), ("w", "output", "rad/s"), ("v", "output", "V")), 'input = "i"\nvelocity = "v"\n'),
        ((("p", "input", "Pa"), ("h", "output", "m"), ("q", "output", "m3/s")), 'input = "p"\nvelocity = "q"\n'),
        ((("M", "input", "N.m"), ("w", "output", "rad/s"), ("phi", "output", "rad")),
         'input = "M"\nposition = "phi"\nvelocity = "w"\n'),
        ((("F", "input", "N"), ("v", "output", "m/s")), 'input = "F"\nvelocity = "v"\n'),
        ((("i", "input", "A"), ("w", "output", "rad/s")), ""),
        ((("Q", "input", "W"), ("T", "output", "K")), ""),
        ((("a", "input", None), ("b", "output", None)), ""),
    ],
)  # fmt: skip
def test_a_draft_pairs_what_makes_a_power(entries: tuple, port: str) -> None:
    text = draft_map_text(variables(*entries), [])
    head, _, found = text.partition("[ports.port_1]\n")
    assert found == port
    assert ("no port is drafted" in head) == (not port)
