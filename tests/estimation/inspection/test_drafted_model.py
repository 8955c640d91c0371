"""What ``inspect`` drafts for a machine of which the model file states the columns alone, or little more."""

from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.api.inspect import OF_GIVEN, inspect
from orchestrator.records.model_file import read_model
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
