"""Own FMUs of FMI 3.0 on their input clock, driven by FMPy's low-level interface, beside those of FMI 2.0."""

import ctypes
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from orchestrator.fmi.instances import make_slave
from orchestrator.fmi.model_description import read_description
from tests.support.c_fmu import have_compiler
from tests.support.fmi3_calls import Slave3

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

NAMES = ["LqrController", "KalmanEstimator", "BacklashEstimator"]
STEP = 1e-3


@pytest.fixture(scope="module")
def built(build_native: Callable[..., dict[str, Path]]) -> dict[str, dict[str, Path]]:
    """Version to FMU by name."""
    return {
        "2": build_native(NAMES),
        "3": build_native(NAMES, fmi=3),
    }


def tick(slave: Slave3) -> None:
    slave.fmu.setClock([slave.variables["sample"].valueReference], [True])


def set_times(slave: Slave3, interval: float, shift: float = 0.0) -> None:
    """Set interval and shift of the clock [s]."""
    reference = (ctypes.c_uint * 1)(slave.variables["sample"].valueReference)
    slave.fmu.setIntervalDecimal(reference, (ctypes.c_double * 1)(interval))
    if shift:  # FMPy has no method for it
        count, value = ctypes.c_size_t(1), (ctypes.c_double * 1)(shift)
        assert slave.fmu.dll.fmi3SetShiftDecimal(ctypes.c_void_p(slave.fmu.component), reference, count, value) == 0


def in_event_mode(path: Path, interval: float | None = None, shift: float = 0.0) -> Slave3:
    """Return an instance in event mode at t = 0."""
    slave = Slave3(path, events=True, early_return=True)
    slave.fmu.enterInitializationMode(startTime=0.0)
    if interval is not None:
        set_times(slave, interval, shift)
    slave.fmu.exitInitializationMode()
    return slave


def excitation(count: int, steps: int) -> np.ndarray:
    """Return random inputs, shape (steps + 1, count)."""
    return np.random.default_rng(0).uniform(-5.0, 5.0, (steps + 1, count))


def sampled(path: Path, rows: np.ndarray) -> np.ndarray:
    """Return what an FMU of FMI 2.0 samples from the inputs of each row, the first at t = 0."""
    description = read_description(path)
    inputs, outputs = description.model.names_of("input"), description.model.names_of("output")
    slave = make_slave("a", path, description)
    slave.begin(0.0, None, None)
    slave.set(dict(zip(inputs, rows[0], strict=True)))
    found = [slave.get(outputs)]
    slave.start()
    for n, row in enumerate(rows[1:]):
        held = dict(zip(inputs, row, strict=True))
        if "u" in held:  # which counts over the sample period that ends
            held["u"] = rows[n][inputs.index("u")]
        slave.set(held)
        slave.do_step(n * STEP, STEP)
        found.append(slave.get(outputs))
    slave.close()
    return np.array(found, dtype=float)


def ticked(path: Path, rows: np.ndarray) -> np.ndarray:
    """Return what an FMU of FMI 3.0 puts out at ticks for the inputs of each row."""
    slave = in_event_mode(path)
    inputs = [v.name for v in slave.description.modelVariables if v.causality == "input" and v.type != "Clock"]
    outputs = [v.name for v in slave.description.modelVariables if v.causality == "output"]
    found = []
    for n, row in enumerate(rows):
        if n:
            slave.step((n - 1) * STEP, STEP)
            slave.fmu.enterEventMode()
        tick(slave)
        for k in (n - 1, n):  # a tick may be computed anew: what is set last counts
            for name, value in zip(inputs, rows[k] if k >= 0 else row, strict=True):
                slave.set(name, value)
            now = [slave.get(name)[0] for name in outputs]
        found.append(now)
        slave.settle()
        assert [slave.get(name)[0] for name in outputs] == now
    slave.close()
    return np.array(found)


@pytest.mark.parametrize("name", NAMES)
def test_ticks_have_the_bits_of_samples(built: dict[str, dict[str, Path]], name: str) -> None:
    count = len(read_description(built["2"][name]).model.names_of("input"))
    rows = excitation(count, 100)
    expected, found = sampled(built["2"][name], rows), ticked(built["3"][name], rows)
    assert found.tobytes() == expected.tobytes()
    assert np.ptp(found, axis=0).max() > 0.0


def test_the_importer_sets_the_interval(built: dict[str, dict[str, Path]]) -> None:
    slave = in_event_mode(built["3"]["BacklashEstimator"], 2e-3, 0.5e-3)
    assert slave.get("sample_time") == [2e-3]
    slave.settle()
    slave.step(0.0, 0.5e-3)
    for time in (0.5e-3, 2.5e-3):
        slave.fmu.enterEventMode()
        tick(slave)
        slave.settle()
        slave.step(time, 2e-3)
    slave.fmu.reset()
    slave.fmu.enterInitializationMode(startTime=0.0)
    assert slave.get("sample_time") == [1e-3]
    reference = (ctypes.c_uint * 1)(slave.variables["sample"].valueReference)
    interval, qualifier, shift = (ctypes.c_double * 1)(), (ctypes.c_int * 1)(), (ctypes.c_double * 1)(1.0)
    slave.fmu.getIntervalDecimal(reference, interval, qualifier)
    slave.fmu.getShiftDecimal(reference, shift)
    assert (interval[0], qualifier[0], shift[0]) == (1e-3, 1, 0.0)
    assert slave.messages == []
    slave.close()


