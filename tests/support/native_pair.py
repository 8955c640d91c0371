"""A Python FMU and the native one of the same slave, driven by the same calls; used by tests and benchmarks."""

import ctypes
import random
from pathlib import Path
from typing import Any

from tests.support.fmu_calls import OK, RawFmu

REFUSED = "fmi2DoStep"


class Driver:
    """One instance, with calls that return what a host sees: status, values, messages."""

    def __init__(self, path: Path) -> None:
        self.fmu = RawFmu(path)
        component = self.fmu.instantiate()
        assert component is not None
        self.component = component
        self.states: list[ctypes.c_void_p] = []

    def said(self, status: int, values: Any = None) -> tuple[Any, ...]:
        """Return a call's outcome and forget the messages."""
        messages = list(self.fmu.messages)
        self.fmu.messages.clear()
        return status, values, messages

    def call(self, function: str, *arguments: Any) -> tuple[Any, ...]:
        """Call a function that takes the component and plain arguments."""
        return self.said(getattr(self.fmu.library, function)(self.component, *arguments))

    def setup(self, start: float, stop: float | None) -> tuple[Any, ...]:
        """Call fmi2SetupExperiment."""
        zero = ctypes.c_double(0.0)
        return self.call(
            "fmi2SetupExperiment", 0, zero, ctypes.c_double(start), int(stop is not None), ctypes.c_double(stop or 0.0)
        )

    def get(self, kind: str, references: list[int]) -> tuple[Any, ...]:
        """Call fmi2GetReal or fmi2GetInteger; numbers come back as text, so that NaN equals NaN."""
        c = ctypes.c_double if kind == "Real" else ctypes.c_int
        values = (c * len(references))()
        status = getattr(self.fmu.library, f"fmi2Get{kind}")(
            self.component, (ctypes.c_uint * len(references))(*references), ctypes.c_size_t(len(references)), values
        )
        return self.said(status, [repr(value) for value in values])

    def set(self, kind: str, references: list[int], values: list[Any]) -> tuple[Any, ...]:
        """Call fmi2SetReal or fmi2SetInteger."""
        c = ctypes.c_double if kind == "Real" else ctypes.c_int
        return self.call(
            f"fmi2Set{kind}",
            (ctypes.c_uint * len(references))(*references),
            ctypes.c_size_t(len(references)),
            (c * len(references))(*values),
        )

    def step(self, time: float, step: float) -> tuple[Any, ...]:
        """Call fmi2DoStep."""
        return self.said(self.fmu.step(self.component, time, step))

    def save(self) -> tuple[Any, ...]:
        """Keep a copy of the state."""
        state = ctypes.c_void_p()
        outcome = self.call("fmi2GetFMUstate", ctypes.byref(state))
        if outcome[0] == OK:
            self.states.append(state)
        return outcome

    def restore(self, number: int, serialised: bool) -> tuple[Any, ...]:
        """Return to a kept state, by way of bytes if asked for."""
        state = self.states[number]
        if not serialised:
            return self.call("fmi2SetFMUstate", state)
        size = ctypes.c_size_t()
        self.call("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.call("fmi2SerializeFMUstate", state, buffer, size)
        copy = ctypes.c_void_p()
        self.call("fmi2DeSerializeFMUstate", buffer, size, ctypes.byref(copy))
        outcome = self.call("fmi2SetFMUstate", copy)
        self.call("fmi2FreeFMUstate", ctypes.byref(copy))
        return outcome


def random_calls(drivers: list[Driver], table: Any, count: int, seed: int) -> int:
    """Drive all alike with ``count`` random calls, some forbidden; return how many steps succeeded.

    Raises:
        AssertionError: two of them differ in status, values or messages.
    """
    rng = random.Random(seed)
    reals = [n for n, v in enumerate(table) if v.type == "Real"]
    inputs = [n for n, v in enumerate(table) if v.causality == "input"]
    everything = list(range(len(table)))
    integers = [n for n in everything if n not in reals]
    time, stepped = 0.0, 0

    def alike(outcomes: list[tuple[Any, ...]]) -> tuple[Any, ...]:
        assert all(outcome == outcomes[0] for outcome in outcomes), f"seed {seed}: {outcomes}"
        return outcomes[0]

    def initialise() -> None:
        if rng.random() < 0.5:
            alike([d.setup(0.0, rng_stop) for d in drivers])
        for function in ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode"):
            alike([d.call(function) for d in drivers])

    rng_stop = rng.choice([None, 1.0])
    initialise()
    for _ in range(count):
        kind = rng.random()
        if kind < 0.45:
            size = rng.choice([1e-3, 1e-3, 1e-3, 2e-3, 1e-2, -1.0, 0.0, 2.0])
            wrong = 0.5 if rng.random() < 0.03 else 0.0
            if alike([d.step(time + wrong, size) for d in drivers])[0] in (0, 1):
                time, stepped = time + wrong + size, stepped + 1
        elif kind < 0.65:
            chosen = rng.sample(inputs, rng.randint(1, len(inputs)))
            values = [rng.choice([rng.uniform(-30, 30), rng.uniform(-0.1, 0.1), 0.0]) for _ in chosen]
            alike([d.set("Real", chosen, values) for d in drivers])
        elif kind < 0.85:
            chosen = rng.sample(reals, min(5, len(reals)))
            alike([d.get("Real", chosen) for d in drivers])
            if integers:
                alike([d.get("Integer", integers) for d in drivers])
        elif kind < 0.88:
            chosen = [*rng.sample(everything, 2), rng.choice([1, 5000])]
            alike([d.get("Real", chosen) for d in drivers])
            value = rng.choice([1e300, float("nan"), 0.5])
            alike([d.set("Real", chosen[:2], [value, value]) for d in drivers])
        elif kind < 0.93:
            alike([d.save() for d in drivers])
            times = getattr(drivers[0], "times", [])
            if len(drivers[0].states) > len(times):
                drivers[0].times = [*times, time]  # type: ignore[attr-defined]
        elif kind < 0.97 and drivers[0].states:
            number, serialised = rng.randrange(len(drivers[0].states)), rng.random() < 0.5
            if alike([d.restore(number, serialised) for d in drivers])[0] == OK:
                time = drivers[0].times[number]  # type: ignore[attr-defined]
        elif kind < 0.985:
            alike([d.call("fmi2Reset") for d in drivers])
            time = 0.0
            for reference in rng.sample(everything, min(4, len(everything))):
                variable = table[reference]
                if variable.causality == "parameter" and variable.type == "Real":
                    low, high = (max(-20.0, variable.bounds[0]), min(20.0, variable.bounds[1]))
                    alike([d.set("Real", [reference], [value]) for value in [rng.uniform(low, high)] for d in drivers])
                elif variable.causality == "parameter":
                    value = rng.randint(0, 7)
                    alike([d.set("Integer", [reference], [value]) for d in drivers])
            initialise()
        else:
            function = rng.choice(["fmi2EnterInitializationMode", "fmi2ExitInitializationMode"])
            alike([d.call(function) for d in drivers])
    return stepped
