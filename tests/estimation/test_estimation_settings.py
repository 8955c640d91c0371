"""Thresholds of an estimate: from a file or an object, refused when wrong, written into the result, and used."""

import json
from pathlib import Path

import msgspec
import pytest

import orchestrator as oc
from orchestrator.cli import main
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.estimation.trust import trust_of_estimates
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record, write_csv


@pytest.fixture(scope="module")
def columns():
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


def test_a_file_changes_what_it_names_and_the_result_holds_all(columns, tmp_path: Path) -> None:
    write_csv(tmp_path / "r.csv", columns)
    file = tmp_path / "settings.toml"
    file.write_text("[trust]\nwidest = 0.1\n")
    words = ["estimate", str(tmp_path / "r.csv"), "--method", "ekf", "--out", str(tmp_path / "out")]
    assert main([*words, "--settings", str(file)]) == 0
    used = json.loads((tmp_path / "out" / "estimate.json").read_text())["results"]["settings"]
    assert used["trust"]["widest"] == 0.1
    assert used["fit"] == msgspec.to_builtins(DEFAULT_SETTINGS.fit)


@pytest.mark.parametrize(
    ("text", "said"), [("[fit]\nsteps_per_level = 0\n", "steps_per_level"), ("[fits]\nx = 1\n", "fits")]
)
def test_what_is_wrong_is_refused(columns, tmp_path: Path, text: str, said: str, capsys) -> None:
    write_csv(tmp_path / "r.csv", columns)
    (tmp_path / "settings.toml").write_text(text)
    words = ["estimate", str(tmp_path / "r.csv"), "--settings", str(tmp_path / "settings.toml")]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err


def test_the_thresholds_of_the_verdict_decide(columns) -> None:
    record = record_from_columns(columns, "r")
    verdict = msgspec.structs.replace(DEFAULT_SETTINGS.verdict, least_travel_motor=1e9)
    still = oc.estimate(record, settings=EstimationSettings(verdict=verdict), diagnose=False)
    assert "the motor moves by only" in still.message
    trust = msgspec.structs.replace(DEFAULT_SETTINGS.trust, least_traversals=10_000)
    seen = oc.estimate(record, settings=EstimationSettings(trust=trust), diagnose=False)
    assert seen.visible
    assert any("traversed only" in reason for reason in seen.trust.reasons)
    usual = trust_of_estimates(seen.estimates, default_model())
    assert usual["maximum_likelihood"].level.word == "green"
