"""What a session keeps: notes of the page, whole and shared, and results until they are removed."""

import asyncio
import json
import signal
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.errors import InputError
from orchestrator.workbench.command_lines import command_line
from orchestrator.workbench.notes import Notes
from orchestrator.workbench.session import kind_of, open_session
from tests.support.workbench import ROOT, drive_log, workbench

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")


def test_tables_are_merged_entry_by_entry_and_null_removes(tmp_path: Path) -> None:
    notes = Notes(tmp_path, 1000)
    notes.change({"log": "a", "shown": {"gap": "estimate-1", "log": "inspect-1"}, "list": [1, 2]})
    notes.change({"shown": {"gap": "estimate-2", "log": None}, "log": None, "list": [3]})
    assert notes.all == Notes(tmp_path, 1000).all == {"shown": {"gap": "estimate-2"}, "list": [3]}
    assert notes.version == 3
    with pytest.raises(InputError, match="at most"):
        notes.change({"much": "x" * 1000})
    assert Notes(tmp_path, 1000).all == notes.all


@pytest.mark.parametrize("text", ["{", "7", '"words"', "[1]", "[" * 100_000, "\xff"])
def test_notes_that_nobody_wrote_are_refused_with_the_cure(tmp_path: Path, text: str, capsys) -> None:
    (tmp_path / "session.json").write_bytes(text.encode("latin-1"))
    assert main(["workbench", "--no-browser", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert f"{tmp_path}/session.json must be what a workbench wrote, but is not: remove it" in said


def test_files_are_offered_for_what_they_hold(tmp_path: Path) -> None:
    texts = {
        "machine.toml": "[parameters.k]\nvalue = 1.0\n", "strict.toml": "[selection]\nleast_gain = 0.02\n",
        "loop.toml": "stop = 1.0\n[instances.a]\nfmu = 'a.fmu'\n", "broken.toml": "[", "axis.csv": "1", "a.FMU": "1",
        "page.html": "", "map.toml": "[outputs]\nq = 'q'\n[parameters.J]\nuncertainty = '5 %'\n",
        "deep.toml": "a = " + 5000 * "[",
    }  # fmt: skip
    kinds = {}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        kinds[name] = kind_of(tmp_path / name)
    assert kinds == {
        "machine.toml": "model", "strict.toml": "settings", "loop.toml": "scenario", "broken.toml": "model",
        "axis.csv": "log", "a.FMU": "fmu", "page.html": "other", "map.toml": "map", "deep.toml": "model",
    }  # fmt: skip


def test_work_outlasts_a_kill_at_another_port_until_it_is_removed(tmp_path: Path) -> None:
    with workbench(tmp_path / "session") as first:
        first.ask("PUT", "upload/words.csv", b"these,are\nno,numbers\n")
        job = first.wait(first.start("inspect", ["files/words.csv"]))
        assert first.ask("POST", "notes", {"log": "files/words.csv", "shown": {"log": job["name"]}})[0] == 200
        version = first.ask("GET", "state")[1]["version"]
        assert "notes" not in first.ask("GET", f"state?notes={version}")[1]  # nothing new
        first.process.send_signal(signal.SIGKILL)
        first.process.wait()
    left = tmp_path / "session" / "results" / ".gone-0"  # of a removal that was cut off
    left.mkdir()
    with workbench(tmp_path / "session") as again:
        assert (again.port, again.token) != (first.port, first.token)
        found = again.ask("GET", "state")[1]
        assert found["notes"] == {"log": "files/words.csv", "shown": {"log": "inspect-1"}}
        assert [one["name"] for one in found["jobs"]] == ["inspect-1"]
        assert not left.exists()
        for wrong in ("inspect-9", "..", "%2e%2e", "inspect-1%2f..%2f..", ".gone-0"):
            assert again.ask("POST", f"jobs/{wrong}/remove", {})[0] in (400, 404, 405)
        assert again.ask("GET", "jobs/inspect-1/remove")[0] == 405
        assert again.ask("POST", "jobs/inspect-1/remove", {})[0] == 200
        assert again.ask("GET", "state")[1]["jobs"] == []
        assert list((tmp_path / "session" / "results").iterdir()) == []
    assert json.loads((tmp_path / "session" / "session.json").read_text())["log"] == "files/words.csv"


def test_a_job_under_way_is_not_removed(tmp_path: Path) -> None:
    from orchestrator.workbench.jobs import Job, Jobs
    from orchestrator.workbench.settings import WorkbenchSettings

    session = open_session(tmp_path / "session")
    found = Jobs(session, WorkbenchSettings())
    folder = session.reserve_result("estimate")
    found.all[folder.name] = Job(folder.name, "estimate", (), folder, state="running")
    with pytest.raises(InputError, match="stop it first"):
        asyncio.run(found.remove(folder.name))
    assert folder.is_dir()


EXAMPLE = "Simulated drive: 0.5 N.m/A, ratio 10, half-gap 5 mrad, dry friction 0.05 N.m at the motor"


def test_the_example_record_is_the_one_that_can_be_made_again(tmp_path: Path) -> None:
    made = drive_log(tmp_path / "drive.csv", unknown="Load position [deg]", said=EXAMPLE)
    example = ROOT / "orchestrator" / "workbench" / "static" / "example-drive.csv"
    assert example.read_text() == made.read_text()


def test_a_controller_is_asked_for_by_a_model_file(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    (session.files / "corrected.toml").write_text('fmu = "Drivetrain"')
    options = {"model": "files/corrected.toml", "impact_speed": 0.2, "force": True}
    words = command_line(session, "compensate", [], options)
    assert words == ["compensate", "--model=files/corrected.toml", "--impact-speed=0.2", "--force"]
    with pytest.raises(InputError, match="state_weights"):
        command_line(session, "compensate", [], {"state_weights": "1,1,1,1,1"})
