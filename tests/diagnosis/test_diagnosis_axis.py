"""``ServoAxis``: its equations against closed forms, its FMU against its equations, its diagnosis."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.building.build import ensure_built
from orchestrator.checking.check import check_fmu
from orchestrator.cli import main
from orchestrator.diagnosis.diagnose import diagnose, evidence_of
from orchestrator.diagnosis.figures import _abscissa
from orchestrator.diagnosis.verdict.evidence import evidence
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.records.model_file import read_model
from pyfmu_sources import servo_axis as axis
from pyfmu_sources import servo_axis_parameters as ap
from tests.support import axis_record, emps
from tests.support.short_records import AXIS

MODEL = Path(__file__).resolve().parents[2] / "docs" / "examples" / "emps.toml"


def parameters(**values: float) -> tuple[float, ...]:
    p = list(ap.DEFAULTS)
    for name, value in values.items():
        p[getattr(ap, name)] = value
    return tuple(p)


def test_viscous_axis_follows_its_closed_form() -> None:
    p = parameters(P_J=2.0, P_B=3.0)
    x, _ = axis.advance((0.0, 0.0, 0.0, 0.0, 0.0), 1, p, 6.0, 0.0, 0.8)
    assert x[1] == pytest.approx(2.0 * (1.0 - np.exp(-1.2)), rel=1e-7)
    assert x[0] == pytest.approx(2.0 * 0.8 - 4.0 / 3.0 * (1.0 - np.exp(-1.2)), rel=1e-7)


def test_dry_friction_stops_the_axis_where_energy_says_and_holds_it() -> None:
    p = parameters(P_J=2.0, P_B=0.0, P_COULOMB=5.0)
    x, mode = axis.advance((0.0, 3.0, 0.0, 0.0, 0.0), 1, p, 0.0, 0.0, 4.0)
    assert mode == 0
    assert x[1] == 0.0
    assert x[0] == pytest.approx(0.5 * 2.0 * 9.0 / 5.0, rel=1e-9)
    held, mode = axis.advance(x, mode, p, 4.99, 0.0, 1.0)
    assert (held[0], mode) == (x[0], 0)
    slid, mode = axis.advance(x, mode, p, 5.01, 0.0, 1.0)
    assert mode == 1
    assert slid[1] == pytest.approx(0.01 / 2.0, rel=1e-6)


def test_an_axis_at_rest_is_held_up_to_its_breakaway_torque() -> None:
    p = parameters(P_J=2.0, P_B=0.0, P_COULOMB=1.0, P_STRIBECK=3.0, P_BREAKAWAY=5.0, P_STRIBECK_SPEED=0.01)
    for way in (1, -1):
        held, mode = axis.advance((0.5, 0.0, 0.0, 0.0, 0.0), 0, p, 5.99 * way, 0.0, 1.0)
        assert (held[0], held[1], mode) == (0.5, 0.0, 0)
        slid, mode = axis.advance((0.5, 0.0, 0.0, 0.0, 0.0), 0, p, 6.01 * way, 0.0, 2.0)
        assert mode == way
        assert slid[1] * way > 1.0  # driven by 6.01 against 4 of sliding friction, once the curve has fallen


def test_viscous_friction_that_differs_by_direction_follows_its_closed_form() -> None:
    p = parameters(P_J=2.0, P_B=3.0, P_DIRECTION=-1.0)
    for way, damping in ((1, 2.0), (-1, 4.0)):
        x, _ = axis.advance((0.0, 0.0, 0.0, 0.0, 0.0), way, p, 6.0 * way, 0.0, 0.8)
        assert x[1] == pytest.approx(way * 6.0 / damping * (1.0 - np.exp(-0.4 * damping)), rel=1e-7)


def test_fmu_passes_check_and_repeats_the_equations() -> None:
    path = ensure_built(["ServoAxis"])["ServoAxis"]
    report = check_fmu(path)
    assert report.ok, report.findings
    u = 4.0 * np.sin(np.arange(100))
    start = {"J": 1.5, "b": 0.7, "effects.coulomb_friction.motor.torque": 1.0}
    system = System((fmu_instance("axis", path, start),), (), (SignalSource("axis.u", Samples(u, 0.01)),))
    with Session(system, ("axis.theta_m",), GaussSeidel(0.01), 0.99) as session:
        simulated = session.run()["axis.theta_m"]
    p = parameters(P_J=1.5, P_B=0.7, P_COULOMB=1.0)
    x = axis.start(0.0, 0.0, 0.0, p)
    mode, expected = axis.initial_mode(x, p, float(u[0])), []
    for value in u:
        expected.append(x[0])
        x, mode = axis.advance(x, mode, p, float(value), 0.0, 0.01)
    np.testing.assert_allclose(simulated, expected, rtol=0.0, atol=1e-13)
    assert np.ptp(expected) > 1e-3


def test_ripple_that_no_effect_explains_is_seen_with_its_period(tmp_path) -> None:
    p = parameters(P_J=1.04, P_B=1.95, P_RIPPLE=0.15, P_RIPPLE_N=9.0, P_RIPPLE_PHASE=0.4)
    (tmp_path / "axis.toml").write_text(axis_record.MODEL)
    found = diagnose(axis_record.axis_record(p, 4, "ripple"), read_model(tmp_path / "axis.toml"))
    assert [effect.name for effect in found.effects] == ["torque_ripple"]
    w = found.workings
    without = evidence(w.likelihood, w.base, w.parts).terms[0]
    assert without.sure
    assert without.period == pytest.approx(2.0 * np.pi / 9.0, rel=0.05)
    assert without.size == pytest.approx(0.15, rel=0.2)
    assert not any(term.sure for term in evidence_of(found).terms)


@pytest.fixture(scope="module")
def emps_results(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What the command says of EMPS, from mass and viscous friction alone."""
    if not emps.available():
        pytest.skip("the EMPS records are not here")
    folder = tmp_path_factory.mktemp("emps")
    for which in emps.RECORDS:
        emps.write_csv(folder / f"{which}.csv", which)
    records = [str(folder / "estimation.csv"), "--validate", str(folder / "test.csv")]
    assert main(["diagnose", *records, "--model", str(MODEL), "--out", str(folder / "out")]) == 0
    return json.loads((folder / "out" / "diagnose.json").read_text())["results"]


