"""Fixtures that all areas share, and the order in which files run."""

import os

# Before a library starts threads that wait for each other: the workers use all processors.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import compileall
import gc
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator, Sequence
from functools import partial
from itertools import islice
from pathlib import Path

import pytest
from filelock import FileLock

from orchestrator.building.build import ensure_built
from orchestrator.building.native_build import ensure_native

try:
    from hypothesis import HealthCheck, settings
except ModuleNotFoundError:
    pass
else:  # what a busy computer takes longer for is no failure; the same examples by day, new ones each night
    settings.register_profile("night", deadline=None, suppress_health_check=[HealthCheck.too_slow])
    settings.register_profile("day", settings.get_profile("night"), derandomize=True)
    settings.load_profile("day")

EXTRAS = frozenset(
    [
        "asammdf",
        "control",
        "daqp",
        "dask",
        "distributed",
        "h5py",
        "hypothesis",
        "jsonschema",
        "numba",
        "pyarrow",
        "schemastore",
        "selenium",
        "setuptools",
        "shtab",
        "starlette",
        "uvicorn",
        "yaml",
    ]
)
"""Modules of the extra [test]: a file that needs one that is missing is skipped."""
ASKED = ("night", "network")
"""Markers of tests that run only where ``-m`` names them."""
LONG = ("test_readme.py", "test_contributing.py", "test_notebooks.py", "test_public_api.py")  # minutes each


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for no garbage while tests are collected, which stay: it is a third of the time. Afterwards, rarely."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 20, 20)
        gc.enable()


class _File(pytest.Module):
    """A file of tests."""

    def _getobj(self) -> object:
        try:
            return super()._getobj()
        except self.CollectError as error:
            name = getattr(error.__cause__, "name", None) or ""
            if isinstance(error.__cause__, ModuleNotFoundError) and name.partition(".")[0] in EXTRAS:
                pytest.skip(f"{name} is of the extra [test]", allow_module_level=True)
            raise


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module:
    """Collect what can be without the extra [test], too."""
    return _File.from_parent(parent, path=module_path)


def pytest_configure(config: pytest.Config) -> None:
    """Name failures as they happen: a run that is cut says what it has found.

    A shell gives what it runs in the background an ignored SIGINT; tests send that to their own children.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    _keep_compiled_modules()
    config.pluginmanager.register(_Failures(config))


def _keep_compiled_modules() -> None:
    """Compile what hundreds of children import, which without this each of them would compile again."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    if "PYTEST_XDIST_WORKER" not in os.environ:
        for package in ("orchestrator", "pyfmu_sources"):
            compileall.compile_dir(Path(__file__).parents[1] / package, quiet=2)


class _Failures:
    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        terminal = self._config.pluginmanager.get_plugin("terminalreporter")
        if report.failed and terminal is not None:
            terminal.write_line(f"\nFAILED {report.nodeid} ({report.when})", red=True)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what was not asked for, and order the rest."""
    silent = [name for name in ASKED if name not in config.option.markexpr]
    left_out = [item for item in items if any(map(item.get_closest_marker, silent))]
    config.hook.pytest_deselected(items=left_out)
    gone = set(left_out)
    items[:] = [item for item in items if item not in gone]
    _order(items)


def _order(items: list[pytest.Item]) -> None:
    """Put the longest tests first in the part of each worker: the run does not wait for one of them at its end.

    Those that share a slow fixture go to one worker, which makes it once: ``@pytest.mark.slow(shares="fixture")``.
    """
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    minutes = [item for item in items if item.path.name in LONG]
    slow = [item for item in items if item.get_closest_marker("slow") and item not in minutes]
    early = minutes + slow
    together: dict[object, list[pytest.Item]] = {}
    for item in early:
        together.setdefault(_work_of(item), []).append(item)
    parts: list[list[pytest.Item]] = [[] for _ in range(workers)]
    for place, group in enumerate(together.values()):
        parts[place % workers] += group
    long = set(early)
    others = iter([item for item in items if item not in long])
    size = -(-len(items) // workers)
    items[:] = [item for part in parts for item in (*part, *islice(others, max(0, size - len(part))))]
    items += others


def _work_of(item: pytest.Item) -> object:
    """Return what tests have in common that are run by one worker: the test itself where that is nothing."""
    marker = item.get_closest_marker("slow")
    shared = marker.kwargs.get("shares") if marker else None
    return (item.path, shared) if shared else item


@pytest.fixture(scope="session", autouse=True)
def _temporary_files_end_with_the_run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep what tests, and tools of others that they run, leave in the temporary directory from staying there."""
    folder = tmp_path_factory.mktemp("tmp")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", str(folder))
        patch.setattr(tempfile, "tempdir", None)
        yield
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def fmus() -> dict[str, Path]:
    """The three FMUs of the project, built once: model name to path."""
    return ensure_built(["Drivetrain", "LqrController", "KalmanEstimator"])


@pytest.fixture(scope="session")
def build_native(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., dict[str, Path]]:
    """``(names, fmi=2, here=True)`` to paths of native FMUs, for this platform or all; each is built once in a run."""
    folder = _folder_of_all_workers(tmp_path_factory)

    def build(names: Sequence[str], fmi: int = 2, here: bool = True) -> dict[str, Path]:
        place = folder / f"native{fmi}{'' if here else '_everywhere'}"
        return _build_each(names, place, partial(ensure_native, directory=place, here=here, fmi=fmi))

    return build


def _folder_of_all_workers(factory: pytest.TempPathFactory) -> Path:
    base = factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


def _build_each(names: Sequence[str], place: Path, ensure: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    """Build what is not there yet; a worker waits for another one that builds the same."""
    place.mkdir(exist_ok=True)
    paths: dict[str, Path] = {}
    for name in names:
        with FileLock(place / f"{name}.lock"):
            paths |= ensure([name])
    return paths
