"""Endurance of the plant FMU: instances, steps and resets by the hundred thousand, and what memory they take.

Run as ``python -m benchmarks.fmu_endurance`` (about a minute); ``--native`` does it in a host without Python.
"""

import ctypes
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from orchestrator.building.build import ensure_built
from orchestrator.building.launcher import find_toolchain
from tests.support.fmu_calls import OK, RawFmu

INSTANCES, STEPS, RESETS = 10_000, 1_000_000, 1_000


def resident() -> float:
    """Return the resident memory of this process in kB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1024.0


def report(what: str, count: int, work: Callable[[], None]) -> None:
    """Do ``work`` and print its time and memory growth."""
    before, start = resident(), time.perf_counter()
    work()
    seconds, growth = time.perf_counter() - start, resident() - before
    each = f"{1e6 * seconds / count:8.1f} us and {1024.0 * growth / count:7.1f} B each"
    print(f"{count:>9,} {what:<10} {seconds:6.1f} s, memory {growth:+7.0f} kB: {each}")


def main() -> None:
    """Run in this process, or compile the C host and run there."""
    path = ensure_built(["Drivetrain"])["Drivetrain"]
    if "--native" in sys.argv:
        native(path)
        return
    raw = RawFmu(path)
    warm_up = raw.started()
    raw.library.fmi2FreeInstance(warm_up)

    def instances() -> None:
        for _ in range(INSTANCES):
            raw.library.fmi2FreeInstance(raw.started(alpha=0.02))

    report("instances", INSTANCES, instances)
    component = raw.started(alpha=0.02)
    reference, torque = (ctypes.c_uint * 1)(0), (ctypes.c_double * 1)()
    one, h = ctypes.c_size_t(1), ctypes.c_double(1e-3)

    def steps() -> None:
        worst = OK
        for n in range(STEPS):
            torque[0] = 20.0 if (n // 500) % 2 else -20.0
            worst |= raw.library.fmi2SetReal(component, reference, one, torque)
            worst |= raw.library.fmi2DoStep(component, ctypes.c_double(n * 1e-3), h, 1)
        assert worst == OK

    report("doSteps", STEPS, steps)

    def resets() -> None:
        for _ in range(RESETS):
            assert raw.library.fmi2Reset(component) == OK
            assert raw.setup(component) == OK
            assert raw.library.fmi2EnterInitializationMode(component) == OK
            assert raw.library.fmi2ExitInitializationMode(component) == OK
            assert raw.step(component, 0.0, 1e-3) == OK

    report("resets", RESETS, resets)
    raw.library.fmi2FreeInstance(component)


def native(path: Path) -> None:
    """The same counts in the C host of the tests; the memory is the peak that the system reports."""
    compiler = find_toolchain().compiler
    assert compiler is not None, "no C compiler"
    raw = RawFmu(path)
    program = Path(tempfile.mkdtemp()) / "fmu_host"
    source = Path(__file__).resolve().parents[1] / "tests" / "support" / "fmu_host.c"
    subprocess.run([compiler, "-O1", "-o", str(program), str(source), "-ldl", "-lm"], check=True)
    library = raw.folder / "binaries" / "linux64" / "Drivetrain.so"
    where = [str(library), raw.guid, (raw.folder / "resources").as_uri()]
    for steps, instances in ((1, 1), (1, INSTANCES), (STEPS, 1)):
        words = [str(program), *where, str(steps), "0.001", "20", str(raw.references["alpha"]), "0.02", str(instances)]
        start = time.perf_counter()
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        assert status == 0
        print(f"{instances:>9,} instances of {steps:>9,} steps {seconds:6.1f} s, peak memory {usage.ru_maxrss:,} kB")


if __name__ == "__main__":
    main()