def emps_effects(results: dict) -> dict[str, dict]:
    return {effect["name"]: effect["parameters"] for effect in results["effects"]}


@pytest.mark.slow(shares="emps_results")
def test_emps_lacks_dry_friction_first(emps_results: dict) -> None:
    assert emps_results["verdict"] == "effects"
    assert emps_results["effects"][0]["name"] == "coulomb_friction"
    found = emps_effects(emps_results)
    assert set(found) == {"coulomb_friction", "directional_friction", "torque_ripple"}
    assert found["coulomb_friction"]["torque"]["unit"] == "N"
    cycles = found["torque_ripple"]["cycles_per_rev"]
    assert (cycles["unit"], found["torque_ripple"]["phase"]["unit"]) == ("rad/m", "rad")
    assert 2.0 * np.pi / cycles["value"] == pytest.approx(2.5e-3, rel=0.01)
    fit = emps_results["validation"]["theta_m"]["r_squared"]
    assert fit["parameters"] < 0.6
    assert fit["after"] >= 0.997
    # Its ripple has the same size in both records, by a regression of the inverse model's force, 0.66 mm apart.
    assert emps_results["validation"]["theta_m"]["moved_zero"] == pytest.approx(0.66e-3, abs=0.1e-3)


@pytest.mark.slow(shares="emps_results")
@pytest.mark.parametrize("unit", ["rad", "m"])
def test_figures_give_positions_in_the_unit_of_the_axis_and_phases_in_radians(unit: str) -> None:
    x, p = np.zeros((3, 8)), np.array(AXIS.extended([entry.default for entry in AXIS.table]))
    workings, misfit = SimpleNamespace(plant=AXIS), [SimpleNamespace(unit=unit)]
    found = {
        effect.name: _abscissa(effect, p, SimpleNamespace(workings=workings, misfit=misfit), x, np.zeros(3))[1]
        for effect in AXIS.bank
    }
    assert found["coulomb_friction"] == f"motor speed [{unit}/s]"
    assert found["torque_ripple"] == "phase of the cycle [rad]"
    assert found["lower_end_stop"] == f"load position [{unit}]"


def test_figures_of_emps_are_those_of_an_independent_inverse_and_free_run(emps_results: dict) -> None:
    found = emps_effects(emps_results)
    values = {name: entry["value"] for name, entry in emps_results["parameters"].items()}
    p = np.array(parameters(P_J=values["J"], P_B=values["b"]))
    p[ap.P_COULOMB] = found["coulomb_friction"]["torque"]["value"]
    p[ap.P_DIRECTION] = found["directional_friction"]["difference"]["value"]
    for place, short in (
        (ap.P_RIPPLE, "amplitude"),
        (ap.P_RIPPLE_N, "cycles_per_rev"),
        (ap.P_RIPPLE_PHASE, "phase"),
    ):
        p[place] = found["torque_ripple"][short]["value"]
    # The second record is filtered to the analysis rate first, which this independent inverse does not do.
    expected = emps.force_error(p, "estimation")
    assert emps_results["torque_error"]["record"]["after"] == pytest.approx(expected, rel=1e-4)
    p[ap.P_RIPPLE_PHASE] -= p[ap.P_RIPPLE_N] * emps_results["validation"]["theta_m"]["moved_zero"]
    assert emps_results["validation"]["theta_m"]["r_squared"]["after"] == pytest.approx(
        emps.open_loop(p, "test"), abs=1e-3
    )


@pytest.mark.slow(shares="emps_results")
def test_emps_friction_is_the_published_one(emps_results: dict) -> None:
    friction = emps_effects(emps_results)["coulomb_friction"]["torque"]["value"]
    assert friction == pytest.approx(20.39, rel=0.03)
    assert emps_results["torque_error"]["record"]["after"] <= 0.041
    assert emps_results["torque_error"]["validation"]["after"] <= 0.060
