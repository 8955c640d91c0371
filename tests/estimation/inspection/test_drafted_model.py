"""What ``inspect`` drafts for a machine of which the model file states the columns alone, or little more."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.inspect import OF_GIVEN, inspect
from orchestrator.api.records import read_record
from orchestrator.cli import main
from orchestrator.records.model_file import read_model
from tests.support.drive_record import COUNTS, write_log
from tests.support.sized_drive import Drive, draw_drive, write_drive_log

NAMES = "Time [ms];Current setpoint [A];Motor position [deg];Axis position [deg]"


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Drive, Path]:
    drive = replace(draw_drive(4), seconds=5.0, rate=250.0)
    path = tmp_path_factory.mktemp("log") / "axis.csv"
    write_drive_log(path, drive)
    text = path.read_text().splitlines()
    path.write_text("\n".join([text[0], NAMES, *text[2:]]) + "\n")
    return drive, path


def _columns(drive: Drive, more: str = "") -> str:
    names = NAMES.split(";")
    return (
        f'[columns.u]\nname = "{names[1]}"\nunit = "A"\ntorque_constant = {drive.torque_constant}\n'
        f'[columns.theta_l]\nname = "{names[3]}"\n{more}'
    )


def test_a_column_that_is_not_used_is_named(logged: tuple[Drive, Path]) -> None:
    found = inspect(logged[1])
    assert "not used: `Axis position [deg]`" in found.record.notes
    assert found.record.theta_l is None


@pytest.mark.parametrize("stated", ["", "[parameters.J_m]\nvalue = {J_m}\nrelative_uncertainty = 0.1\n"])
def test_what_a_model_file_leaves_open_is_of_the_record(
    logged: tuple[Drive, Path], tmp_path: Path, stated: str
) -> None:
    drive, log = logged
    given = tmp_path / "columns.toml"
    given.write_text(_columns(drive, stated.format(**drive.linear)))
    found = inspect(log, read_model(given))
    assert "thesis" not in found.starter
    drafted = tmp_path / "drafted.toml"
    drafted.write_text(found.starter)
    model = read_model(drafted)
    values = {name: one.value for name, one in model.parameters.items()}
    assert values["i"] == pytest.approx(drive.linear["i"], rel=0.01)
    assert values["tau"] < 0.05
    if stated:
        assert values["J_m"] == pytest.approx(drive.linear["J_m"], rel=1e-5)
        assert OF_GIVEN in found.starter
    else:
        assert values["J_m"] + values["J_l"] / values["i"] ** 2 == pytest.approx(drive.inertia, rel=0.2)
    assert model.columns["u"].torque_constant == drive.torque_constant
    line = next(text for text in found.starter.splitlines() if text.startswith("torque_constant"))
    assert "ASSUMED" not in line
    shares = [text for text in found.starter.splitlines() if text.startswith("relative_uncertainty")]
    assert all(("holds the value" in text) == text.startswith("relative_uncertainty = 0 ") for text in shares)
    assert {"holds the value" in text for text in shares} == {True, False}
    said = {name for name, one in model.parameters.items() if one.assumed}
    assert said >= {"c"}
    assert ("J_m" in said) == (not stated)


SHEET = {"J_m": 0.004, "J_l": 1.9, "k": 9000.0, "c": 4.0, "b_m": 0.006, "b_l": 2.0, "i": 20.0}


def _fill(text: str) -> str:
    """Fill in the blanks of a drafted file, as its first lines say."""
    for name, value in SHEET.items():
        text = re.sub(rf"# ({name} = {{ value = ),", rf"\g<1>{value},", text)
    text = text.replace("# tau = ", "tau = ")
    for name, counts in (("theta_m", COUNTS[0]), ("theta_l", COUNTS[1])):
        blanks = rf"(\[columns\.{name}\].*\nname = .*\n)# (unit = .*)\n# (counts_per_rev =)"
        text = re.sub(blanks, rf"\1\2\n\3 {counts}", text)
    return re.sub(r"# (unit = \"A\".*)\n# (torque_constant =)", r"\1\n\2 0.127", text)


def test_a_refused_log_leaves_a_model_file_whose_blanks_can_be_filled(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Amperes without a unit: refused, with a file that says what is missing; filled in, the log is read."""
    log, out = tmp_path / "trace.csv", tmp_path / "out"
    write_log(log)
    rows = log.read_text().splitlines()[1:]
    stamped = [f"{2 * n},{row.split(',', 1)[1]}" for n, row in enumerate(rows)]
    log.write_text("\n".join(["Time [ms],Iq_ref,Motor encoder,Load encoder", *stamped]) + "\n")
    assert main(["inspect", str(log), "--out", str(out)]) == 2
    assert f"a model file with blanks to fill in is in {out / 'model.toml'}" in capsys.readouterr().err
    assert [path.name for path in out.iterdir()] == ["model.toml"]
    text = (out / "model.toml").read_text()
    assert "current" in text.split("refused:")[1].splitlines()[1]
    read_model(out / "model.toml")  # a file whose blanks are left alone says nothing wrong
    filled = tmp_path / "machine.toml"
    filled.write_text(_fill(text))
    model = read_model(filled)
    assert {name: model.parameters[name].value for name in SHEET} == SHEET
    assert model.parameters["tau"].value == 0.002
    blank = re.compile(r"^# .*FILL IN", re.MULTILINE)
    assert blank.search(text)
    assert not blank.search(filled.read_text())
    record = read_record(log, model.columns)
    assert record.theta_l is not None
    percent = np.array([float(row.split(",")[1]) for row in rows])
    assert np.allclose(record.u, 0.127 * percent)
