"""Equations in a package within the sources reach every kind of FMU and kernels; others are refused."""

import json
import math
import re
import shutil
import sys
from pathlib import Path

import pytest

from orchestrator.building.compilers import find_compiler
from orchestrator.errors import FmuError
from orchestrator.shared import equation_files
from tests.support.copies import ROOT, copy_project, run_in_copy

SHAPES = {
    "__init__.py": '"""Shapes."""\n',
    "decay.py": (
        '"""Decay."""\n\nfrom math import exp\n\nfrom ..hybrid.event_numbers import NO_EVENT\n\n\n'
        "def share_left(step: float, time_constant: float) -> float:\n"
        '    """Return what is left of a distance after a ``step`` [s]."""\n'
        "    return exp(-step / time_constant) + float(NO_EVENT - NO_EVENT)\n"
    ),
    "filters.py": (
        '"""Filters."""\n\nfrom .decay import share_left\n\n\n'
        "def filtered(y: float, u: float, time_constant: float, step: float) -> float:\n"
        '    """Return the output after a ``step`` [s]."""\n'
        "    return u + (y - u) * share_left(step, time_constant)\n"
    ),
}
BUILD = """
import json
from pathlib import Path
from fmpy import simulate_fmu
from orchestrator.building.build import ensure_built
from orchestrator.building.native_build import ensure_native
from orchestrator.building.translation.kernels import Kernels
paths = [make(["LowPass"], Path(folder))["LowPass"] for make, folder in MAKERS]
kept = dict(stop_time=0.5, output_interval=0.01, start_values={"u": 2.0, "T": 0.25}, output=["y"])
ends = [float(simulate_fmu(str(path), **kept)["y"][-1]) for path in paths]
print(json.dumps([*ends, Kernels("low_pass").final(0.0, 2.0, 0.25, 0.5)]))
"""
KERNEL = """
from pyfmu_sources.shapes.filters import filtered
__all__ = ["final"]
def final(y: float, u: float, time_constant: float, step: float) -> float:
    return filtered(y, u, time_constant, step)
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of the project with the slave of the documentation, whose equations lie in a package."""
    copy_project(tmp_path)
    page = (ROOT / "docs" / "native.md").read_text(encoding="utf-8")
    found = re.search(r"```python\n(\"\"\"The FMU ``LowPass``.*?)```", page, re.DOTALL)
    assert found is not None
    code, count = re.subn(r"\n\ndef filtered\(.*?\n\n\n", "\n\n", found[1], flags=re.DOTALL)
    assert count == 1
    code = code.replace("from math import exp\n", "").replace(
        "from ..adapters.slave_base", "from ..shapes.filters import filtered\nfrom ..adapters.slave_base"
    )
    (tmp_path / "pyfmu_sources" / "controllers" / "low_pass_slave.py").write_text(code, encoding="utf-8")
    (tmp_path / "low_pass.py").write_text(KERNEL, encoding="utf-8")
    for name, text in SHAPES.items():
        (tmp_path / "pyfmu_sources" / "shapes").mkdir(exist_ok=True)
        (tmp_path / "pyfmu_sources" / "shapes" / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.skipif(find_compiler(here=True) is None or sys.platform != "linux", reason="no C compiler, or not Linux")
def test_equations_in_a_package_run_in_every_kind_of_fmu(project: Path) -> None:
    makers = '[(ensure_built, "a"), (lambda n, f: ensure_native(n, f, here=True), "b")]'
    ends = json.loads(run_in_copy(BUILD.replace("MAKERS", makers), project))
    assert ends == [pytest.approx(2.0 * (1.0 - math.exp(-2.0)), abs=1e-12)] * 3


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("from .shapes.filter import filtered", "filter.py"),
        ("from .shapes import filter", "filter.py"),
        ("from .shape.filters import filtered", "filters.py"),
        ("from . import shapes_", "shapes_.py"),
        ("from ..orchestrator.errors import FmuError", "errors.py"),
        ("from pyfmu_sources.shapes.filters import filtered", "must be relative"),
        ("import pyfmu_sources.shapes.filters", "must be relative"),
    ],
)
def test_an_import_that_an_fmu_could_not_follow_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, name: str
) -> None:
    shutil.copytree(ROOT / "pyfmu_sources", tmp_path / "pyfmu_sources")
    monkeypatch.setattr(equation_files, "SOURCES", tmp_path / "pyfmu_sources")
    source = tmp_path / "pyfmu_sources" / "odd.py"
    (tmp_path / "pyfmu_sources" / "shapes").mkdir()
    for file, text in SHAPES.items():
        (tmp_path / "pyfmu_sources" / "shapes" / file).write_text(text, encoding="utf-8")
    equation_files.closure.cache_clear()
    source.write_text(f'"""Odd."""\n\n{line}\n', encoding="utf-8")
    with pytest.raises(FmuError, match=rf"odd\.py:3: .*{re.escape(name)}"):
        equation_files.closure("odd")
    source.write_text('"""Right."""\n\nfrom .shapes import filters\n', encoding="utf-8")
    found = [path.relative_to(tmp_path / "pyfmu_sources").as_posix() for path in equation_files.closure("odd")]
    assert found == [
        "hybrid/__init__.py",
        "hybrid/event_numbers.py",
        "odd.py",
        "shapes/__init__.py",
        "shapes/decay.py",
        "shapes/filters.py",
    ]
    equation_files.closure.cache_clear()


@pytest.mark.parametrize(
    "text",
    [
        "def f():\n    {}",
        "class A:\n    def f(self):\n        if True:\n            pass\n        elif False:\n            {}",
        "try:\n    {}\nexcept OSError:\n    pass",
        "try:\n    pass\nexcept OSError:\n    {}",
        "try:\n    pass\nfinally:\n    {}",
        "for n in ():\n    pass\nelse:\n    {}",
        "with open(0) as f:\n    {}",
        "match 1:\n    case 2:\n        pass\n    case _:\n        {}",
        "async def f():\n    while True:\n        {}",
    ],
)
def test_an_import_counts_wherever_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(equation_files, "SOURCES", tmp_path)
    for name in ("there", "here"):
        (tmp_path / f"{name}.py").write_text(text.format("from . import there") if name == "here" else "")
    assert [path.name for path in equation_files.read_imports(tmp_path / "here.py")] == ["there.py"]
