"""The small inputs behind public reports, where they are at hand."""

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.errors import RecordError
from orchestrator.records.model_file import read_model
from orchestrator.records.record import Reading, read_record
from orchestrator.scenarios.scenario import load_scenario, simulate

FOLDERS = [parent / "shared" / "data" / "reports" for parent in Path(__file__).resolve().parents]
FOLDER = next((folder for folder in FOLDERS if folder.is_dir()), None)
pytestmark = pytest.mark.skipif(FOLDER is None, reason="the shared inputs are not here")


def _of(name: str) -> Path:
    assert FOLDER is not None
    return FOLDER / name


@pytest.mark.parametrize(
    ("name", "rows", "said"),
    [
        ("01-mat-with-matlab-object/plain.mat", 800, "4 vectors"),
        ("01-mat-with-matlab-object/with_string.mat", 800, "passed over: `operator` (string)"),
        ("12-mat-shapes/01_structure_with_time.mat", 500, "4 vectors"),
        ("12-mat-shapes/05_vectors_v4.mat", 500, "version 4"),
    ],
)
def test_mat_files(name: str, rows: int, said: str) -> None:
    record = read_record(_of(name))
    assert record.size == rows
    assert said in record.notes[0]


def test_units_that_were_taken_as_si() -> None:
    plain, small = (read_record(_of(f"03-unit-not-understood/{name}.csv")) for name in ("00_Nm", "01_Nmm"))
    np.testing.assert_allclose(small.u, plain.u, rtol=1e-6)
    with pytest.raises(RecordError, match=r"in counts: say `\[columns.theta_m\] counts_per_rev"):
        read_record(_of("03-unit-not-understood/08_qc.csv"))


@pytest.mark.parametrize("name", ["01_one_of_u", "03_one_of_motor"])
def test_invalid_samples_of_mdf(name: str) -> None:
    pytest.importorskip("asammdf")
    record = read_record(_of(f"04-mdf-invalid-samples/{name}.mf4"))
    assert np.flatnonzero(record.is_missing).tolist() == [500]


@pytest.mark.parametrize(
    ("name", "model", "header"),
    [("tc_one.csv", "numbered", None), ("tc_one.csv", "numbered", 7), ("tek.csv", "numbered_s", None),
     ("tek.csv", "numbered_s", 19), ("lvm_one.lvm", "numbered_s", None)],
)  # fmt: skip
def test_lines_above_the_names(name: str, model: str, header: int | None) -> None:
    folder = _of("05-log-headers")
    record = read_record(folder / name, read_model(folder / f"{model}.toml").columns, (), Reading(header=header))
    assert record.step == pytest.approx(4e-3)
    np.testing.assert_allclose(record.u[:3], [14.0, 14.045389, 14.091078], atol=1e-5)
    np.testing.assert_allclose(record.theta_l[:2], [4.7e-5, -2.3e-5], atol=1e-6)


@pytest.mark.parametrize("name", ["01_plain", "02_bom", "03_event", "04_semicolon", "06_blank_line_end", "09_spaces"])
def test_tables_of_scenarios(name: str) -> None:
    scenario = load_scenario(_of(f"09-tables-and-discrete/t{name}.toml"))
    signal = scenario.system.sources[0].signal
    values = signal.sample(np.array([0.0, 0.25, 0.499999, 0.5, 1.0]))
    expected = [0.0, 0.0, 0.0, 1.0, 1.0] if name == "03_event" else [0.0, 0.5, 0.999998, 1.0, 1.0]
    np.testing.assert_allclose(values, expected, atol=1e-9)


def test_an_event_reaches_the_fmu() -> None:
    result = simulate(load_scenario(_of("09-tables-and-discrete/t03_event.toml")))
    np.testing.assert_allclose(result["s.y"], [0.0] * 6 + [1.0] * 5)


@pytest.mark.parametrize("name", ["00_plain", "01_iso", "10_milliseconds"])
def test_records_of_any_fmu(name: str, tmp_path: Path) -> None:
    folder = _of("11-any-fmu-records")
    files = ["--fmu", str(folder / "tank.fmu"), "--map", str(folder / "map.toml"), "--out", str(tmp_path / "out")]
    assert main(["calibrate", str(folder / f"{name}.csv"), *files]) == 0
    fitted = json.loads((tmp_path / "out" / "calibrate.json").read_text())["results"]["parameters"]
    assert fitted["C"]["value"] == pytest.approx(4179.4, rel=1e-3)
    assert fitted["G"]["value"] == pytest.approx(9.404, rel=1e-3)
