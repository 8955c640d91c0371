"""The model file of a corrected model reads every record that the first one read, to the same numbers."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.api.records import as_record
from orchestrator.diagnosis.report.corrected import format_corrected_model, start_values
from orchestrator.plants.known.drivetrain import PLANT
from orchestrator.records.model_file import Model, read_model

ROWS = 400
LOGS = {
    "amperes": (
        "time,i_q,qm,ql",
        'name = "i_q"\nunit = "A"\ntorque_constant = 0.713\nrelative_uncertainty = 0.04',
        "",
        "",
    ),
    "percent": ("time,u,qm,ql", 'unit = "%"\nrated_value = 12.7\nfactor = -1\noffset = 0.25', "", ""),
    "volts": (
        "time,u,qm,ql",
        'unit = "V"\nresistance = 0.8\ntorque_constant = 1.7\nback_emf_constant = 1.65\ninductance = 2.1e-3',
        "",
        "",
    ),
    "sample numbers": ("n,u,qm,ql", 'unit = "N.mm"', '[columns.time]\nname = "n"\nrate = 312.5', ""),
    "no names": ("", 'name = "#2"', '[columns.time]\nname = "#1"', "header = 0"),
    "a name in quotes": ('time,"u ""cmd"" \\set",qm,ql', "name = 'u \"cmd\" \\set'", "", "header = 1"),
}


def _write(folder: Path, kind: str) -> tuple[Path, Path]:
    """Write a log whose motor counts wrap, and a model file that reads it."""
    names, drive, time, header = LOGS[kind]
    at = np.arange(ROWS) / 250.0
    motor = np.round(40.0 * np.sin(3.0 * at) * 4096.0 / (2.0 * np.pi)) + 9000.0
    first = np.arange(ROWS) if "rate" in time else at
    torque = np.sin(7.0 * at) + 0.1 * np.cos(31.0 * at)
    rows = zip(first, torque, np.mod(motor, 16384.0), np.rad2deg(3.0 * np.sin(3.0 * at)), strict=True)
    log, model = folder / "log.csv", folder / "model.toml"
    log.write_text(
        "\n".join([*([names] if names else []), *(",".join(f"{v:.12g}" for v in row) for row in rows)]) + "\n"
    )
    motor_name, load_name = ("#3", "#4") if kind == "no names" else ("qm", "ql")
    model.write_text(
        f"{header}\n{time}\n[columns.u]\n{drive}\n"
        f'[columns.theta_m]\nname = "{motor_name}"\nunit = "counts"\ncounts_per_rev = 4096\nmodulo = 16384\n'
        f'[columns.theta_l]\nname = "{load_name}"\nunit = "deg"\n'
        "[encoders.theta_m]\ncounts_per_rev = 4096\n[encoders.theta_l]\nnoise = 0.01\n"
        "[parameters.i]\nvalue = 13.3\nuncertainty = 0\n"
    )
    return log, model


def _corrected(model: Model, folder: Path) -> Model:
    """Return the model that is read from the corrected file, when nothing was fitted."""
    values = np.array(model.values)
    unchanged = SimpleNamespace(parameters={}, effects=(), workings=SimpleNamespace(final=values))
    path = folder / "corrected.toml"
    path.write_text(format_corrected_model(model, unchanged), encoding="utf-8")
    return read_model(path)


@pytest.mark.parametrize("kind", LOGS)
def test_the_corrected_model_file_reads_the_same_record(tmp_path: Path, kind: str) -> None:
    log, given = _write(tmp_path, kind)
    model = read_model(given)
    again = _corrected(model, tmp_path)
    assert again.header == model.header
    first, second = (as_record(log, one) for one in (model, again))
    for name in ("time", "u", "theta_m", "theta_l"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.u_scale_uncertainty == second.u_scale_uncertainty
    assert {name: again.encoder(name) for name in again.encoders} == dict(model.encoders)


def test_nothing_of_a_column_is_left_out(tmp_path: Path) -> None:
    """Every field of a column, at a value that no default has, comes back."""
    text = {
        "time": 'name = "t"\nunit = "ms"\nfactor = 2\noffset = 3\nmodulo = 65536\nrate = 123.456789012345',
        "u": 'name = "i"\nunit = "V"\nfactor = -1\noffset = 0.1\nrated_value = 7.7\ntorque_constant = 0.1\n'
        "resistance = 0.3\nback_emf_constant = 0\ninductance = 0\nrelative_uncertainty = 0.07",
        "theta_m": 'unit = "counts"\ncounts_per_rev = 16777216\nmodulo = 4294967296',
    }
    path = tmp_path / "all.toml"
    path.write_text("".join(f"[columns.{name}]\n{lines}\n" for name, lines in text.items()))
    model = read_model(path)
    assert _corrected(model, tmp_path).columns == model.columns


def test_a_model_of_exact_values_stays_exact(tmp_path: Path) -> None:
    """Else the default's 5 % of every parameter would come back."""
    path = tmp_path / "exact.toml"
    path.write_text("[parameters.J_l]\nvalue = 5.6\nuncertainty = 0\n")
    assert not _corrected(read_model(path), tmp_path).uncertain


def test_the_corrected_fmu_becomes_the_nominal_model_by_what_either_has() -> None:
    nominal, final = (PLANT.extend_values([entry.default for entry in PLANT.table]) for _ in range(2))
    places = [PLANT.index(name) for name in ("alpha", "backlash_model", "J_m", "b_l")]
    final[places[:3]], nominal[places[2:]] = (0.03, 2.0, 0.7), (0.5, 2.5)
    assert start_values(PLANT, final) == {"alpha": 0.03, "backlash_model": 3.0, "J_m": 0.7}
    assert start_values(PLANT, nominal, final) == {"alpha": 0.0, "backlash_model": 2.0, "J_m": 0.5, "b_l": 2.5}
