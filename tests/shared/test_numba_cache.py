"""Machine code on disk: used when it is intact, compiled anew when it is not, done without where there is no place."""

import gc
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from numba import njit

from orchestrator.shared import numba_cache

SOURCE = "def twice(x):\n    return 2.0 * x\n"
MODULE = "source_of_the_numba_cache_test"


@pytest.fixture(autouse=True)
def _no_module_is_left() -> Iterator[None]:
    yield
    sys.modules.pop(MODULE, None)


def loaded(path: Path, source: str):
    """The module of a new process, as far as the cache is concerned."""
    if not path.exists():
        path.write_text(source)
    gc.collect()  # what an earlier function left in memory is not there in a new process
    spec = importlib.util.spec_from_file_location(MODULE, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[MODULE] = module  # numba imports a kept function's module by its name
    spec.loader.exec_module(module)
    return module


def hits(folder: Path) -> int:
    function = numba_cache.njit_on_disk()(loaded(folder / "source.py", SOURCE).twice)
    assert function(1.5) == 3.0
    return sum(function.stats.cache_hits.values())


def test_machine_code_is_used_by_the_next_process(tmp_path: Path) -> None:
    assert hits(tmp_path) == 0
    assert hits(tmp_path) == 1


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", ["empty", "half", "flipped", "random"])
def test_what_is_damaged_is_compiled_anew_and_rewritten(tmp_path: Path, ending: str, damage: str) -> None:
    assert hits(tmp_path) == 0
    (path,) = tmp_path.rglob(f"*.{ending}")
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    half = bytes(content[: len(content) // 2])
    path.write_bytes({"empty": b"", "half": half, "flipped": bytes(content), "random": os.urandom(500)}[damage])
    assert hits(tmp_path) == 0
    assert hits(tmp_path) == 1


def test_machine_code_of_another_version_is_not_even_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert hits(tmp_path) == 0
    monkeypatch.setattr("numba.__version__", "0.0")
    assert hits(tmp_path) == 0


def test_a_full_disk_or_no_place_at_all_is_no_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(numba_cache._Files, "_open_for_write", full)
    assert hits(tmp_path) == 0
    assert not list(tmp_path.rglob("*.nb?"))

    def nowhere(*_: object) -> None:
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(numba_cache._Cache, "__init__", nowhere)
    assert hits(tmp_path) == 0


CLOSURE = "def make(factor):\n    def times(x):\n        return factor * x\n    return times\n"


def closure_hits(folder: Path, factor: float) -> int:
    function = numba_cache.njit_on_disk()(loaded(folder / "closure.py", CLOSURE).make(factor))
    assert function(1.5) == factor * 1.5
    return sum(function.stats.cache_hits.values())


def test_a_closure_is_kept_by_what_it_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba_cache, "cache_directory", lambda name: tmp_path)
    assert closure_hits(tmp_path, 2.0) == 0
    assert closure_hits(tmp_path, 2.0) == 1
    assert closure_hits(tmp_path, 3.0) == 0
    assert closure_hits(tmp_path, 2.0) == 1


def test_predictors_are_compiled_once_per_machine(tmp_path: Path) -> None:
    program = (
        "from orchestrator.plants.known.servo_axis import PLANT\n"
        "rates = PLANT.stage().rates\n"
        "PLANT.jacobian(PLANT.extend_values([entry.default for entry in PLANT.table]))\n"
        "print(sum(rates.stats.cache_hits.values()))\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    hits = [
        int(subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, check=True).stdout)
        for _ in range(2)
    ]
    assert hits == [0, 1]


def test_numbers_in_the_source_share_the_machine_code_of_all_numbers() -> None:
    @numba_cache.njit_on_disk()
    def add(x, n):
        return x + n

    @njit
    def thrice(x, n):
        return add(x, 0) + add(x, 1) + add(x, n)

    assert thrice(1.5, 2) == 7.5
    assert len(add.signatures) == 1


def test_names_of_machine_code_do_not_meet_those_of_other_processes() -> None:
    code = (
        "import orchestrator.shared.numba_cache, numba.core.bytecode as b; print(next(b.FunctionIdentity._unique_ids))"
    )
    found = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(2)]
    first, second = (int(run.stdout) for run in found)
    assert abs(first - second) > 1_000_000  # more than a process compiles
