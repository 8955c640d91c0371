"""Settings of the calibration reach it through ``sweep``, and the result says which they were."""

import json

from orchestrator.cli import main
from orchestrator.paired.settings import MapSettings
from orchestrator.shared.settings import as_tables

SMALL = {"clean_sizes": 41, "noisy_sizes": 41, "seeds_per_size": 6, "validation_runs": 200}


def test_a_sweep_takes_the_settings_of_its_calibration_and_writes_them(tmp_path, capsys) -> None:
    path = tmp_path / "quick.toml"
    path.write_text("".join(f"{name} = {value}\n" for name, value in SMALL.items()), encoding="utf-8")
    words = ["sweep", "--sizes", "0.02", "--noise", "0", "--workers", "1", "--settings", str(path)]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    document = json.loads((tmp_path / "out" / "sweep.json").read_text(encoding="utf-8"))
    assert document["arguments"]["settings"] == str(path)
    calibration = document["results"]["calibrations"]["0"]
    assert calibration["runs"] == 41 + 200
    assert calibration["settings"] == as_tables(MapSettings(**SMALL))
    capsys.readouterr()


def test_a_setting_that_does_not_exist_is_refused_by_name(tmp_path, capsys) -> None:
    path = tmp_path / "odd.toml"
    path.write_text("sizes = 41\n", encoding="utf-8")
    assert main(["sweep", "--settings", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "`sizes`" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
