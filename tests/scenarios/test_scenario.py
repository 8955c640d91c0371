"""Scenario files: what runs, and what is refused with which message."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from orchestrator.building.build import ensure_built
from orchestrator.cli import main
from orchestrator.errors import ConnectionMismatchError, FmuError, InputError, ScenarioError, SimulationError
from orchestrator.fmi.slave2 import Fmu2Slave
from orchestrator.scenarios.scenario import load_scenario, simulate

GOOD = """
name = "open loop"
stop = 0.05
record = ["plant.theta_m", "plant.theta_l", "plant.u"]

[master]
step = 1e-3

[instances.plant]
fmu = "Drivetrain"

[instances.plant.parameters]
alpha = { value = 1.0, unit = "deg" }
backlash_model = "nordin"

[[sources]]
kind = "square"
to = "plant.u"
amplitude = 20.0
period = 0.02
"""
LATE = """
[[sources]]
kind = "step"
to = "plant.T_l"
time = 0.02
after = 1e300
"""


@pytest.fixture(scope="module", autouse=True)
def _built() -> None:
    ensure_built()


def write(folder: Path, text: str) -> Path:
    path = folder / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_scenario_runs_and_reports_units(tmp_path: Path) -> None:
    result = simulate(load_scenario(write(tmp_path, GOOD)))
    assert len(result.time) == 51
    assert result.time[-1] == pytest.approx(0.05, abs=1e-15)
    assert result.units == {"plant.theta_m": "rad", "plant.theta_l": "rad", "plant.u": "N.m"}
    assert np.ptp(result["plant.theta_m"]) > 1e-4
    # A plant holds its input: what it gets for a step is the source at the step's start.
    held = result["plant.u"]
    assert list(held[1:11]) == [20.0] * 10
    assert list(held[11:21]) == [-20.0] * 10


@pytest.mark.parametrize("compiled", ["true", "false"])
def test_a_torque_without_meaning_is_refused_with_its_name_and_time(tmp_path: Path, compiled: str) -> None:
    text = GOOD.replace("step = 1e-3\n", f"step = 1e-3\ncompiled = {compiled}\n") + LATE
    with pytest.raises(SimulationError, match=r"^plant: \w+ at t = 0.019 s returned Discard: `T_l` must be within"):
        simulate(load_scenario(write(tmp_path, text)))


def test_time_is_limited_for_fmus_of_ours_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = write(tmp_path, GOOD.replace("stop = 0.05", "stop = 1000.0")), tmp_path / "out"
    for words in (["--scenario", str(path)], []):  # without a scenario: the pair
        assert main(["simulate", *words, "--out", str(out), "--time-limit", "0.1"]) == 1
        assert "the run must take at most 0.1 s (`--time-limit`), but takes longer\n" in capsys.readouterr().err
        assert not out.exists()


def test_units_of_parameters_are_converted(tmp_path: Path) -> None:
    scenario = load_scenario(write(tmp_path, GOOD))
    value, text = scenario.system.start_value("plant.alpha", scenario.system.instances[0].start["alpha"])
    assert text is None
    assert value == pytest.approx(np.pi / 180.0, rel=1e-15)


def test_fmus_are_told_how_exactly_to_solve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: dict[str, float | None] = {}
    begin = Fmu2Slave.begin

    def noted(slave: Fmu2Slave, start: float, stop: float | None, tolerance: float | None) -> None:
        told[slave.name] = tolerance
        begin(slave, start, stop, tolerance)

    monkeypatch.setattr(Fmu2Slave, "begin", noted)
    line = 'fmu = "Drivetrain"\n'
    own = write(tmp_path, GOOD.replace(line, line + "solver_tolerance = 1e-8\n"))
    with load_scenario(own).session() as session:
        session.run()
    assert told == {"plant": 1e-8}
    with load_scenario(write(tmp_path, GOOD)).session() as session:
        session.run()
    assert told == {"plant": None}


@pytest.mark.parametrize(
    ("change", "error", "expected"),
    [
        (
            ('fmu = "Drivetrain"', 'fmu = "Drivetrain"\nsolver_tolerance = 1'),
            ScenarioError,
            "$.instances.plant.solver_tolerance: must be above 0 and below 1, but is 1",
        ),
        (("stop = 0.05", "stop = 0.05\nstep = 1"), ScenarioError, "unknown field `step`"),
        (("step = 1e-3", "step = 0"), ScenarioError, "$.stop: `step` must be finite and positive"),
        (("step = 1e-3", "step = 1e-3\nalgorithm = 'euler'"), ScenarioError, "$.master.algorithm: must be one of"),
        (("step = 1e-3", "step = 1e-3\ntolerance = 1"), ScenarioError, "$.master.tolerance: must be left out"),
        (("stop = 0.05", "stop = 0.0505"), ScenarioError, "whole number of steps"),
        (("stop = 0.05", "stop = nan"), ScenarioError, "$.stop"),
        (('fmu = "Drivetrain"', 'fmu = "missing.fmu"'), FmuError, "$.instances.plant.fmu"),
        (('fmu = "Drivetrain"', 'fmu = "scenario.toml"'), FmuError, "zip archive"),
        (('unit = "deg"', 'unit = "kg"'), ScenarioError, "$.instances.plant.parameters.alpha: must be given in a unit"),
        (("value = 1.0", "value = -1.0"), ScenarioError, "$.instances.plant.parameters.alpha: must"),
        (('"nordin"', '"nordn"'), ScenarioError, "did you mean 'nordin'?"),
        (('"plant.theta_m",', '"plant.theta_x",'), ScenarioError, "$.record[0]: must name a variable of plant"),
        (('to = "plant.u"', 'to = "plant.theta_l"'), ConnectionMismatchError, "$.sources[0].to: must be an input"),
        (('kind = "square"', 'kind = "sqare"'), ScenarioError, "$.sources[0].kind"),
        (("amplitude = 20.0", "amplitude = inf"), ScenarioError, "$.sources[0].amplitude: must be finite"),
        (("stop = 0.05", "stop = '"), ScenarioError, "must be TOML"),
        (('"plant.theta_m",', '"plant.\\nx",'), ScenarioError, "$.record[0]: must name a variable of plant"),
        (('fmu = "Drivetrain"', 'fmu = "a\\nb"'), FmuError, "a\\nb"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: tuple[str, str], error: type, expected: str) -> None:
    assert change[0] in GOOD
    path = write(tmp_path, GOOD.replace(*change, 1))
    with pytest.raises(InputError) as caught:
        simulate(load_scenario(path))
    assert type(caught.value) is error
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "scenario.toml" in str(caught.value)


def test_all_problems_are_reported_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("value = 1.0", "value = -1.0").replace('"plant.theta_m"', '"plant.nothing"')
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write(tmp_path, text))
    assert "$.instances.plant.parameters.alpha" in str(caught.value)
    assert "$.record[0]" in str(caught.value)


LOOP = """
stop = 0.01
record = ["plant.theta_l"]
[master]
step = 1e-3
[instances.plant]
fmu = "Drivetrain"
[instances.estimator]
fmu = "KalmanEstimator"
[[connections]]
from = "plant.theta_m"
to = "estimator.theta_m"
unit = "rad"
[[connections]]
from = "plant.theta_l"
to = "estimator.theta_l"
"""


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (('from = "plant.theta_m"', 'from = "plant.T_m"'), "$.connections[0].to: must have a unit"),
        (('from = "plant.theta_m"', 'from = "plant.u"'), "$.connections[0].from: must be an output"),
        (('unit = "rad"', 'unit = "deg"'), "$.connections[0].unit: must be the unit of plant.theta_m, rad"),
        (('to = "estimator.theta_l"', 'to = "estimator.theta_m"'), "$.connections[1].to: must be fed once"),
        (('to = "estimator.theta_l"', 'to = "estmator.theta_l"'), "$.connections[1].to: must start with an instance"),
    ],
)
def test_connections_that_cannot_be_made(tmp_path: Path, change: tuple[str, str], expected: str) -> None:
    assert change[0] in LOOP
    with pytest.raises(ConnectionMismatchError) as caught:
        load_scenario(write(tmp_path, LOOP.replace(*change, 1)))
    assert expected in str(caught.value)


def test_what_does_not_convert_hides_nothing_else(tmp_path: Path) -> None:
    text = (
        'stop = "a"\nrecrd = []\nrecord = ["plant.zz", "gone.y"]\n[master]\nstep = 1e-3\nfoo = 1\n'
        '[instances.plant]\nfmu = "Drivetrain"\nparameters = { alfa = 0.02 }\n[instances.gone]\nfmu = "none.fmu"\n'
        '[[connections]]\nfrom = "plant.theta_m"\ntoo = "plant.u"\n'
        '[[sources]]\nto = "plant.uu"\nkind = "constant"\nvalue = 1.0\n'
        '[[sources]]\nto = "gone.u"\nkind = "constant"\nvalue = 1.0\n'
    )
    with pytest.raises(ScenarioError) as error:
        load_scenario(write(tmp_path, text))
    said = str(error.value).removeprefix(f"{tmp_path / 'scenario.toml'}: ").split("; $")
    assert [part.lstrip("$").partition(": ")[0] for part in said] == [
        "", ".stop", ".master", ".connections[0]", ".connections[0]",
        ".instances.plant.parameters.alfa", ".sources[0].to", ".record[0]", ".instances.gone.fmu",
    ]  # fmt: skip


def test_table_and_noise_sources(tmp_path: Path) -> None:
    (tmp_path / "torque.csv").write_text("time,u\n0,0\n0.01,5\n0.02,5\n", encoding="utf-8")
    table = 'kind = "table"\nto = "plant.u"\nfile = "torque.csv"\ncolumn = "u"\n'
    noise = '[[sources]]\nkind = "noise"\nto = "plant.T_l"\ndeviation = 1.0\nseed = 3\n'
    text = (
        GOOD.split("[[sources]]", maxsplit=1)[0].replace('"plant.u"', '"plant.u", "plant.T_l"')
        + "[[sources]]\n"
        + table
        + noise
    )
    first, second = (simulate(load_scenario(write(tmp_path, text))) for _ in range(2))
    np.testing.assert_allclose(first["plant.u"][1:12], np.arange(11) * 0.5, atol=1e-12)
    assert first["plant.T_l"].std() == pytest.approx(1.0, abs=0.3)
    np.testing.assert_array_equal(first.values, second.values)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("time,u\n1,0\n0,5\n", "must not go back"),
        ("time,v\n0,0\n", "no such column: 'u' of `time,v`"),
        ("time,u\n0,0\n1,x\n2,0\n3,0\n", "row 2, column `u` must be a number, but is `x`"),
        ("time,u\n0,0\n1,\n2,0\n", "must hold finite numbers"),
        ("", "must have a header and rows"),
    ],
)
def test_bad_tables(tmp_path: Path, content: str, expected: str) -> None:
    (tmp_path / "torque.csv").write_text(content, encoding="utf-8")
    table = 'kind = "table"\nto = "plant.u"\nfile = "torque.csv"\ncolumn = "u"\n'
    with pytest.raises(ScenarioError, match=expected):
        load_scenario(write(tmp_path, GOOD.split("[[sources]]", maxsplit=1)[0] + "[[sources]]\n" + table))


def test_a_name_that_is_too_long_for_the_file_system(tmp_path: Path) -> None:
    (tmp_path / "long.toml").write_text(GOOD.replace('"Drivetrain"', f'"{400 * "9"}"'))
    with pytest.raises(FmuError, match="must be a file or one of"):
        load_scenario(tmp_path / "long.toml")


def test_an_fmu_that_is_corrupt_inside_is_named_with_its_scenario(tmp_path: Path, fmus) -> None:
    """The model description can be read, so that it only comes out when the rest is unpacked."""
    content = bytearray(fmus["Drivetrain"].read_bytes())
    with zipfile.ZipFile(fmus["Drivetrain"]) as archive:
        member = next(m for m in archive.infolist() if m.filename.startswith("binaries/linux64"))
    content[member.header_offset + 200 : member.header_offset + 250] = bytes(50)
    (tmp_path / "bad.fmu").write_bytes(content)
    file = tmp_path / "bad.toml"
    file.write_text(
        'stop = 0.1\nrecord = ["p.theta_l"]\n[master]\nalgorithm = "jacobi"\nstep = 1e-2\n'
        '[instances.p]\nfmu = "bad.fmu"\n'
    )
    with pytest.raises(FmuError, match=r"bad.toml: \$.instances.p: `fmu` must be an intact zip archive"):
        simulate(load_scenario(file))
