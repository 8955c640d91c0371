"""A log in volts: the torque behind it, and the half-gap that it gives."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.errors import RecordError
from orchestrator.estimation.methods import maximum_likelihood
from orchestrator.records.columns import Column
from orchestrator.records.drive import torque_of_voltage
from orchestrator.records.model_file import default_model, read_model
from orchestrator.records.record import read_record
from tests.support.independent_plant import make_record

RESISTANCE, CONSTANT, BACK_EMF, INDUCTANCE = 0.8, 1.7, 1.6, 2e-3
DRIVE = Column(unit="V", resistance=RESISTANCE, torque_constant=CONSTANT, back_emf_constant=BACK_EMF)
HEAD = "time,Umot [V],theta_m,theta_l"
TABLE = '[columns.u]\nname = "Umot [V]"\n'


def terminal_voltage(columns: dict[str, np.ndarray], speed: np.ndarray) -> np.ndarray:
    """Return the voltage that makes the torque ``u`` at the motor's true mean speed over each sample."""
    return RESISTANCE * columns["u"] / CONSTANT + BACK_EMF * speed


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, np.ndarray]]:
    """A log whose drive holds the mean voltage over a sample that its torque needs."""
    columns, truth = make_record({"alpha": 0.01}, seed=21, duration=5.0, mismatch=0.0)
    angle = truth["states"][:, 0]
    speed = np.append(np.diff(angle), 0.0) / float(columns["time"][1])
    path = tmp_path_factory.mktemp("volts") / "volts.csv"
    rows = np.column_stack([columns["time"], terminal_voltage(columns, speed), columns["theta_m"], columns["theta_l"]])
    path.write_text("\n".join([HEAD, *(",".join(format(x, ".9g") for x in row) for row in rows)]) + "\n")
    return path, columns


def model_of(folder: Path, more: str) -> Path:
    file = folder / "model.toml"
    file.write_text(TABLE + more)
    return file


def test_a_voltage_gives_the_torque_and_the_half_gap(log, tmp_path: Path) -> None:
    path, columns = log
    numbers = f"resistance = {RESISTANCE}\ntorque_constant = {CONSTANT}\nback_emf_constant = {BACK_EMF}\n"
    record = read_record(path, read_model(model_of(tmp_path, numbers)).columns)
    # The encoder's reading moves the torque from sample to sample, but not the impulse that the motor has had.
    impulse = np.cumsum(record.u - columns["u"])[:-1] * record.step
    assert np.abs(impulse).max() < 3.0 * BACK_EMF * CONSTANT / RESISTANCE * 1.2e-3
    found = maximum_likelihood.estimate(record, default_model())
    assert found.interval[0] < 0.01 < found.interval[1]
    assert found.standard_error < 3e-5


def test_an_uncertain_torque_constant_is_found_with_the_gap(log, tmp_path: Path) -> None:
    path, _ = log
    numbers = f"resistance = {RESISTANCE}\ntorque_constant = {CONSTANT / 1.03}\nback_emf_constant = {BACK_EMF}\n"
    file = model_of(tmp_path, numbers + "relative_uncertainty = 0.05\n")
    file.write_text(file.read_text() + "[parameters.c]\nrelative_uncertainty = 0.05\n")  # the others are exact
    model = read_model(file)
    record = read_record(path, model.columns)
    found = maximum_likelihood.estimate(record, model)
    scale = found.diagnostics["parameters"]["u_scale"]
    assert scale["value"] == pytest.approx(1.03, abs=3e-3)
    assert found.alpha == pytest.approx(0.01, rel=0.01)


def test_inductance_delays_the_current_as_a_fine_integration_does() -> None:
    step, fine = 1e-3, 200
    rng = np.random.default_rng(3)
    volts, time = rng.standard_normal(400), step * np.arange(400)
    angle = np.zeros(400)
    drive = Column(unit="V", resistance=RESISTANCE, torque_constant=CONSTANT, inductance=INDUCTANCE)
    current, means = volts[0] / RESISTANCE, []
    for volt in volts:
        at = []
        for _ in range(fine):  # midpoint rule
            rate = (volt - RESISTANCE * current) / INDUCTANCE
            middle = current + 0.5 * step / fine * rate
            at.append(middle)
            current += step / fine * (volt - RESISTANCE * middle) / INDUCTANCE
        means.append(np.mean(at))
    np.testing.assert_allclose(torque_of_voltage(volts, angle, time, drive), CONSTANT * np.array(means), atol=1e-5)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("", "`[columns.u] resistance = ...` and `[columns.u] torque_constant = ...`"),
        ("torque_constant = 1.7\n", "is in volts: say `[columns.u] resistance = ...` ("),
    ],
)
def test_volts_without_a_drive_are_refused_with_what_to_say(log, tmp_path: Path, table: str, said: str) -> None:
    with pytest.raises(RecordError, match=r"is in volts") as caught:
        read_record(log[0], read_model(model_of(tmp_path, table)).columns)
    assert said in str(caught.value)


@pytest.mark.parametrize("line", ["resistance = 0", "inductance = -1", "back_emf_constant = -0.1"])
def test_impossible_drives_are_refused(log, tmp_path: Path, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", str(log[0]), "--model", str(model_of(tmp_path, line)), "--out", str(tmp_path / "o")]) == 2
    assert f"`columns.u.{line.partition(' ')[0]}`" in capsys.readouterr().err


def test_inspect_writes_a_starter_for_volts(log, tmp_path: Path) -> None:
    out = tmp_path / "seen"
    assert main(["inspect", str(log[0]), "--model", str(model_of(tmp_path, "")), "--out", str(out)]) == 0
    text = (out / "model.toml").read_text()
    assert "resistance = 1   # ASSUMED" in text
    assert "torque_constant = 1   # ASSUMED" in text
