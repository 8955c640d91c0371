"""Libraries that read binary formats run in a child process: a file that ends them ends nothing else."""

from pathlib import Path
from typing import Any

import pytest
import scipy.io

from orchestrator.cli import main
from orchestrator.errors import RecordError
from orchestrator.records.formats import apart, open_source
from orchestrator.records.record import read_record
from orchestrator.shared.isolation.jail import Jail


def _good_file(folder: Path) -> Path:
    path = folder / "log.mat"
    scipy.io.savemat(path, {"time": [0.0, 0.5, 1.0], "u": [1.0, 2.0, 3.0], "theta_m": [0.0, 0.5, 0.25]})
    return path


@pytest.mark.parametrize("when", ["open", "load"])
def test_a_file_that_ends_its_reader_is_refused_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    path = _good_file(tmp_path)

    def jail(entry: str, *arguments: Any, **settings: Any) -> Jail:
        assert entry == "orchestrator.records.formats.apart:reader"
        return Jail(f"tests.support.reader_that_ends:reader_at_{when}", *arguments, **settings)

    monkeypatch.setattr(apart, "Jail", jail)
    with pytest.raises(RecordError, match=r"log\.mat: must be a whole MAT file, but cannot be read: .*export it again"):
        read_record(path)
    assert main(["inspect", str(path), "--out", str(tmp_path / "out")]) == 2
    complaint = capfd.readouterr().err.strip()
    assert complaint.startswith("error:")
    assert str(path) in complaint.replace("\n", "")
    assert not (tmp_path / "out").exists()


def test_messages_name_the_file_as_the_user_did(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("short.mat").write_bytes(_good_file(tmp_path).read_bytes()[:200])
    with pytest.raises(RecordError, match=r"^short\.mat: must be a whole MAT file"):
        read_record(Path("short.mat"))


def test_the_reader_ends_with_the_statement(tmp_path: Path) -> None:
    with open_source(_good_file(tmp_path)) as source:
        names = [head.name for head in source.heads]
        assert source.load([names.index("theta_m")])[0].tolist() == [0.0, 0.5, 0.25]
        jail = source._jail  # type: ignore[attr-defined]
        assert jail.walls is not None
    assert not jail.scratch.exists()
