"""The benchmark of masters: its rows, its floor, and what it says of tools that are not there."""

import importlib.util
import json
from pathlib import Path

import pytest

from benchmarks.masters import alone
from benchmarks.masters.__main__ import main
from benchmarks.masters.job import BenchJob, read_job
from benchmarks.masters.measure import compare
from benchmarks.masters.of_scenario import job_of
from benchmarks.masters.reference import SCHEMES, reference_ends
from orchestrator.building.build import ensure_built
from orchestrator.building.compilers import find_compiler
from orchestrator.master import session
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.scenario import scenario_of_pair


@pytest.fixture(scope="module")
def job() -> BenchJob:
    return job_of(scenario_of_pair(Experiment(), ensure_built(), 0.02, 0.5), ["plant.theta_l"])


def test_job_is_plain_data(job, tmp_path: Path) -> None:
    job.write(tmp_path / "job.json")
    assert read_job(tmp_path / "job.json") == job
    assert list(job.fmus)[:3] == ["plant", "estimator", "controller"]
    assert job.steps == 2000
    assert ["controller", "reference", "Real", 0.5] in job.starts


def test_command(tmp_path: Path, capsys) -> None:
    words = ["--rounds", "1", "--tools", "ours,floor,fmpy,pyfmi", "--json", str(tmp_path / "rows.json")]
    assert main(words) == 0
    rows = {row["tool"]: row for row in json.loads((tmp_path / "rows.json").read_text())["rows"]}
    assert all(rows[name]["runs"] == 3 and rows[name]["cpu"] > 0.0 for name in ("ours", "floor", "fmpy"))
    assert all(rows[name]["deviation"] <= 1e-12 for name in ("ours", "floor", "fmpy"))  # the same work
    if importlib.util.find_spec("pyfmi") is None:
        assert rows["pyfmi"]["note"] == "not installed"
    assert rows["ours"]["cpu"] < 0.7 * rows["fmpy"]["cpu"]
    assert "floor" in capsys.readouterr().out


@pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")
def test_fmus_of_fmi_3_where_tools_take_them(tmp_path: Path, capsys) -> None:
    words = ["--rounds", "1", "--fmi", "3", "--tools", "ours,fmpy_batched,fmpy,floor"]
    assert main([*words, "--json", str(tmp_path / "rows.json")]) == 0
    rows = {row["tool"]: row for row in json.loads((tmp_path / "rows.json").read_text())["rows"]}
    assert all(rows[name]["deviation"] == 0.0 for name in ("ours", "fmpy_batched", "fmpy"))
    assert rows["floor"]["note"] == "takes no FMUs of FMI 3.0 with arrays"
    assert "native FMUs of FMI 3.0" in capsys.readouterr().out


def test_bad_arguments(capsys) -> None:
    for words in ("--tools ours,magic", "--rounds 0", "--python pyfmi", "--python pyfmi=/no/such/python"):
        assert main(words.split()) == 2
    assert capsys.readouterr().err.count("\n") == 4


@pytest.mark.parametrize(("name", "package"), [("ecos", "ecospy"), ("libcosim", "libcosimpy")])
def test_other_masters_did_the_work_that_they_are_timed_for(job, name: str, package: str) -> None:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed (`pip install .[hosts]`)")
    (row,) = compare(job, [name], 1)
    if "cannot open shared object file" in row.note:
        pytest.skip(row.note)
    assert row.note == ""
    assert row.deviation is not None
    assert row.deviation <= 1e-12


def test_deviation_shows_another_order_of_exchange(job) -> None:
    """What ends where Gauss-Seidel ends did not run side by side: the check tells schemes apart."""
    ends = {scheme: reference_ends(job, scheme)["plant.theta_l"] for scheme in SCHEMES}
    assert len({round(end, 6) for end in ends.values()}) == len(SCHEMES)


def test_growth_is_measured(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(alone, "CASE_STEPS", 10)
    monkeypatch.setattr(alone, "RECORD_STEPS", 2000)
    monkeypatch.setattr(session, "COMPILED_FROM", session.COMPILED_FROM)
    found = []
    for what, count in (("sweep", 4), ("record", 3)):
        assert alone.main([what, str(count), str(tmp_path / "point.json")]) == 0
        found.append(json.loads((tmp_path / "point.json").read_text()))
    assert alone.SweepCost(**found[0]).per_case > 0.0
    assert alone.RecordCost(**found[1]).expected == pytest.approx(4 * 8 * 2001 / 2**20)
