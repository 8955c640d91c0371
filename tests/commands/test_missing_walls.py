"""Where the system has no walls: said once on the standard error stream, and in the result; strays are killed still."""

import json
import os
import sys
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.shared.isolation.jail import Jail
from tests.support.c_fmu import build_c_fmu, have_compiler
from tests.support.hostile_fmus import World, command

SAID = "note: FMUs that are not ours run with limits, but files of the user are not protected (no Landlock); "


@pytest.fixture
def no_walls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orchestrator.shared.isolation.landlock.version", lambda: 0)
    monkeypatch.setattr("orchestrator.shared.isolation.seccomp.available", lambda: False)


@pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
@pytest.mark.usefixtures("no_walls")
@pytest.mark.parametrize("kind", ["check", "simulate", "sweep", "ssp"])
def test_what_is_not_enforced_is_said_once(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    world = World(tmp_path / "world")
    world.close()
    monkeypatch.chdir(world.folder)
    fmu = build_c_fmu(world.folder / "inputs")
    words = command(world, kind, fmu, 60.0)
    assert main(words[words.index(kind) :]) == 0
    said = capsys.readouterr().err
    assert said.startswith(SAID)
    assert said.count("\n") == 1
    results = json.loads((world.folder / "results" / f"{kind}.json").read_text())["results"]
    assert "no Landlock" in json.dumps(results)


@pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
@pytest.mark.usefixtures("no_walls")
def test_diagnose_says_it_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fmu, record = build_c_fmu(tmp_path), tmp_path / "record.csv"
    record.write_text("time,force,x\n" + "".join(f"{0.1 * k:.1f},{k % 3},0.{k}\n" for k in range(50)))
    assert main(["diagnose", str(record), "--fmu", str(fmu), "--draft-map", "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().err.startswith(SAID)


@pytest.mark.skipif(sys.platform != "linux", reason="strays are found by what Linux says of processes")
def test_without_walls_a_daemon_is_found_and_killed(tmp_path: Path) -> None:
    with Jail("tests.support.jail_programs:opened", walls=False, adopt=True) as jail:
        daemon = jail.call(["daemon"], int)
        assert jail.finish()
    with pytest.raises(ProcessLookupError):
        os.kill(daemon, 0)
