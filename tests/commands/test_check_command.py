"""The command ``check``: exit codes, files, what is executed and what is not."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from lxml import etree

from orchestrator.checking.findings import Execution, FmuFindings
from orchestrator.checking.formats.text import _extent
from orchestrator.cli import main
from tests.support.c_fmu import build_c_fmu, fmu_files, have_compiler, write_fmu

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)


def check(tmp_path: Path, *words: object) -> int:
    return main(["check", *map(str, words), "--out", str(tmp_path / "out")])


def results(tmp_path: Path) -> dict[str, object]:
    document = json.loads((tmp_path / "out" / "check.json").read_text(encoding="utf-8"))
    assert document["command"] == "check"
    return document["results"]


def test_a_good_fmu_gives_one_line_and_exit_code_0(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fmu = build_c_fmu(tmp_path)
    assert check(tmp_path, fmu) == 0
    assert capsys.readouterr().out == f"{fmu}: no findings (executed, CoSimulation: 26 of 26 stages)\n"
    assert results(tmp_path)["ok"] is True


def test_an_error_gives_exit_code_1_and_all_formats_agree(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "fmus"
    folder.mkdir()
    build_c_fmu(folder, name="good")
    build_c_fmu(folder, "crash_step", name="bad")
    files = {"--json": tmp_path / "f.json", "--junit": tmp_path / "f.xml"}
    assert check(tmp_path, folder, *(w for pair in files.items() for w in pair)) == 1
    told = capsys.readouterr().out
    assert "bad.fmu: 1 error, 1 info" in told
    assert "run.crash" in told
    assert json.loads(files["--json"].read_text(encoding="utf-8")) == results(tmp_path)
    suites = etree.parse(str(files["--junit"])).getroot()
    assert [s.get("failures") for s in suites] == ["1", "0"]


def test_reports_are_written_through_no_link_and_over_no_device(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fmu = build_c_fmu(tmp_path)
    victim = tmp_path / "victim"
    victim.write_text("precious")
    for option in ("--json", "--junit", "--sarif", "--code-quality", "--write-baseline"):
        target = tmp_path / f"f{option}"
        target.with_name(f".{target.name}.partial").symlink_to(victim)
        assert check(tmp_path, fmu, "--static", option, target) in (0, 1)
        assert target.stat().st_size > 2
    assert victim.read_text() == "precious"
    os.mkfifo(tmp_path / "pipe")
    for special, what in ((tmp_path / "pipe", "a pipe or a device"), (tmp_path, "a folder")):
        capsys.readouterr()
        assert check(tmp_path, fmu, "--static", "--json", special) == 2
        assert (
            capsys.readouterr().err == f"error: `--json` must be a file that can be written, but {special} is {what}\n"
        )
    assert (tmp_path / "pipe").is_fifo()


def test_warnings_alone_give_exit_code_0(tmp_path: Path) -> None:
    assert check(tmp_path, build_c_fmu(tmp_path, "guid_ignored")) == 0
    counts = results(tmp_path)["counts"]
    assert counts == {"error": 0, "warning": 1, "info": 0}


@pytest.mark.parametrize("what", ["missing", "empty folder"])
def test_bad_input_gives_exit_code_2_and_no_output(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty folder").mkdir()
    assert check(tmp_path, tmp_path / what) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("error: ")
    assert told.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_unwritable_report_gives_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check(tmp_path, build_c_fmu(tmp_path), "--static", "--junit", tmp_path / "no" / "such" / "file.xml") == 2
    assert "`--junit` must be a file that can be written" in capsys.readouterr().err


def test_nothing_is_loaded_of_what_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mark = tmp_path / "mark"
    monkeypatch.setenv("LOADING_MARK", str(mark))
    files = fmu_files("marks_loading")
    good = write_fmu(tmp_path / "good.fmu", files)
    xml = files["modelDescription.xml"]
    bad = write_fmu(
        tmp_path / "bad.fmu", files | {"modelDescription.xml": xml.replace(b"<fmi", b"<!DOCTYPE a><fmi", 1)}
    )
    assert check(tmp_path, bad, "--trust") == 1
    assert check(tmp_path, good, "--static") == 0
    assert not mark.exists()
    assert check(tmp_path, good, "--trust") == 0
    assert mark.exists()


@pytest.mark.night  # CI runs this command itself at each push
def test_our_own_fmus_have_no_finding(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check(tmp_path) == 0
    counts = results(tmp_path)["counts"]
    assert counts == {"error": 0, "warning": 0, "info": 0}, capsys.readouterr().out


def test_works_as_a_program_and_prints_no_traceback(tmp_path: Path) -> None:
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(b"PK\x03\x04 and then nothing")
    command = [sys.executable, "-m", "orchestrator", "check", str(broken), "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2])
    assert done.returncode == 1
    assert "archive.not-a-zip" in done.stdout
    assert done.stderr == ""


def test_stages_that_did_not_run_are_named():
    stages = {"load": "", "steps": "", "reset": "the FMU says nothing of it", "state": "it cannot save its state"}
    report = FmuFindings("a.fmu", (), executions=(Execution("CoSimulation", stages),))
    assert _extent(report) == "executed, CoSimulation: 2 of 4 stages, not reset, state"
