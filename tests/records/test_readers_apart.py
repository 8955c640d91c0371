"""Libraries that read binary formats run in a child process: a file that ends them ends nothing else."""

from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.errors import RecordError
from orchestrator.records.formats import open_source
from orchestrator.records.record import read_record

# A MAT file of version 5 with one damaged byte; scipy's reader ends by SIGSEGV.
CRASHES = Path(__file__).parents[1] / "fuzz_findings" / "record-mat_reader_ends_by_a_signal"


def test_a_file_that_ends_its_reader_is_refused_in_one_line(tmp_path, capfd):
    with pytest.raises(RecordError, match="must be a whole MAT file"):
        read_record(CRASHES)
    assert main(["inspect", str(CRASHES), "--out", str(tmp_path / "out")]) == 2
    complaint = capfd.readouterr().err.strip()
    assert complaint.startswith("error:")
    assert str(CRASHES) in complaint.replace("\n", "")
    assert not (tmp_path / "out").exists()


def test_messages_name_the_file_as_the_user_did(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("short.mat").write_bytes(CRASHES.read_bytes()[:200])
    with pytest.raises(RecordError, match=r"^short\.mat: must be a whole MAT file"):
        read_record(Path("short.mat"))


def test_the_reader_ends_with_the_statement(tmp_path):
    import scipy.io

    scipy.io.savemat(tmp_path / "good.mat", {"u": [1.0, 2.0, 3.0], "theta_m": [0.0, 0.5, 0.25]})
    with open_source(tmp_path / "good.mat") as source:
        names = [head.name for head in source.heads]
        assert source.load([names.index("theta_m")])[0].tolist() == [0.0, 0.5, 0.25]
        jail = source._jail  # type: ignore[attr-defined]
        assert jail.walls is not None
    assert not jail.scratch.exists()
