"""FMUs of FMI 3.0 that run Python against the native ones of the same sources, also in a host without Python."""

import ctypes
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Model
from fmpy.validation import validate_fmu

from orchestrator.building.compilers import find_compiler
from orchestrator.building.launcher import find_toolchain
from orchestrator.shared.machine_code import local_compiler
from tests.support.fmi3_calls import Slave3

pytestmark = pytest.mark.skipif(
    find_compiler(here=True) is None or find_toolchain().compiler is None, reason="no C compiler"
)
NAMES = ("Drivetrain", "ServoAxis", "KalmanEstimator", "LoadHalf")
GAP = {"alpha": 0.01, "omega_m_start": 2.0, "backlash_model": 3, "u": 3.0}


@pytest.fixture(scope="module")
def both(
    build_native: Callable[..., dict[str, Path]], build_python_fmi3: Callable[..., dict[str, Path]]
) -> dict[str, dict[str, Path]]:
    return {
        "python": build_python_fmi3(NAMES),
        "native": build_native(NAMES, fmi=3),
    }


@pytest.mark.parametrize("name", NAMES)
def test_fmpy_finds_nothing(both: dict[str, dict[str, Path]], name: str) -> None:
    assert validate_fmu(str(both["python"][name])) == []


@pytest.mark.parametrize("name", NAMES)
def test_steps_have_the_bits_of_the_native_fmu(both: dict[str, dict[str, Path]], name: str) -> None:
    rng = np.random.default_rng(2)
    slaves = [Slave3(both[kind][name]) for kind in both]
    signals = [v for v in slaves[0].variables.values() if v.type != "Clock"]
    kinds = {c: [v.name for v in signals if v.causality == c] for c in ("input", "output")}
    for slave in slaves:
        slave.start({})
    moved = 0
    for n in range(100):
        values = {entry: float(rng.uniform(-20.0, 20.0)) for entry in kinds["input"]} if n % 10 == 0 else {}
        rows = []
        for slave in slaves:
            for entry, value in values.items():
                slave.set(entry, value)
            slave.step(n * 1e-3, 1e-3)
            rows.append([slave.get(output) for output in kinds["output"]])
        assert repr(rows[0]) == repr(rows[1])
        moved += np.any(np.array(rows[0]) != 0.0)
    assert moved > 50
    for slave in slaves:
        slave.close()


@pytest.mark.parametrize("name", ["LoadHalf", "Drivetrain"])
def test_model_exchange_begins(both: dict[str, dict[str, Path]], name: str, tmp_path: Path) -> None:
    derivatives = []
    for kind in both:
        folder = fmpy.extract(str(both[kind][name]), str(tmp_path / kind))
        description = fmpy.read_model_description(folder)
        exchange = description.modelExchange
        fmu = FMU3Model(
            guid=description.guid, unzipDirectory=folder, modelIdentifier=exchange.modelIdentifier, instanceName="i"
        )
        fmu.instantiate()
        fmu.enterInitializationMode(startTime=0.0)
        fmu.exitInitializationMode()
        fmu.updateDiscreteStates()
        fmu.enterContinuousTimeMode()
        count = len(description.derivatives)
        rates = (ctypes.c_double * count)()
        fmu.getContinuousStateDerivatives(rates, count)
        derivatives.append(list(rates))
        fmu.terminate()
        fmu.freeInstance()
    assert len(derivatives[0]) > 1
    assert derivatives[0] == derivatives[1]


def event_run(path: Path) -> tuple[Any, ...]:
    outputs = ("theta_m", "theta_l", "omega_m", "omega_l", "T_m", "T_shaft")
    slave = Slave3(path, events=True, early_return=True)
    slave.start(GAP)
    begin = slave.fmu.serializeFMUState(slave.fmu.getFMUState())
    first = slave.run_with_events(0.3, 1e-2, (*outputs, "contact"))
    rates = slave.fmu.getOutputDerivatives([slave.variables[o].valueReference for o in outputs], [1] * len(outputs))
    slave.fmu.setFMUState(slave.fmu.deserializeFMUState(begin))
    assert slave.run_with_events(0.3, 1e-2, (*outputs, "contact")) == first
    slave.close()
    return first, rates


def test_events_derivatives_and_states_are_those_of_the_native_fmu(both: dict[str, dict[str, Path]]) -> None:
    python, native = (event_run(both[kind]["Drivetrain"]) for kind in both)
    assert python == native
    assert len(python[0][1]) == 5


def test_what_a_slave_refuses_is_said_as_in_c(both: dict[str, dict[str, Path]]) -> None:
    said = []
    for kind in both:
        slave = Slave3(both[kind]["Drivetrain"])
        slave.start({"alpha": 0.01})
        with pytest.raises(FMICallException, match="discard"):
            slave.step(0.0, 300.0)
        assert slave.step(0.0, 1e-3)[3] == 1e-3
        said.append(slave.messages)
        slave.close()
    assert said[0] == said[1]
    assert said[0] == ["a step must be at most 100.0 s long, but is 300.0 s"]


def test_a_host_without_python_gets_the_same_bits(both: dict[str, dict[str, Path]], tmp_path: Path) -> None:
    host = tmp_path / "host"
    compiler = local_compiler()
    assert compiler is not None
    source = Path(__file__).parents[1] / "support" / "fmi3_host.c"
    subprocess.run([compiler, "-o", str(host), str(source), "-ldl"], check=True)
    printed = []
    for kind in both:
        folder = tmp_path / kind
        fmpy.extract(str(both[kind]["Drivetrain"]), str(folder))
        description = fmpy.read_model_description(str(folder))
        reference = {v.name: str(v.valueReference) for v in description.modelVariables}
        library = folder / "binaries" / "x86_64-linux" / "Drivetrain.so"
        words = [str(library), description.guid, f"{folder / 'resources'}/", reference["u"], "20", reference["theta_l"]]
        run = subprocess.run([str(host), *words, "100", "0.001"], capture_output=True, text=True, check=False, env={})
        assert run.returncode == 0, run.stderr
        printed.append(run.stdout)
    assert printed[0] == printed[1]
    assert len(printed[0].splitlines()) == 100
