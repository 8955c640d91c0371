"""Result directories: whole or not at all, whatever happens."""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from orchestrator import __version__
from orchestrator.errors import OutputError
from orchestrator.shared.output import stage_output, write_result, write_whole

ROOT = Path(__file__).resolve().parents[2]


def test_files_appear_together_at_the_end(tmp_path):
    with stage_output(tmp_path / "out") as directory:
        (directory / "a.txt").write_text("a")
        assert not (tmp_path / "out" / "a.txt").exists()
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["a.txt"]


def test_an_error_leaves_nothing(tmp_path):
    def fail():
        with stage_output(tmp_path / "x" / "out") as directory:
            (directory / "a.txt").write_text("a")
            raise ValueError("bad")

    with pytest.raises(ValueError, match="bad"):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    def fill():
        with stage_output(tmp_path / "out") as folder, (folder / "a").open("wb", buffering=0) as stream:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 12, hard))
            while True:
                stream.write(bytes(1 << 12))

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with pytest.raises(OutputError, match=f"cannot write to {tmp_path / 'out'}: File too large"):
            fill()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_elsewhere_is_not_blamed_on_the_results(tmp_path):
    with pytest.raises(OSError, match="No space left on device"), stage_output(tmp_path / "out"):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_a_killed_process_had_begun_is_cleared_away(tmp_path):
    code = (
        "import os, signal; from pathlib import Path; from orchestrator.shared.output import write_whole\n"
        "os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        f"write_whole(Path({str(tmp_path / 'a.txt')!r}), 'new')"
    )
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False)
    assert len(list(tmp_path.iterdir())) == 1
    write_whole(tmp_path / "b.txt", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["b.txt"]


def test_what_a_killed_process_left_is_cleared_away(tmp_path):
    code = (
        "import os, signal, sys; from pathlib import Path; from orchestrator.shared.output import stage_output\n"
        f"with stage_output(Path({str(tmp_path / 'out')!r})) as d:\n    (d / 'a').write_text('a')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False)
    out = tmp_path / "out"
    assert len(list(tmp_path.iterdir())) == 2
    with stage_output(out) as mine, stage_output(out) as other:
        assert sorted(tmp_path.iterdir()) == sorted([mine, other, out])
    assert list(tmp_path.iterdir()) == [out]


KILLED_AT_EACH_CALL = """
import json, os, signal, sys
from pathlib import Path
from orchestrator.shared import output
from orchestrator.shared.stopping import stop_on_signals

out, here, number = Path(sys.argv[1]), sys.argv[2], getattr(signal, sys.argv[3])
CALLS = ("os.link", "os.mkdir", "os.rename", "os.utime", "os.chmod", "os.remove", "os.rmdir", "ctypes.call_function")
seen, signals_at = 0, 0

def hook(event, arguments):
    global seen
    if signals_at and event.startswith(CALLS):
        seen += 1
        if seen == signals_at:
            os.kill(os.getpid(), number)

def publish(content, names):
    with output.stage_output(out, ("gone",)) as folder:
        for name in names:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(content)

def state():
    return {p.relative_to(out).as_posix(): p.read_text() for p in sorted(out.rglob("*")) if p.is_file()}

out.mkdir()
if here == "inside":
    os.chdir(out)
(out / "journal").write_text("kept")
sys.addaudithook(hook)
states = []
for n in range(1, 60):
    publish("old", ("a", "b", "deep/c", "gone"))
    child = os.fork()
    if not child:
        stop_on_signals()
        signals_at = n
        try:
            publish("new", ("a", "b", "deep/c", "deep/d"))
        except KeyboardInterrupt:
            os._exit(3)
        os._exit(0)
    states.append((os.waitpid(child, 0)[1], state()))
    publish("next", ("a",))
    left = [p.name for folder in (out, out.parent) for p in folder.iterdir() if p.name.startswith(".")]
    assert left == [], left
    if states[-1][0] == 0 and states[-1][1].get("a") == "new":
        break
print(json.dumps(states))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="folders are exchanged on Linux")
@pytest.mark.parametrize("ending", ["SIGKILL", "SIGTERM", "SIGINT"])
def test_whatever_a_signal_interrupts_the_result_is_the_old_one_or_the_new_one(ending: str, tmp_path: Path) -> None:
    words = [sys.executable, "-c", KILLED_AT_EACH_CALL, str(tmp_path / "out"), "beside", ending]
    done = subprocess.run(words, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True)
    states = json.loads(done.stdout)
    old = {"a": "old", "b": "old", "deep/c": "old", "gone": "old", "journal": "kept"}
    new = {"a": "new", "b": "new", "deep/c": "new", "deep/d": "new", "journal": "kept"}
    # `d` is of no result that follows: a file in a folder that nothing replaces stays.
    seen = [{name: text for name, text in state.items() if (name, text) != ("deep/d", "new") or state["a"] == "new"}
            for _, state in states]  # fmt: skip
    assert all(state in (old, new) for state in seen)
    assert len(seen) > 8
    assert seen[0] == old
    assert seen[-1] == new
    assert states[0][0] != 0


@pytest.mark.parametrize("ending", ["SIGTERM", "SIGINT"])
def test_a_folder_that_one_works_in_stays_and_signals_wait_until_it_is_whole(ending: str, tmp_path: Path) -> None:
    words = [sys.executable, "-c", KILLED_AT_EACH_CALL, str(tmp_path / "out"), "inside", ending]
    done = subprocess.run(words, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True)
    contents = [{state[name] for name in ("a", "b", "deep/c")} for _, state in json.loads(done.stdout)]
    assert all(len(content) == 1 for content in contents)
    assert {"old"} in contents
    assert {"new"} in contents


@pytest.mark.skipif(sys.platform != "linux", reason="folders are exchanged on Linux")
def test_of_two_commands_at_once_a_reader_sees_one_whole_result(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from orchestrator.shared.output import stage_output\n"
        f"for n in range(100):\n    with stage_output(Path({str(tmp_path / 'out')!r})) as d:\n"
        "        for name in 'abcdef': (d / name).write_text(sys.argv[1] + str(n))"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    both = [subprocess.Popen([sys.executable, "-c", code, word], env=environment) for word in ("x", "y")]
    seen = set()
    while any(process.poll() is None for process in both):
        try:
            folder = os.open(tmp_path / "out", os.O_RDONLY)
        except FileNotFoundError:
            continue
        try:
            texts = {Path(f"/proc/self/fd/{folder}/{name}").read_text() for name in "abcdef"}
        except FileNotFoundError:  # an older one, that is being removed
            continue
        finally:
            os.close(folder)
        assert len(texts) == 1
        seen |= texts
    assert [process.returncode for process in both] == [0, 0]
    assert len(seen) > 2
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert len({(tmp_path / "out" / name).read_text() for name in "abcdef"}) == 1


def test_a_folder_with_more_than_a_result_stays_the_folder_that_it_is(tmp_path: Path) -> None:
    out = tmp_path / "home"
    out.mkdir()
    (out / "link").symlink_to(tmp_path)
    number = out.stat().st_ino
    with stage_output(out) as folder:
        (folder / "a").write_text("a")
    assert out.stat().st_ino == number
    assert sorted(p.name for p in out.iterdir()) == ["a", "link"]
    (out / "link").unlink()
    with stage_output(out) as folder:
        (folder / "b").write_text("b")
    assert out.stat().st_ino != number
    assert sorted(p.name for p in out.iterdir()) == ["a", "b"]
    assert out.stat().st_mode & 0o777 == 0o777 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_text_is_replaced_at_once_and_never_seen_in_part(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    path.write_text("old")
    replaced = []
    replace = os.replace

    def watched(source, target):
        # Until the very last step the old text stands, and the new one is complete beside it.
        replaced.append((Path(target), path.read_text(), Path(source).read_text(), Path(source).parent))
        replace(source, target)

    monkeypatch.setattr(os, "replace", watched)
    write_whole(path, "new" * 10_000)
    assert replaced == [(path, "old", "new" * 10_000, tmp_path)]
    assert path.read_text() == "new" * 10_000
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_text_that_cannot_be_written_leaves_the_old_one_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError):
        write_whole(path, "x\ud800")

    def broken(source, target):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "replace", broken)
    with pytest.raises(OSError, match="Input/output"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_neither_links_nor_long_names_lead_elsewhere(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    # Also where somebody could know what is taken by chance.
    monkeypatch.setattr("orchestrator.shared.publishing.secrets.token_hex", lambda count: "0" * 2 * count)
    (tmp_path / f".partial-{os.getpid()}-0000000000000000").symlink_to(victim)
    with pytest.raises(FileExistsError):
        write_whole(tmp_path / "a.txt", "new")
    (tmp_path / f".partial-{os.getpid()}-0000000000000000").unlink()
    (tmp_path / "b.txt").symlink_to(victim)
    write_whole(tmp_path / "b.txt", "new")
    assert (tmp_path / "b.txt").read_text() == "new"
    assert not (tmp_path / "b.txt").is_symlink()
    assert victim.read_text() == "precious"
    for long in ("x" * 250, "\u00e9" * 125):
        write_whole(tmp_path / long, b"new")
        assert (tmp_path / long).read_bytes() == b"new"


@pytest.mark.parametrize("mask", [0o022, 0o027, 0o077])
def test_a_file_may_be_read_by_whom_the_umask_says(tmp_path, mask):
    before = os.umask(mask)
    try:
        write_whole(tmp_path / "a", "x")
    finally:
        os.umask(before)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o666 & ~mask


def test_results_are_published_with_their_folders_and_replace_old_ones(tmp_path):
    out = tmp_path / "out"
    (out / "deep").mkdir(parents=True)
    (out / "deep" / "a.txt").write_text("old")
    (out / "kept.txt").write_text("kept")
    with stage_output(out) as directory:
        (directory / "deep" / "er").mkdir(parents=True)
        (directory / "deep" / "a.txt").write_text("new")
        (directory / "deep" / "er" / "b.txt").write_text("b")
        assert (out / "deep" / "a.txt").read_text() == "old"
    assert (out / "deep" / "a.txt").read_text() == "new"
    assert (out / "deep" / "er" / "b.txt").read_text() == "b"
    assert sorted(p.name for p in out.iterdir()) == ["deep", "kept.txt"]


def test_an_error_keeps_directories_that_were_there(tmp_path):
    (tmp_path / "there").mkdir()
    with pytest.raises(KeyError), stage_output(tmp_path / "there" / "a" / "b"):
        raise KeyError
    assert [p.name for p in tmp_path.iterdir()] == ["there"]
    assert list((tmp_path / "there").iterdir()) == []


def test_errors_of_other_files_are_not_said_to_be_of_the_output(tmp_path):
    with pytest.raises(FileNotFoundError), stage_output(tmp_path / "out"):
        raise FileNotFoundError(2, "No such file or directory", "/elsewhere/x")
    with pytest.raises(OutputError, match="cannot write to"), stage_output(tmp_path / "out") as directory:
        (directory / "missing" / "a.txt").write_text("a")


def test_what_cannot_be_a_directory_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="must be a writable directory"), stage_output(tmp_path / "file" / "out"):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_results_are_plain_json(tmp_path):
    values = {
        "a": np.float64(1.5),
        "b": np.array([1, 2]),
        "c": float("nan"),
        "d": (True, None, "x"),
        "e": Path("p"),
        3: 4,
    }
    path = write_result(tmp_path, "test", {"x": 1}, 7, values)
    assert path == tmp_path / "test.json"
    found = json.loads(path.read_text())
    assert found["results"] == {"a": 1.5, "b": [1, 2], "c": None, "d": [True, None, "x"], "e": "p", "3": 4}
    assert (found["command"], found["seed"], found["arguments"]) == ("test", 7, {"x": 1})
    assert found["version"] == __version__


def test_a_staging_directory_that_is_gone_hides_no_error(tmp_path):
    def fail():
        with stage_output(tmp_path / "out") as directory:
            directory.rmdir()
            raise ValueError("bad")

    with pytest.raises(ValueError, match="bad"):
        fail()
    assert list(tmp_path.iterdir()) == []
