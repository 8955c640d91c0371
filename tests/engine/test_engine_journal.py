"""The durable store: what survives damage, and what it refuses."""

import io
import json
import math
import os
import socket
import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.engine import Outcome, Status
from orchestrator.engine import journal as journal_module
from orchestrator.engine.journal import Journal
from orchestrator.errors import OutputError, ScenarioError

DEFINITION = {"cases": {"seed": 1}, "version": "x"}


def outcomes(indices):
    return [Outcome(i, Status.DONE, "", (i / 7.0, f"s{i}", None)) for i in indices]


def filled(path, indices=range(5), total=10):
    with Journal(path, DEFINITION, total, resume=False) as journal:
        journal.append(outcomes(indices))
    return path


def test_outcomes_come_back_in_case_order_and_exactly(tmp_path):
    with Journal(tmp_path / "j", DEFINITION, 10, resume=False) as journal:
        journal.append(outcomes([7, 2]))
        journal.append([Outcome(4, Status.CRASH, "the worker died"), *outcomes([0])])
        found = list(journal.outcomes())
        assert [o.index for o in found] == [0, 2, 4, 7]
        assert found[1] == outcomes([2])[0]
        assert found[2] == Outcome(4, Status.CRASH, "the worker died")
        assert (journal.done, journal.failed) == (4, 1)


def test_every_appended_case_is_in_the_file_before_append_returns(tmp_path):
    with Journal(tmp_path / "j", DEFINITION, 10, resume=False) as journal:
        journal.append(outcomes([3]))
        assert (tmp_path / "j").read_bytes().count(b"\n") == 2


def test_an_appended_case_survives_a_power_cut(tmp_path, monkeypatch):
    synced = []
    fsync = os.fsync

    def watched(descriptor):
        fsync(descriptor)
        synced.append((tmp_path / "j").stat().st_size)

    with Journal(tmp_path / "j", DEFINITION, 10, resume=False) as journal:
        monkeypatch.setattr(os, "fsync", watched)
        for index in range(3):
            journal.append(outcomes([index]))
            assert synced[-1] == (tmp_path / "j").stat().st_size
        assert len(synced) == 3


def test_a_case_is_recorded_once(tmp_path):
    with Journal(tmp_path / "j", DEFINITION, 10, resume=False) as journal:
        journal.append(outcomes([3]))
        journal.append([Outcome(3, Status.ERROR, "again")])
        assert list(journal.outcomes()) == outcomes([3])


@settings(max_examples=60)
@given(cut=st.integers(0, 400))
def test_a_file_cut_anywhere_keeps_every_whole_line(cut, tmp_path_factory):
    path = filled(tmp_path_factory.mktemp("j") / "j")
    content = path.read_bytes()
    path.write_bytes(content[:cut])
    whole = max(0, content[:cut].count(b"\n") - 1)
    with Journal(path, DEFINITION, 10, resume=True) as journal:
        assert journal.done == whole
        journal.append(outcomes(range(10)))
        assert list(journal.outcomes()) == outcomes(range(10))


