"""The benchmark command: its rows, its floor, and what it says of tools that are not there."""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.bench.job import Job, job_of, read_job
from orchestrator.bench.tools import TOOLS
from orchestrator.cli import main
from orchestrator.fmi.build import ensure_built
from orchestrator.paired.experiment import Experiment
from orchestrator.ssp.pair import paired_scenario


@pytest.fixture(scope="module")
def job() -> Job:
    return job_of(paired_scenario(Experiment(), ensure_built(), 0.02, 0.5))


def test_job_is_plain_data(job, tmp_path: Path) -> None:
    job.write(tmp_path / "job.json")
    assert read_job(tmp_path / "job.json") == job
    assert list(job.fmus)[:3] == ["plant", "estimator", "controller"]
    assert job.steps == 2000
    assert ["controller", "reference", "Real", 0.5] in job.starts


def test_command(tmp_path: Path, capsys) -> None:
    words = ["bench", "--rounds", "1", "--tools", "ours,floor,fmpy,pyfmi", "--out", str(tmp_path)]
    assert main(words) == 0
    rows = {row["tool"]: row for row in json.loads((tmp_path / "bench.json").read_text())["results"]["rows"]}
    assert all(rows[name]["runs"] == 3 and rows[name]["cpu"] > 0.0 for name in ("ours", "floor", "fmpy"))
    if importlib.util.find_spec("pyfmi") is None:
        assert rows["pyfmi"]["note"] == "not installed"
    assert rows["ours"]["cpu"] < 0.7 * rows["fmpy"]["cpu"]
    assert "floor" in capsys.readouterr().out


def test_bad_arguments(tmp_path: Path, capsys) -> None:
    assert main(["bench", "--tools", "ours,magic", "--out", str(tmp_path / "x")]) == 2
    assert main(["bench", "--rounds", "0", "--out", str(tmp_path / "x")]) == 2
    assert capsys.readouterr().err.count("\n") == 2
    assert not (tmp_path / "x").exists()


def test_floor_computes_the_same_loop(job) -> None:
    """The slaves called directly and through FMI go the same way, so that the floor is a floor of the same work."""
    from orchestrator.bench import tools

    slaves: dict = {}
    original = tools._python_slaves

    def keep(job):
        slaves.update(original(job))
        return slaves

    tools._python_slaves = keep
    try:
        run = TOOLS["floor"].prepare(job)
    finally:
        tools._python_slaves = original
    run()
    direct = slaves["plant"].get_real([job.references["plant"]["theta_l"]])[0]
    scenario = paired_scenario(Experiment(), ensure_built(), 0.02, 0.5)
    with scenario.session() as session:
        through = session.run()["plant.theta_l"][-1]
    np.testing.assert_allclose(direct, through, rtol=0.0, atol=1e-12)
