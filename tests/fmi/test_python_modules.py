"""FMUs that run Python keep their modules to themselves, whatever others in the same process call theirs."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from orchestrator.api.scenario_sweep import sweep_scenario
from orchestrator.api.simulate import simulate
from orchestrator.fmi.instances import make_slave
from orchestrator.fmi.python_modules import PythonModules
from tests.support.python_fmus import build_python_fmu, slave_source

FACTORS = (1.0, 100.0)
STEP = "self.y += {factor} * step\nreturn True"


def helper(factor: float) -> dict[str, str]:
    return {"helper.py": f"FACTOR = {factor}\n"}


def package(factor: float) -> dict[str, str]:
    return {"parts/__init__.py": "from .deep import FACTOR\n", "parts/deep.py": f"FACTOR = {factor}\n"}


def lazy_part(factor: float) -> dict[str, str]:
    return {"parts/__init__.py": "", "parts/deep.py": f"FACTOR = {factor}\n"}


def two_helpers(factor: float) -> dict[str, str]:
    return {"helper.py": "import inner\nFACTOR = inner.value()\n", "inner.py": f"def value():\n    return {factor}\n"}


FROM_HELPER = STEP.format(factor="helper.FACTOR")
PATH = "import os, sys\nsys.path.insert(0, os.path.join(os.path.dirname(__file__), 'lib'))\nimport helper\n"
PACKAGE_DATA = "float(r.files('parts').joinpath('factor.txt').read_text())"
KINDS: dict[str, Callable[[float], tuple[str, Mapping[str, str]]]] = {
    "module": lambda f: (slave_source(STEP.format(factor="FACTOR"), f"FACTOR = {f}"), {}),
    "helper": lambda f: (slave_source(FROM_HELPER, "import helper"), helper(f)),
    "two helpers": lambda f: (slave_source(FROM_HELPER, "import helper"), two_helpers(f)),
    "package": lambda f: (slave_source(STEP.format(factor="parts.FACTOR"), "import parts"), package(f)),
    "late": lambda f: (slave_source(f"import helper\n{FROM_HELPER}"), helper(f)),
    "late part": lambda f: (slave_source("from parts import deep\n" + STEP.format(factor="deep.FACTOR")), lazy_part(f)),
    "by name": lambda f: (
        slave_source('helper = importlib.import_module("helper")\n' + FROM_HELPER, "import importlib"),
        helper(f),
    ),
    "folder on the path": lambda f: (slave_source(FROM_HELPER, PATH), {f"lib/{n}": t for n, t in helper(f).items()}),
    "data of a package": lambda f: (
        slave_source("import importlib.resources as r\n" + STEP.format(factor=PACKAGE_DATA), "import parts"),
        {"parts/__init__.py": "", "parts/factor.txt": str(f)},
    ),
    "data by pkgutil": lambda f: (
        slave_source(STEP.format(factor="float(pkgutil.get_data('parts', 'factor.txt'))"), "import parts, pkgutil"),
        {"parts/__init__.py": "", "parts/factor.txt": str(f)},
    ),
    "loaded anew": lambda f: (
        slave_source(f"importlib.reload(helper)\n{FROM_HELPER}", "import importlib, helper"),
        helper(f),
    ),
    "in a text that is run": lambda f: (
        slave_source("space = {}\nexec('import helper', space)\n" + STEP.format(factor="space['helper'].FACTOR")),
        helper(f),
    ),
    "name of a loaded module": lambda f: (
        slave_source(STEP.format(factor="fractions.FACTOR"), "import fractions"),
        {"fractions.py": f"FACTOR = {f}\n"},
    ),
}


def scenario(folder: Path, paths: Mapping[str, Path], stop: float = 1.0) -> Path:
    records = ", ".join(f'"{name}.y"' for name in paths)
    instances = "".join(f'[instances.{name}]\nfmu = "{path}"\n' for name, path in paths.items())
    path = folder / "both.toml"
    path.write_text(f"stop = {stop}\nrecord = [{records}]\n[master]\nstep = 0.1\n{instances}")
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_each_runs_its_own_code_in_any_order(tmp_path: Path, kind: str) -> None:
    """One order a kind, in turn: whichever code ran for both, one of the two values would be wrong."""
    paths = {f"of{k}": build_python_fmu(tmp_path / str(k), *KINDS[kind](f)) for k, f in enumerate(FACTORS)}
    backwards = list(KINDS).index(kind) % 2
    result = simulate(scenario(tmp_path, dict(reversed(paths.items())) if backwards else paths))
    assert [result[f"of{k}.y"][-1] for k in range(2)] == pytest.approx(FACTORS)


@pytest.fixture(scope="module")
def versions(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Two FMUs that differ in a helper of the same name, imported when it is needed."""
    folder = tmp_path_factory.mktemp("versions")
    return {f"of{k}": build_python_fmu(folder / str(k), *KINDS["late"](f)) for k, f in enumerate(FACTORS)}


def test_a_sweep_and_slaves_of_one_process_run_both_codes(tmp_path: Path, versions: dict[str, Path]) -> None:
    swept = sweep_scenario(scenario(tmp_path, versions), {"of0.gain": "range:1:2:2"}, workers=1)
    last = [row.outcome.values[0::5][:2] for row in swept.rows()]
    assert last == [pytest.approx(FACTORS)] * 2
    slaves = {name: make_slave(name, path) for name, path in versions.items()}
    for slave in slaves.values():
        slave.begin(0.0, 1.0, None)
        slave.start()
        slave.do_step(0.0, 1.0)
    assert [slave.get(["y"])[0] for slave in slaves.values()] == list(FACTORS)
    for slave in slaves.values():
        slave.close()
    assert not any(module in sys.modules for module in ("plant", "helper"))


def test_two_instances_of_one_fmu_share_no_variable_of_a_module(tmp_path: Path) -> None:
    source = slave_source("global calls\ncalls += 1\nself.y = float(calls)\nreturn True", "calls = 0")
    path = build_python_fmu(tmp_path / "counts", source)
    result = simulate(scenario(tmp_path, {"a": path, "b": path}))
    assert [result["a.y"][-1], result["b.y"][-1]] == [10.0, 10.0]


def test_a_class_of_the_fmu_can_be_pickled_in_its_steps(tmp_path: Path) -> None:
    imports = "import pickle\nclass Held:\n    value = 1.0\n"
    path = build_python_fmu(
        tmp_path / "pickles", slave_source("self.y = pickle.loads(pickle.dumps(Held())).value\nreturn True", imports)
    )
    assert simulate(scenario(tmp_path, {"a": path}))["a.y"][-1] == 1.0


def test_modules_of_this_process_are_back_afterwards(tmp_path: Path) -> None:
    import fractions

    (tmp_path / "fractions.py").write_text("FACTOR = 7\n")
    before = list(sys.path)
    modules = PythonModules(tmp_path)
    with modules.place():
        sys.path.insert(0, str(tmp_path))
        other = __import__("fractions")
        assert other.FACTOR == 7
    assert sys.modules["fractions"] is fractions
    assert sys.path == before
    with modules.place():
        assert sys.modules["fractions"] is other
    modules.release()
    assert sys.modules["fractions"] is fractions