@settings(max_examples=60)
@given(data=st.data())
def test_a_changed_byte_loses_at_most_its_own_line(data, tmp_path_factory):
    path = filled(tmp_path_factory.mktemp("j") / "j")
    content = bytearray(path.read_bytes())
    first = content.index(b"\n") + 1
    place = data.draw(st.integers(first, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    with Journal(path, DEFINITION, 10, resume=True) as journal:
        assert journal.done >= 3
        journal.append(outcomes(range(10)))
        assert list(journal.outcomes()) == outcomes(range(10))


def test_another_sweeps_journal_is_refused_and_told_apart(tmp_path):
    path = filled(tmp_path / "j")
    before = path.read_bytes()
    with pytest.raises(ScenarioError, match="differs in: cases"):
        Journal(path, DEFINITION | {"cases": {"seed": 2}}, 10, resume=True)
    for total in (3, 11):
        with pytest.raises(ScenarioError, match="differs in: cases"):
            Journal(path, DEFINITION, total, resume=True)
    with pytest.raises(ScenarioError, match=r"unfinished sweep \(5 of 10 cases\): go on with `resume`"):
        Journal(path, DEFINITION, 10, resume=False)
    assert path.read_bytes() == before


def test_what_is_no_journal_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "j"
    path.write_text("precious\n")
    for resume in (False, True):
        with pytest.raises(ScenarioError, match="is not"):
            Journal(path, DEFINITION, 10, resume=resume)
    assert path.read_text() == "precious\n"


def test_two_runs_cannot_share_a_journal(tmp_path):
    with Journal(tmp_path / "j", DEFINITION, 10, resume=False) as journal:
        journal.append(outcomes([1]))
        with pytest.raises(ScenarioError, match="another is running"):
            Journal(tmp_path / "j", DEFINITION, 10, resume=True)


def test_a_discarded_journal_is_gone_and_its_file_closed(tmp_path):
    before = len(os.listdir("/proc/self/fd"))
    journal = Journal(tmp_path / "j", DEFINITION, 10, resume=False)
    journal.append(outcomes([1]))
    journal.discard()
    assert not list(tmp_path.iterdir())
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_journal_is_discarded_after_it_was_closed(tmp_path):
    with Journal(tmp_path / "j", DEFINITION, 10, resume=False) as journal:
        journal.append(outcomes([1]))
    assert list(tmp_path.iterdir())
    journal.discard()
    assert not list(tmp_path.iterdir())


def test_nothing_is_left_of_a_journal_without_cases(tmp_path):
    with Journal(tmp_path / "a" / "b" / "j", DEFINITION, 10, resume=False):
        assert (tmp_path / "a" / "b" / "j").exists()
    assert list(tmp_path.iterdir()) == []


def test_resuming_nothing_starts_from_the_beginning(tmp_path):
    with Journal(tmp_path / "j", DEFINITION, 10, resume=True) as journal:
        assert journal.done == 0


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file"):
        Journal(tmp_path / "file" / "j", DEFINITION, 10, resume=False)


def test_a_disk_that_is_full_from_the_start_leaves_nothing(tmp_path, monkeypatch):
    def full(descriptor, data, offset):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(journal_module, "write_at", full)
    with pytest.raises(OutputError, match="0 of 10 cases"):
        Journal(tmp_path / "out" / "j", DEFINITION, 10, resume=False)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_lines_before_it(tmp_path, monkeypatch):
    write = journal_module.write_at

    def half_then_full(descriptor, data, offset):
        if len(data) > 20:
            return write(descriptor, data[:20], offset)
        raise OSError(28, "No space left on device")

    with Journal(tmp_path / "j", DEFINITION, 10, resume=False) as journal:
        journal.append(outcomes([0, 1]))
        before = (tmp_path / "j").read_bytes()
        monkeypatch.setattr(journal_module, "write_at", half_then_full)
        with pytest.raises(OutputError, match="No space left on device; 2 of 10 cases are kept"):
            journal.append(outcomes([2]))
        monkeypatch.undo()
        assert (tmp_path / "j").read_bytes() == before
        journal.append(outcomes([2]))
        assert list(journal.outcomes()) == outcomes([0, 1, 2])


def test_the_definition_may_be_any_json(tmp_path):
    definition = {"numbers": [1, 2.5, math.pi], "nested": {"b": None, "a": True}, "tuple": (1, 2)}
    with Journal(tmp_path / "j", definition, 3, resume=False) as journal:
        journal.append(outcomes([0]))
    with Journal(tmp_path / "j", json.loads(json.dumps(definition)), 3, resume=True) as journal:
        assert journal.done == 1


@pytest.mark.parametrize("kind", ["link", "dangling link", "hard link", "fifo", "folder", "socket"])
def test_what_is_no_plain_file_is_refused_and_left_alone(tmp_path, kind):
    target, path = tmp_path / "precious", tmp_path / "j"
    if kind != "dangling link":
        target.write_text("")
    match kind:
        case "fifo":
            os.mkfifo(path)
        case "folder":
            path.mkdir()
        case "socket":
            with socket.socket(socket.AF_UNIX) as server:
                server.bind(str(path))
        case "hard link":
            path.hardlink_to(target)
        case _:
            path.symlink_to(target)
    with pytest.raises(ScenarioError, match=r"must be the journal of a sweep, but is no plain file"):
        Journal(path, {}, 3, resume=False)
    assert target.exists() == (kind != "dangling link")
    assert not target.exists() or target.read_text() == ""


@pytest.mark.parametrize(
    "entry",
    [
        [], [0], ["0", "done", "", []], [7, "done", "", []], [-1, "done", "", []], [0, "well", "", []], {"a": 1}, 5,
        [0, "done", "", [[]]],
    ],
)  # fmt: skip
def test_lines_with_a_good_checksum_that_are_no_cases_are_left_out(tmp_path, entry):
    path = tmp_path / "j"
    with Journal(path, {}, 3, resume=False) as journal:
        journal.append([Outcome(1, Status.DONE, "", (1.0,))])
    text = json.dumps(entry)
    with path.open("a") as stream:
        stream.write(f"{zlib.crc32(text.encode()):08x} {text}\n")
    with Journal(path, {}, 3, resume=True) as journal:
        assert journal.done == 1
        assert [o.index for o in journal.outcomes()] == [1]


@pytest.mark.parametrize("header", ['{"format": "backlash-cosim journal 1"}', "[" * 100_000, "7"])
def test_wrong_headers_are_refused(tmp_path, header):
    path = tmp_path / "j"
    path.write_text(f"{zlib.crc32(header.encode()):08x} {header}\n")
    with pytest.raises(ScenarioError, match="must be the journal of a sweep, but is not"):
        Journal(path, {}, 3, resume=True)


def test_a_name_that_no_file_can_have_leaves_no_directory(tmp_path):
    with pytest.raises(OutputError, match=r"cannot write .* too long"):
        Journal(tmp_path / "a" / "b" / ("x" * 300), DEFINITION, 10, resume=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("whole", [0, 3])
def test_what_a_crash_left_torn_is_cut_off_before_anything_is_added(tmp_path, whole):
    """A torn piece may be longer than all that is written over it."""
    path = filled(tmp_path / "j", range(2))
    lines = path.read_bytes().splitlines(keepends=True)[:whole]
    path.write_bytes(b"".join(lines) + b"x" * 4096)
    with Journal(path, DEFINITION, 10, resume=True) as journal:
        kept = path.read_bytes()
        assert kept.count(b"\n") == max(1, whole)
        assert b"x" * 9 not in kept
        journal.append(outcomes([7]))
        assert path.read_bytes().startswith(kept)


def test_a_disk_without_room_for_the_offsets_is_said_in_words(tmp_path, monkeypatch):
    """Eight bytes per case are written before they are mapped: a mapped file that cannot grow ends the process."""
    written = []

    class FullDisk(io.BytesIO):
        def write(self, data):
            written.append(bytes(data))
            return super().write(data)

        def flush(self):
            raise OSError(28, "No space left on device")

    with Journal(tmp_path / "j", DEFINITION, 10, resume=False) as journal:
        journal.append(outcomes([1]))
        monkeypatch.setattr(journal_module.tempfile, "TemporaryFile", lambda **_: FullDisk())
        with pytest.raises(OutputError, match="No space left on device; 1 of 10 cases are kept"):
            list(journal.outcomes())
    assert written == [bytes(80)]
