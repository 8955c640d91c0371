"""A controller for the machine of a record: what is drawn, refused, and taken away."""

import ctypes
import json
import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import fmpy
import numpy as np
import pytest

import orchestrator as oc
from orchestrator.api.compensate import _judge
from orchestrator.cli import main
from orchestrator.control.loops import FMUS, make_task
from orchestrator.control.machine import machine_of, thesis_machine
from orchestrator.control.measures import measure_loop
from orchestrator.control.standstill import forecast_rest
from orchestrator.control.take_away import c_files, file_names, write_loop
from orchestrator.control.weights import choose_weights
from orchestrator.errors import ScenarioError
from orchestrator.records.fitted_record import FittedRecord
from orchestrator.records.model_file import read_model
from orchestrator.records.model_text import model_text
from orchestrator.scenarios.scenario import load_scenario, simulate
from tests.support.c_fmu import have_compiler

NAMES = ("J_m", "J_l", "alpha")
FRICTION = "effects.coulomb_friction.load.torque"
VALUES = {"J_m": 0.41, "J_l": 5.5, "tau": 5e-3, "alpha": 0.0137, FRICTION: 2.0}
DEVIATIONS = np.array([4e-3, 0.05, 2e-5])
CORRELATION = np.array([[1.0, -0.9, 0.0], [-0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
RECORD = FittedRecord(
    source="press.csv", verdict="effects", trust="green", torque=250.0, noise=(3.5e-4, 1.75e-4),
    counts=(2.0 * np.pi / 10_000, 2.0 * np.pi / 20_000), unknowns=NAMES,
    values=tuple(VALUES[name] for name in NAMES),
    covariance=tuple(map(tuple, (CORRELATION * np.outer(DEVIATIONS, DEVIATIONS)).tolist())),
)  # fmt: skip


def write_model(folder, record=RECORD, **values):
    path = folder / "corrected.toml"
    path.write_text(model_text(read_model(None), {k: (v, 0.0) for k, v in (VALUES | values).items()}, record))
    return path


@pytest.fixture
def machine(tmp_path):
    return machine_of(read_model(write_model(tmp_path)))


def test_plants_are_drawn_from_the_joint_covariance(machine):
    rng = np.random.default_rng(3)
    draws = [machine.draw(rng) for _ in range(4000)]
    drawn = np.array([[one[name] for name in NAMES] for one in draws])
    assert drawn.mean(axis=0) == pytest.approx(RECORD.values, abs=4.0 * np.max(DEVIATIONS / 60.0))
    assert drawn.std(axis=0) == pytest.approx(DEVIATIONS, rel=0.05)
    assert np.corrcoef(drawn.T) == pytest.approx(CORRELATION, abs=0.05)
    plant = machine.plant(machine.draw(rng))
    assert plant[FRICTION] == 2.0
    assert plant["theta_m_start"] == -plant["alpha"] * plant["i"]


def test_what_no_covariance_covers_is_drawn_from_its_interval():
    machine = thesis_machine(read_model(None), 0.02, 5e-3, 2.0)
    rng = np.random.default_rng(1)
    drawn = np.array([machine.draw(rng)["J_l"] for _ in range(500)])
    assert 0.94 * 5.6 < drawn.min() < 0.96 * 5.6 < 1.04 * 5.6 < drawn.max() < 1.06 * 5.6


@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("tau", [5e-3, 1.0])
def test_the_chosen_weights_rest_and_have_margins(machine, tau, scale):
    # The same machine in other units of torque: every inertia, stiffness, friction and limit is smaller.
    units = {name: scale if name in ("J_m", "J_l", "k", "c", "b_m", "b_l") else 1.0 for name in machine.parameters}
    parameters = {name: replace(p, value=p.value * units[name]) for name, p in machine.parameters.items()}
    parameters["tau"] = replace(parameters["tau"], value=tau)
    scaled = replace(machine, parameters=parameters, torque_limit=scale * 250.0)
    task = replace(make_task(scaled, 1e-3), state_weights=choose_weights(scaled, 1e-3), torque_weight=1.0)
    forecast = forecast_rest(scaled.nominal, task.gains, 1e-3)
    assert not forecast.cycles
    assert forecast.phase_margin > 0.6
    assert forecast.delay_margin > 2e-3


def test_a_model_without_a_gap_a_record_or_an_encoder_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"must have a gap to be crossed.*regulator"):
        oc.compensate(model=write_model(tmp_path, replace_record(unknowns=(), values=(), covariance=()), alpha=0.0))
    with pytest.raises(ScenarioError, match="both encoders"):
        oc.compensate(model=write_model(tmp_path, replace_record(noise=(1e-4,), counts=(1e-4,))))
    with pytest.raises(ScenarioError, match=r"table \[record\]"):
        oc.compensate(model=write_model(tmp_path, None))
    (tmp_path / "empty").mkdir()
    with pytest.raises(ScenarioError, match=r"corrected.toml beside it"):
        oc.compensate(model=tmp_path / "empty" / "estimate.json")


def replace_record(**changes):
    import msgspec

    return msgspec.structs.replace(RECORD, **changes)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"trust": "red", "reasons": ("free runs miss theta_m",)}, "free runs miss theta_m"),
        ({"verdict": "unknown", "trust": "amber"}, "must be neither red nor unknown"),
    ],
)
def test_a_model_that_cannot_be_trusted_is_refused_with_the_reason(tmp_path, capsys, changes, told):
    path = write_model(tmp_path, replace_record(**changes))
    assert main(["compensate", "--model", str(path), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert "--force" in error
    assert "`estimate` with `design` proposes one" in error
    assert not (tmp_path / "out").exists()


def test_a_half_gap_that_the_record_excludes_is_refused(tmp_path, capsys):
    by_hand = write_model(tmp_path, alpha=1.3 * VALUES["alpha"])
    assert main(["compensate", "--model", str(by_hand), "--out", str(tmp_path / "out")]) == 2
    assert "`alpha` must agree with the record, 0.0137 with a standard error of 2e-05" in capsys.readouterr().err
    words = ["compensate", "--model", str(write_model(tmp_path)), "--alpha", "0.0178", "--out", str(tmp_path / "out")]
    assert main(words) == 2
    assert "must agree with the record" in capsys.readouterr().err


def test_a_given_half_gap_is_no_better_known_than_the_record_knows_it(tmp_path):
    doubtful = replace_record(covariance=tuple(map(tuple, np.diag([1e-5, 1e-3, 0.002**2]).tolist())))
    machine = machine_of(read_model(write_model(tmp_path, doubtful)), alpha=0.0178)
    assert (machine.alpha, machine.deviation) == (0.0178, pytest.approx(0.002))
    drawn = [machine.draw(np.random.default_rng(n))["alpha"] for n in range(400)]
    assert np.std(drawn) == pytest.approx(0.002, rel=0.15)
    assert np.median(drawn) == pytest.approx(0.0178, rel=0.03)


@pytest.mark.parametrize("fmu", ["ServoAxis", "TwoStageTrain"])
def test_plants_without_one_gap_between_motor_and_load_are_refused_by_name(tmp_path, capsys, fmu):
    path = tmp_path / "axis.toml"
    path.write_text(f'fmu = "{fmu}"\n', encoding="utf-8")
    assert main(["compensate", "--model", str(path), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert f"`fmu` must be Drivetrain, one gap between motor and load, but is {fmu}" in told


@pytest.mark.skipif(not have_compiler(), reason="Python FMUs take half a minute")
def test_unstable_plants_are_refused_with_what_makes_them_so_and_no_file_is_written(tmp_path, capsys):
    doubtful = replace_record(covariance=tuple(map(tuple, np.diag([1e-5, 12.0**2, 1e-10]).tolist())))
    words = ["compensate", "--model", str(write_model(tmp_path, doubtful)), "--plants", "12"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert "must be stable on every plant that the record allows, but is unstable on 2 of 12 plants" in told
    assert "these differ in `J_l`" in told
    assert "`estimate` with `design` proposes one" in told
    assert not (tmp_path / "out").exists()
    found = oc.compensate(model=write_model(tmp_path, doubtful), plants=12, force=True)
    assert found.laws[-1].unstable == 2
    assert "Do not run this controller" in found.doubts[0]


@pytest.mark.parametrize(("hard", "cure"), [(3, "a better record does not help"), (2, "Log a record")])
def test_a_better_record_is_no_cure_where_every_plant_lands_hard(hard: int, cure: str) -> None:
    task = SimpleNamespace(impact_speed=0.1, machine=SimpleNamespace(draw=lambda rng: {"J_l": rng.uniform(1.0, 2.0)}))
    impacts = [np.array([1.0 if n < hard else 0.1]) for n in range(3)]
    _, (told,) = _judge(task, [SimpleNamespace(stable=True, impacts=each) for each in impacts], 0)
    assert cure in told


@pytest.mark.skipif(not have_compiler(), reason="Python FMUs take half a minute")
def test_hard_landings_on_plants_that_the_record_allows_are_told(tmp_path):
    doubtful = replace_record(covariance=tuple(map(tuple, np.diag([0.15**2, 1e-3, 1e-10]).tolist())))
    found = oc.compensate(model=write_model(tmp_path, doubtful), plants=12)
    assert found.laws[-1].unstable == 0
    (told,) = found.doubts
    assert re.match(
        r"The impact speed is exceeded by a factor of more than 1.5 on \d+ of 12 plants: .*Log a record", told
    )
    assert oc.compensate(model=write_model(tmp_path), plants=3).doubts == ()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"covariance": ((1.0,),)}, "must have 3 rows"),
        ({"values": (1.0,)}, "must have 3 numbers"),
        ({"unknowns": ("J_m", "J_m", "x")}, "must name parameters"),
        ({"covariance": ((1.0, 2.0, 0.0), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0))}, "no negative eigenvalue"),
        ({"torque": -1.0}, "as `diagnose` writes it"),
    ],
)
def test_a_damaged_record_table_is_one_line(tmp_path, capsys, changes, told):
    path = write_model(tmp_path, replace_record(**changes))
    assert main(["compensate", "--model", str(path), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip()
    assert told in error
    assert "\n" not in error


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """Files of a machine's controller, native."""
    if not have_compiler():
        pytest.skip("native FMUs need a compiler")
    folder = tmp_path_factory.mktemp("machine")
    words = ["compensate", "--model", str(write_model(folder)), "--plants", "3", "--native"]
    assert main([*words, "--out", str(folder / "out")]) == 0
    return folder / "out"


def test_the_result_says_what_the_loop_will_do(taken):
    found = json.loads((taken / "compensate.json").read_text(encoding="utf-8"))["results"]
    plain, _, ours = found["laws"]
    assert found["machine"] == "press"
    assert not found["forecast"]["cycles"]
    assert ours["unstable"] == 0
    assert ours["error"] < 0.5 * plain["error"]
    assert np.median(ours["times"]) < 1.3 * found["bound"]
    assert ours["upper"]["landing"] < 1.5 * found["impact_speed"]
    assert set(found["files"]) <= {path.name for path in taken.iterdir()}


def test_fmus_scenario_and_ssp_have_the_machines_values(taken):
    description = fmpy.read_model_description(str(taken / "BacklashCompensator_press.fmu"))
    starts = {v.name: v.start for v in description.modelVariables}
    assert (float(starts["J_l"]), float(starts["u_max"])) == (5.5, 250.0)
    scenario = load_scenario(taken / "loop.toml")
    record = ("plant.theta_l", "plant.theta_m", "plant.contact", "plant.omega_m", "plant.omega_l", "controller.u")
    machine = machine_of(read_model(write_model(taken.parent)))
    task = make_task(machine, 1e-3)
    measured = measure_loop(simulate(replace(scenario, record=record)), task)
    assert measured.stable
    assert np.median(measured.impacts) < 1.5 * task.impact_speed
    assert set(file_names("press")) <= {path.name for path in taken.iterdir()}


@pytest.mark.parametrize("fmi", [2, pytest.param(3, marks=pytest.mark.night)])
def test_the_ssp_file_is_a_step_of_the_loop_for_both_versions_of_fmi(taken, tmp_path, fmi):
    folder, machine = taken, machine_of(read_model(write_model(tmp_path)))
    task = replace(make_task(machine, 1e-3), state_weights=choose_weights(machine, 1e-3), torque_weight=1.0)
    if fmi == 3:
        folder = tmp_path
        write_loop(folder, "press", task, native=True, fmi=3)
        description = fmpy.read_model_description(str(folder / "BacklashCompensator_press.fmu"))
        assert description.fmiVersion == "3.0"
        assert simulate(load_scenario(folder / "loop.toml"))["plant.theta_l"][-1] == pytest.approx(
            task.height, rel=0.02
        )
    words = ["ssp", "run", str(folder / "loop.ssp"), "--jacobi", "--out", str(tmp_path / "run")]
    assert main(words) == 0
    rows = np.genfromtxt(tmp_path / "run" / "ssp.csv", delimiter=",", names=True, deletechars="")
    assert rows["plant.theta_l"][-1] == pytest.approx(task.height, rel=0.02)
    assert np.ptp(rows["plant.theta_l"][-1000:]) < 2e-3 * task.height
    met = np.flatnonzero((np.diff(rows["plant.contact"]) != 0) & (rows["plant.contact"][1:] != 0))
    speed = np.abs(rows["plant.omega_m"] / machine.nominal.i - rows["plant.omega_l"])
    assert met.size
    assert np.median(speed[met]) < 1.5 * task.impact_speed


def test_plain_c_has_the_bits_of_the_native_fmus_and_no_heap(taken, tmp_path):
    task = make_task(machine_of(read_model(write_model(tmp_path))), 1e-3)
    task = replace(task, state_weights=choose_weights(task.machine, 1e-3), torque_weight=1.0)
    files = c_files("press", task)
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert not {"malloc(", "calloc(", "free(", "printf("} & set(text.replace("(", "( ").split())
    library = tmp_path / "controller.so"
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    source = str(tmp_path / "controller_press.c")
    subprocess.run(["cc", *strict, "-O3", "-shared", "-fPIC", source, "-o", str(library), "-lm"], check=True)
    rows = round(6.0 / task.sample_time) + 1
    seen = recorded_loop(taken, task, rows)
    assert rows == 6001
    assert np.count_nonzero(np.diff(seen["plant.contact"])) > 4
    run = ctypes.CDLL(str(library))
    inputs, outputs = (ctypes.c_double * 4)(), (ctypes.c_double * 7)()
    u = []
    names = ("plant.theta_m", "plant.theta_l", "controller.reference", "controller.reference_speed")
    for n in range(rows):
        inputs[:] = [float(seen[name][n]) for name in names]
        step = run.controller_press_step if n else run.controller_press_start
        assert step(inputs, outputs) == 0
        u.append(outputs[0])
    assert np.array_equal(u, seen["controller.u"])


def recorded_loop(folder, task, rows):
    """The loop of native FMUs with the machine's start values, its measured angles as they are."""
    from orchestrator.control.loops import PARTS, connections
    from orchestrator.fmi.instances import fmu_instance
    from orchestrator.master.algorithms import GaussSeidel
    from orchestrator.master.signals import Samples
    from orchestrator.master.system import SignalSource, System
    from orchestrator.scenarios.definition import Scenario

    paths = [folder / f"{kind}_press.fmu" for kind in FMUS]
    instances = tuple(fmu_instance(part, path) for part, path in zip(PARTS, paths, strict=True))
    t = np.arange(rows) * task.sample_time
    turn = 2.0 * np.pi * 0.7
    angle, speed = 0.2 * (1.0 - np.cos(turn * t)), 0.2 * turn * np.sin(turn * t)
    sources = tuple(
        SignalSource(f"controller.{name}", Samples(signal, task.sample_time))
        for name, signal in (("reference", angle), ("reference_speed", speed))
    )
    wires = tuple(replace(one, quantum=0.0) for one in connections(task.machine, True))
    record = ("plant.theta_m", "plant.theta_l", "plant.contact", "controller.reference", "controller.reference_speed")
    system = System(instances, wires, sources)
    stop = (rows - 1) * task.sample_time
    return simulate(Scenario(system, (*record, "controller.u"), GaussSeidel(task.sample_time), stop, name="loop"))


def test_plain_c_compiles_for_a_cortex_m4(tmp_path):
    pytest.importorskip("ziglang")
    task = make_task(machine_of(read_model(write_model(tmp_path))), 1e-3)
    for name, text in c_files("press", task).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    words = [sys.executable, "-m", "ziglang", "cc", "-target", "thumb-linux-musleabihf", "-mcpu=cortex_m4"]
    done = subprocess.run(
        [*words, "-std=c99", "-Wall", "-Wextra", "-Werror", "-c", "controller_press.c", "-o", "controller.o"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
