"""A slave written by the documentation alone becomes a native FMU; what is outside the subset is refused."""

import json
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.building import build
from orchestrator.building.compilers import find_compiler

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")

RUN = """
import json, sys
from fmpy import simulate_fmu
r = simulate_fmu(sys.argv[1], stop_time=1.0, output_interval=0.01, start_values={"u": 2.0, "T": 0.25}, output=["y"])
print(json.dumps([list(map(float, row)) for row in r]))
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project with the slave of the documentation."""
    copy = tmp_path_factory.mktemp("project")
    for package in ("orchestrator", "pyfmu_sources"):
        shutil.copytree(build.ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    page = (build.ROOT / "docs" / "native.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(\"\"\"The FMU ``LowPass``.*?)```", page, re.DOTALL)
    assert code is not None
    assert len(code[1].splitlines()) <= 50
    (copy / "pyfmu_sources" / "controllers" / "low_pass_slave.py").write_text(code[1], encoding="utf-8")
    return copy


def run(project: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(project)}
    command = [sys.executable, *words]
    return subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)


def build_native(project: Path, name: str) -> subprocess.CompletedProcess[str]:
    words = ("build", "--native", name, "--platforms", "here", "--out", "native")
    return run(project, "-m", "orchestrator", *words)


def require_lag(project: Path, fmu: Path) -> None:
    rows = json.loads(run(project, "-c", RUN, str(fmu)).stdout)
    assert len(rows) == 101
    for time, y in rows:
        assert y == pytest.approx(2.0 * (1.0 - math.exp(-time / 0.25)), abs=1e-12)


def test_a_slave_of_forty_lines_is_native_in_one_command(project: Path) -> None:
    built = build_native(project, "LowPass")
    assert built.returncode == 0, built.stderr
    fmu = project / "native" / "LowPass.fmu"
    require_lag(project, fmu)
    checked = run(project, "-m", "orchestrator", "check", str(fmu), "--out", "checked")
    assert "no findings" in checked.stdout, checked.stdout


NAMES = '''
_share = 2.0


class Reference(NamedTuple):
    """As a type of the runtime is called."""

    OK: float
    faded: float


def _faded(time: float) -> Reference:
    return Reference(_share, exp(-time))


def filtered('''
CLASHES = """    share = _share
    NAN = step / time_constant
    faded = _faded(NAN).faded
    lesser = min(faded, 1.0)
    return u + (y - u) * lesser * share / _share
"""


def test_locals_and_types_may_be_called_as_the_c_around_them_calls_others(project: Path) -> None:
    text = (project / "pyfmu_sources" / "controllers" / "low_pass_slave.py").read_text(encoding="utf-8")
    text = text.replace("LowPass", "Clashes").replace("import ClassVar", "import ClassVar, NamedTuple")
    text = text.replace("    return u + (y - u) * exp(-step / time_constant)\n", CLASHES)
    text = text.replace("\ndef filtered(", NAMES)
    (project / "pyfmu_sources" / "controllers" / "clashes_slave.py").write_text(text, encoding="utf-8")
    built = build_native(project, "Clashes")
    assert built.returncode == 0, built.stderr
    require_lag(project, project / "native" / "Clashes.fmu")


@pytest.mark.parametrize("native", [[], ["--native", "--platforms", "here"]])
@pytest.mark.parametrize("name", ["_stop", "real", "advance"])
def test_hidden_state_must_not_be_called_as_what_every_slave_has(project: Path, name: str, native: list[str]) -> None:
    text = (project / "pyfmu_sources" / "controllers" / "low_pass_slave.py").read_text(encoding="utf-8")
    other = project / "pyfmu_sources" / "controllers" / "odd_slave.py"
    other.write_text(text.replace("    _y: float", f"    _y: float\n    {name}: float").replace("LowPass", "Odd"))
    try:
        built = run(project, "-m", "orchestrator", "build", *native, "Odd", "--out", "x")
    finally:
        other.unlink()
    assert built.returncode == 2
    assert f"`{name}` of Odd must be a name of its own" in built.stderr
    assert "Traceback" not in built.stderr


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("    return {1.0: u}[1.0]", "is outside the subset"),
        ("    return [y, u][0]", "a list must be assigned to a variable of declared type"),
        ("    return (u - y) ** 2", "squares and cubes must be written as products"),
        ("    while y < u:\n        y += step\n    return None", "a value must be"),
        ("    z = y\n    z = (y, u)\n    return y", "must keep its type"),
        ("    import os\n    return float(len(os.sep))", "is outside the subset"),
        ("    return filtered(y, u, time_constant, step)", "must not call itself"),
        (
            "    for n in MANY:\n        if n > u:\n            break\n    return y\n\n\nMANY = (1, 2)",
            "no way out of it",
        ),
        ("    if y > u:\n        return y", "must end with `return` on every path"),
        ("    for n in range(3):\n        y += n\n    n = 5\n    return n * y", "`n` is the variable of a loop"),
        ("    for n in range(3):\n        n += 1\n    return y", "`n` is the variable of a loop"),
    ],
)
def test_what_is_outside_the_subset_is_refused_with_file_and_line(project: Path, line: str, message: str) -> None:
    source = project / "pyfmu_sources" / "controllers" / "low_pass_slave.py"
    text = source.read_text(encoding="utf-8")
    other = project / "pyfmu_sources" / "controllers" / "odd_slave.py"
    changed = text.replace("    return u + (y - u) * exp(-step / time_constant)", line).replace("LowPass", "Odd")
    assert changed != text.replace("LowPass", "Odd")
    other.write_text(changed, encoding="utf-8")
    try:
        built = run(project, "-m", "orchestrator", "build", "--native", "Odd", "--platforms", "here", "--out", "x")
    finally:
        other.unlink()
    assert built.returncode == 2
    assert message in built.stderr
    assert re.search(r"odd_slave\.py:\d+: ", built.stderr)
    assert "Traceback" not in built.stderr
