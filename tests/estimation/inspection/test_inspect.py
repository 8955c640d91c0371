"""``inspect``, and the way of a drive's log from nothing but the file to the half-gap."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.cli import main
from orchestrator.estimation.inspection.channels import channels_of, delay_between, reversals_of
from orchestrator.estimation.inspection.sufficiency import Sufficiency
from orchestrator.estimation.inspection.verdict import verdict_of
from orchestrator.records.model_file import read_model
from orchestrator.records.record import record_from_columns
from pyfmu_sources.axis.axis_equations import DEFAULTS
from tests.support.axis_record import MODEL, axis_record
from tests.support.drive_record import COUNTS, HALF_GAP, RATED, write_log
from tests.support.independent_plant import make_record, write_csv


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


def test_channels_say_what_they_are_rounded_to_and_where_they_end(columns) -> None:
    clipped = dict(columns) | {"u": np.clip(columns["u"], -50.0, 50.0)}
    torque, motor, _ = channels_of(record_from_columns(clipped, "clipped"))
    assert (torque.least, torque.most) == (-50.0, 50.0)
    assert torque.saturated > 0.1
    assert motor.count == pytest.approx(2.0 * np.pi / 10_000, rel=1e-3)
    assert motor.saturated < 0.01


def test_a_late_load_encoder_is_measured() -> None:
    columns = make_record({"alpha": 0.01}, seed=3, duration=20.0)[0]
    late = dict(columns) | {"theta_l": np.concatenate([columns["theta_l"][:1].repeat(6), columns["theta_l"][:-6]])}
    plain, delayed = (delay_between(record_from_columns(table, "r")) for table in (columns, late))
    assert plain is not None
    assert delayed is not None
    assert delayed[0] - plain[0] == pytest.approx(0.03, abs=0.003)


def test_a_record_of_one_flank_shows_no_gap(columns, tmp_path: Path) -> None:
    still = dict(columns) | {"u": 1e-6 * columns["u"]}
    weak = oc.inspect(record_from_columns(still, "weak"), oc.read_model())
    strong = oc.inspect(record_from_columns(columns, "strong"))
    assert strong.smallest_gap <= 0.001
    assert weak.smallest_gap > 0.01


def test_from_a_drives_log_to_its_half_gap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One look, the numbers of the columns, another look, the values of the data sheet, one estimate."""
    log, first, second = tmp_path / "drive.csv", tmp_path / "seen", tmp_path / "gap"
    write_log(log)
    assert main(["inspect", str(log), "--out", str(first)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "100 N.m at 100 % of u" in told
    text = (first / "model.toml").read_text()
    assert text.count("ASSUMED: put in the drive's") == 4
    assert float(re.search(r"# \[parameters.i\]\n# value = (\S+)", text)[1]) == pytest.approx(
        20.0 * COUNTS[0] / COUNTS[1], rel=1e-3
    )
    model = tmp_path / "model.toml"
    model.write_text(_edited(text))
    assert not read_model(model).stated
    assert main(["inspect", str(log), "--model", str(model), "--out", str(first)]) == 0
    text = (first / "model.toml").read_text()
    assert "ASSUMED: put in the drive's" not in text
    assert float(re.search(r"\n\[parameters.i\]\nvalue = (\S+)", text)[1]) == pytest.approx(20.0, rel=1e-3)
    model.write_text(_edited(text))
    assert len(read_model(model).stated) == 8
    assert main(["estimate", str(log), "--model", str(model), "--no-diagnose", "--out", str(second)]) == 0
    result = json.loads((second / "estimate.json").read_text())["results"]
    assert result["alpha"] == pytest.approx(HALF_GAP, rel=5e-3)
    assert result["interval"][0] < HALF_GAP < result["interval"][1]


def _edited(text: str) -> str:
    """Put what the data sheet says in place of what was assumed."""
    sheet = {"J_m": 0.0041, "J_l": 1.85, "k": 8800.0, "c": 4.0, "b_m": 0.006, "b_l": 2.0, "i": 20.0, "tau": 0.004}
    spread = {"c": 0.3, "b_m": 0.3, "b_l": 0.3, "tau": 0.1, "i": 0.0}
    text = re.sub(r"rated_value = \S+", f"rated_value = {RATED}", text)
    text = re.sub(r"rate = 1000\b", "rate = 500", text)
    for name, counts in zip(("theta_m", "theta_l"), COUNTS, strict=True):
        text = re.sub(rf"(?s)(\[columns\.{name}\].*?counts_per_rev = )\S+", rf"\g<1>{counts}", text, count=1)
    for name, value in sheet.items():
        share = spread.get(name, 0.05)
        text = re.sub(
            rf"(\[parameters\.{name}\]\nvalue = )\S+(.*\nrelative_uncertainty = )\S+",
            rf"\g<1>{value}\g<2>{share}",
            text,
        )
    return text


def test_the_page_and_the_picture_are_written(columns, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "data.csv", tmp_path / "out"
    write_csv(path, columns)
    assert main(["inspect", str(path), "--pictures", "--out", str(out)]) == 0
    assert "Model file to start from" in capsys.readouterr().out
    assert (out / "inspect.png").stat().st_size > 10_000
    assert "Inspection of a record" in (out / "report.html").read_text()
    seen = json.loads((out / "inspect.json").read_text())["results"]
    assert seen["smallest_gap"] <= 0.001
    starter = read_model(out / "model.toml")
    assert starter.parameters["J_l"].value == pytest.approx(5.6)


HELD_TORQUE = 160.0  # N.m, on the load from outside
MOTOR_SHARE = HELD_TORQUE / 3.984


def _held_record(seed: int, swing: float, alpha: float = 0.01):  # type: ignore[no-untyped-def]
    """Return 6 s in which the motor carries a torque on the load and swings it to and fro."""
    time = 0.005 * np.arange(1200)
    u = MOTOR_SHARE + swing * np.sin(7.0 * time) + 0.3 * swing * np.sin(17.0 * time)
    start = {"theta_m": (alpha + HELD_TORQUE / 3300.0) * 3.984, "T_m": MOTOR_SHARE}
    columns, _ = make_record({"alpha": alpha, "T0": HELD_TORQUE}, seed, u=u, x0=start)
    return record_from_columns(columns, "held")


@pytest.mark.parametrize("seed", [41, pytest.param(42, marks=pytest.mark.night)])
def test_inspect_and_estimate_agree_where_one_flank_is_loaded_throughout(seed: int) -> None:
    record = _held_record(seed, 8.0)
    seen = oc.inspect(record, oc.read_model())
    assert seen.smallest_gap == np.inf
    assert not seen.sufficiency.bounds
    assert "one flank is loaded throughout" in seen.verdict()[0]
    assert not re.search(r"[\d.]+ rad", seen.verdict()[0])
    found = oc.estimate(record, oc.read_model(), diagnose=False)
    assert not found.visible
    assert np.isnan(found.alpha)
    assert re.search(r"^maximum likelihood +– +no", str(found), re.MULTILINE)
    assert found.results().alpha is None
    assert found.results().play is None


def test_the_advice_of_a_held_record_shows_the_gap(columns) -> None:
    """Its words: let the shaft's torque change its sign."""
    assert "let the shaft's torque change its sign" in oc.inspect(_held_record(43, 8.0), oc.read_model()).verdict()[0]
    assert oc.inspect(record_from_columns(columns, "reversing"), oc.read_model()).smallest_gap <= 0.001


def test_the_sentence_says_what_the_table_says(columns) -> None:
    """A weak torque moves the teeth through small gaps only: a size that is not seen is in no range of the sentence."""
    for scale in (1.0, 0.05, 0.01):
        weak = dict(columns) | {"u": scale * columns["u"]}
        seen = oc.inspect(record_from_columns(weak, "weak"), oc.read_model())
        sizes = {size: bound < 0.25 * size for size, bound in seen.sufficiency.bounds}
        ranges = seen.sufficiency.ranges()
        for size, visible in sizes.items():
            assert visible == any(low <= size <= high for low, high in ranges)
        assert ("and larger" in seen.verdict()[0]) == bool(sizes and list(sizes.values())[-1])


def test_a_lost_sign_of_the_torque_gets_a_hint() -> None:
    """A machine that swings at 1 Hz under a torque of which the log has the magnitude."""
    time = 0.005 * np.arange(1200)
    swung = {"time": time, "u": np.abs(np.sin(6.3 * time)), "theta_m": np.sin(6.3 * time)}
    whole, lost = (record_from_columns(swung | {"u": u}, "swing") for u in (np.sin(6.3 * time), swung["u"]))
    nothing = Sufficiency((), np.inf, time.size, (), np.inf, np.nan, "of this test")
    hints = [verdict_of(nothing, reversals_of(one), None)[1:] for one in (whole, lost)]
    assert hints[0] == []
    assert "the log has lost the sign" in hints[1][0]


def test_a_model_that_cannot_be_the_machine_gets_no_table(columns) -> None:
    slow = dict(columns) | {"time": 20.0 * columns["time"]}
    record = record_from_columns(slow, "slow")
    model = oc.read_model()
    seen = oc.inspect(record, replace(model, stated=tuple(model.plant.linear)))
    assert not seen.sufficiency.bounds
    assert "`estimate` refuses it" in seen.verdict()[0]
    with pytest.raises(oc.RecordError, match="log faster"):
        oc.estimate(record)


@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_an_axis_without_teeth_is_inspected(lag: float, tmp_path: Path) -> None:
    model = tmp_path / "axis.toml"
    model.write_text(f"{MODEL}\n[parameters.tau]\nvalue = {lag}\n")
    seen = oc.inspect(axis_record(DEFAULTS, 5, "axis"), oc.read_model(model))
    assert "an axis without teeth" in seen.verdict()[0]
    assert [effect.name for effect in seen.effects]
    starter = tmp_path / "starter.toml"
    starter.write_text(seen.starter)
    again = read_model(starter)
    assert again.fmu == "ServoAxis"
    assert again.parameters["J"].value == 1.0


@pytest.mark.parametrize("size", [1.0, 0.02])
def test_an_axis_of_which_nothing_is_known_is_drafted_from_its_record(size: float, tmp_path: Path) -> None:
    (tmp_path / "axis.toml").write_text('fmu = "ServoAxis"\n')
    record = axis_record(DEFAULTS._replace(J=size, b=size), 5, "axis")
    (tmp_path / "starter.toml").write_text(oc.inspect(record, oc.read_model(tmp_path / "axis.toml")).starter)
    drafted = read_model(tmp_path / "starter.toml").parameters
    for name in ("J", "b"):
        assert drafted[name].value == pytest.approx(size, rel=0.02), name
        assert drafted[name].uncertainty > 0.5 * size, name
        assert drafted[name].assumed, name


def test_a_small_joint_is_no_thesis_drivetrain() -> None:
    """A joint of a hundredth of the inertia: its starter says that values are rough, not the given model's."""
    joint = {"J_m": 0.004, "J_l": 0.05, "k": 40.0, "c": 0.02, "b_m": 0.01, "b_l": 0.02, "i": 3.984, "tau": 0.02}
    columns = make_record({"alpha": 0.01}, 8, 6.0, torque=0.005, nominal=joint)[0]
    text = oc.inspect(record_from_columns(columns, "joint")).starter
    rough = set(re.findall(r"\[parameters\.(\w+)\]\nvalue = .*ROUGH", text))
    assert {"k", "b_m", "b_l"} <= rough
    stated_by_nobody = set(re.findall(r"\[parameters\.(\w+)\]\n.*\n.*\nassumed = true", text))
    assert rough <= stated_by_nobody  # a fit that leaves a range of ours says nothing against the machine
    assert "the thesis's" not in text
