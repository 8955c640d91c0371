"""Commands without standard output, descriptors, memory, room or patience: one line, and nothing left."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator import cli
from orchestrator.errors import OutputError
from orchestrator.shared.isolation.archives import unpack
from tests.support.c_fmu import build_c_fmu, have_compiler, write_fmu

ROOT = Path(__file__).parents[2]
SCENARIO = """
stop = 0.1
record = ["slave.x"]
[master]
algorithm = "jacobi"
step = 0.01
[instances.slave]
fmu = "MassSpring.fmu"
"""


def shell(folder: Path, line: str) -> "subprocess.CompletedProcess[str]":
    (folder / "temporary").mkdir()
    write_fmu(folder / "a.fmu", {"modelDescription.xml": b"<x/>"})
    if "scenario.toml" in line:
        build_c_fmu(folder)
        (folder / "scenario.toml").write_text(SCENARIO)
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    environment = kept | {"PYTHONPATH": str(ROOT), "TMPDIR": str(folder / "temporary"), "PY": sys.executable}
    return subprocess.run(
        ["bash", "-c", line], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("line", "codes"),
    [
        ("$PY -m orchestrator report no-such-folder >&-", {2}),
        ("$PY -m orchestrator report no-such-folder 2>&-", {2}),
        ("$PY -m orchestrator --version >&- 2>&-", {0}),
        ("$PY -m orchestrator check --static a.fmu > /dev/full", {1}),
        ("$PY -m orchestrator --help > /dev/full", {1}),
        ("$PY -m orchestrator --help | true; exit ${PIPESTATUS[0]}", {0, 1}),
        # An FMU of others, since without a cache nothing is compiled before: our own take a minute then.
        ("HOME=/proc XDG_CACHE_HOME= $PY -m orchestrator simulate --scenario scenario.toml --out out", {0}),
        (
            "env -u HOME XDG_CACHE_HOME=/dev/null/none $PY -m orchestrator simulate --scenario scenario.toml --out out",
            {0},
        ),
        ("ulimit -n 16; $PY -m orchestrator simulate --out out", {0, 1}),
    ],
)
def test_one_line_at_most_and_no_traceback(tmp_path: Path, line: str, codes: set[int]) -> None:
    if "scenario.toml" in line and not have_compiler():
        pytest.skip("there is no C compiler")
    done = shell(tmp_path, line)
    assert done.returncode in codes, done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) <= 1, done.stderr
    assert not list((tmp_path / "temporary").glob("*"))
    assert not list(tmp_path.glob("out/.partial-*"))


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [("KeyboardInterrupt()", 130, "interrupted\n"), ("OSError(24, 'Too many open files')", 1, "error: "),
     ("MemoryError()", 1, "error: out of memory\n"), ("ImportError('libx.so: cannot map')", 1, "error: libx.so")],
)  # fmt: skip
def test_what_happens_while_modules_are_loaded(tmp_path: Path, error: str, code: int, text: str) -> None:
    program = f"""
import sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "orchestrator.commands.simulate":
            raise {error}
sys.meta_path.insert(0, Finder())
sys.argv = ["orchestrator", "simulate"]
from orchestrator.__main__ import run
run()
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert done.stderr.startswith(text)
    assert done.stderr.count("\n") == 1


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")
@pytest.mark.parametrize("asked", ["", "3"])
def test_libraries_of_matrices_start_no_thread_that_nobody_asked_for(tmp_path: Path, asked: str) -> None:
    (tmp_path / "counter.py").write_text("""
import os
def main():
    import scipy.linalg
    limits = (os.environ[f"{name}_NUM_THREADS"] for name in ("OMP", "OPENBLAS", "MKL"))
    print(len(os.listdir("/proc/self/task")), *limits)
    return 0
""")
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    environment |= {"PYTHONPATH": os.pathsep.join([str(ROOT), str(tmp_path)])}
    environment |= {"OMP_NUM_THREADS": asked} if asked else {}
    words = [sys.executable, "-c", "from orchestrator.__main__ import run; run('counter')"]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["1", asked or "1", "1", "1"]


@pytest.mark.parametrize("error", [MemoryError(), OSError(24, "Too many open files")])
def test_what_happens_while_a_command_runs(error: BaseException, monkeypatch, capsys, tmp_path: Path) -> None:
    def run(_: object) -> int:
        raise error

    monkeypatch.setattr("orchestrator.commands.report.run", run)
    assert cli.main(["report", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert said.count("\n") == 1


def test_a_full_temporary_directory_is_named_and_not_the_archive(tmp_path: Path) -> None:
    path = write_fmu(tmp_path / "a.fmu", {"large": os.urandom(1 << 16)})
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 12, hard))
    try:
        with pytest.raises(OutputError, match=rf"must be unpacked to {tmp_path}, but cannot be: File too large"):
            unpack(path, tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [p.name for p in tmp_path.iterdir()] == ["a.fmu"]
