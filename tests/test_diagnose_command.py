"""The command: contract of its JSON, the corrected FMU, and what it refuses."""

import json
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.fmi.model_description import read_description
from tests.support.independent_plant import make_record, write_csv


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("diagnose")
    for name, seed in (("loose gear", 61), ("other", 62)):
        linear = {"k": 3400.0, "J_l": 5.4}
        columns, _ = make_record({"alpha": 0.005}, seed, 12.0, substeps=50, mismatch=0.0, linear=linear)
        write_csv(folder / f"{name}.csv", columns)
    out = folder / "out"
    arguments = ["diagnose", str(folder / "loose gear.csv"), "--validate", str(folder / "other.csv"), "--out", str(out)]
    assert main(arguments) == 0
    return out, json.loads((out / "diagnose.json").read_text())


@pytest.mark.slow
def test_json_keeps_the_contract(result) -> None:
    _, document = result
    assert document["command"] == "diagnose"
    results = document["results"]
    assert results["verdict"] == "effects"
    (effect,) = results["effects"]
    assert {"name", "site", "parameters", "score", "runner_up", "margin"} <= set(effect)
    assert (effect["name"], effect["site"]) == ("backlash", "shaft")
    assert set(effect["parameters"]["alpha"]) == {"value", "standard_error", "unit"}
    assert effect["parameters"]["alpha"]["value"] == pytest.approx(0.005, rel=0.02)
    assert set(results["parameters"]["k"]) == {"nominal", "value", "standard_error", "unit"}
    assert results["parameters"]["k"]["value"] == pytest.approx(3400.0, rel=0.02)
    shares = [place["share_of_gap"] for place in results["where"]]
    assert shares == sorted(shares, reverse=True)
    for signal in ("theta_m", "theta_l"):
        gap = results["gap"][signal]
        assert gap["after"] < 0.1 * gap["before"]
        assert results["validation"][signal]["after"] < 0.1 * results["validation"][signal]["before"]


@pytest.mark.slow
def test_corrected_fmu_has_the_corrected_start_values(result) -> None:
    out, document = result
    path = Path(document["results"]["model"])
    assert path == out / "Drivetrain_loose_gear.fmu"
    starts = {variable.name: variable.start for variable in read_description(path).model.variables.values()}
    assert starts["alpha"] == document["results"]["effects"][0]["parameters"]["alpha"]["value"]
    assert starts["k"] == document["results"]["parameters"]["k"]["value"]
    assert document["results"]["cosimulation"]["largest_difference_from_compiled"] < 1e-9
    for name in ("signals", "innovations", "candidates", "missing_torque"):
        assert (out / f"diagnose_{name}.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", ["missing.csv", "short.csv"])
def test_what_cannot_be_read_is_refused_in_one_line(tmp_path, capsys, name) -> None:
    (tmp_path / "short.csv").write_text("time,u,theta_m\n0,1,2\n")
    assert main(["diagnose", str(tmp_path / name), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