@pytest.mark.parametrize(("given", "interval"), [(2e-3, None), (2e-3, 1e-3)])
def test_a_sample_time_that_is_not_the_interval_is_refused(
    built: dict[str, dict[str, Path]], given: float, interval: float | None
) -> None:
    slave = Slave3(built["3"]["LqrController"], events=True)
    slave.set("sample_time", given)
    slave.fmu.enterInitializationMode(startTime=0.0)
    with pytest.raises(FMICallException):
        slave.fmu.exitInitializationMode() if interval is None else set_times(slave, interval)
    assert slave.messages[0] in (
        "`sample_time` must be the interval of the clock `sample`, 0.001 s, but is 0.002 s",
        "the interval of the clock `sample` must be `sample_time` where that is set, 0.002 s, but is 0.001 s",
    )
    set_times(slave, given)
    slave.fmu.exitInitializationMode()
    slave.close()


def test_a_host_that_does_not_tick_is_told_so(built: dict[str, dict[str, Path]]) -> None:
    """FMPy's own loop knows no clocks: without this it would report success for a controller that never runs."""
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(str(built["3"]["LqrController"]), stop_time=0.01, use_event_mode=True, logger=lambda *_: None)
    slave = in_event_mode(built["3"]["LqrController"])
    slave.settle()
    with pytest.raises(FMICallException):
        slave.step(0.0, STEP)
    assert slave.messages == ["the clock `sample` must tick at 0.0, but a step goes on to 0.001"]
    slave.close()


def test_what_clocks_forbid_is_refused(built: dict[str, dict[str, Path]]) -> None:
    slave = in_event_mode(built["3"]["LqrController"])
    clock = slave.variables["sample"].valueReference
    with pytest.raises(FMICallException):
        slave.set("reference", 1.0)
    assert slave.fmu.getClock([clock]) == [False]
    tick(slave)
    assert slave.fmu.getClock([clock]) == [True]
    slave.set("reference", 1.0)
    with pytest.raises(FMICallException):
        slave.fmu.setClock([clock], [False])
    with pytest.raises(FMICallException):
        slave.fmu.setClock([clock - 1], [True])
    slave.settle()
    with pytest.raises(FMICallException):
        tick(slave)
    slave.step(0.0, 0.1 * STEP)
    slave.fmu.enterEventMode()
    with pytest.raises(FMICallException):
        tick(slave)
    with pytest.raises(FMICallException):
        set_times(slave, 1e-3)
    assert slave.messages == [
        "fmi3SetFloat64 must set `reference` while its clock ticks",
        "fmi3SetClock must not deactivate the clock `sample`",
        "fmi3SetClock must not be used for value reference 18, which is of another type",
        "fmi3SetClock must be called in event mode",
        "the clock `sample` must tick at 0.001, but ticks at 0.0001",
        "fmi3SetIntervalDecimal must not be called in step mode; ignored",
    ]
    slave.close()


def test_a_state_within_a_tick_goes_on_as_it_was(built: dict[str, dict[str, Path]]) -> None:
    def rest(slave: Slave3) -> list[float]:
        slave.set("theta_m", 0.3)
        found = [slave.get("theta_m_hat")[0]]
        slave.settle()
        slave.step(STEP, STEP)
        slave.fmu.enterEventMode()
        tick(slave)
        return [*found, slave.get("theta_m_hat")[0], slave.get("omega_m_hat")[0]]

    slave, other = (in_event_mode(built["3"]["KalmanEstimator"], shift=0.0, interval=STEP) for _ in range(2))
    tick(slave)
    slave.set("u", 100.0)
    slave.settle()
    slave.step(0.0, STEP)
    slave.fmu.enterEventMode()
    tick(slave)
    state = slave.fmu.getFMUState()
    bits = slave.fmu.serializeFMUState(state)
    first = rest(slave)
    slave.fmu.setFMUState(state)
    assert rest(slave) == first
    other.fmu.setFMUState(other.fmu.deserializeFMUState(bits))
    assert rest(other) == first
    for each in (slave, other):
        each.close()


def test_without_event_mode_the_fmu_samples_by_itself(built: dict[str, dict[str, Path]]) -> None:
    description = read_description(built["3"]["KalmanEstimator"], events=False)
    assert not description.model.clocks
    assert not description.model.has_events
    assert list(read_description(built["3"]["KalmanEstimator"]).model.clocks) == ["sample"]
