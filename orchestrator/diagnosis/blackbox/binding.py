"""One FMU in this process, ready to run a record many times over."""

import contextlib
from pathlib import Path

import numpy as np

from orchestrator.diagnosis.blackbox.loop import GET, SET, STEP, run_loop
from orchestrator.diagnosis.blackbox.wire import Array, Job
from orchestrator.errors import FmuError, OrchestratorError
from orchestrator.fmi.model_description import read_description
from orchestrator.fmi.slave import FmuSlave

CALLS = {SET: "fmi2SetReal", STEP: "fmi2DoStep", GET: "fmi2GetReal"}
BEYOND = 1.01
"""Stop time that the FMU is told, over the length of the run: some refuse steps beyond one of their own."""


class Box:
    """An instance of an FMU that is reset, or made anew, before every run.

    Args:
        path: of the FMU.
        inputs: variables that are set at every step.
        reads: variables that are read after every step.
        tolerance: of the FMU's own solver; None: its own.
        fresh: make a new instance for every run.

    Raises:
        FmuError: the FMU cannot be read, loaded or instantiated, or lacks a variable.
    """

    def __init__(self, path: Path, inputs: list[str], reads: list[str], tolerance: float | None, fresh: bool) -> None:
        self._path, self._tolerance, self._fresh = path, tolerance, fresh
        self._description = read_description(path)
        variables = self._description.model.variables
        for name in (*inputs, *reads):
            if name not in variables or variables[name].type != "Real":
                raise FmuError(f"{path}: `{name}` must be a variable of type Real, but is not")
        self._inputs, self._reads = inputs, reads
        self._sent, self._read = np.zeros(max(len(inputs), 1)), np.zeros(max(len(reads), 1))
        self._slave: FmuSlave | None = None
        self._used = self._broken = False
        self._only_before = False  # start values are refused in initialisation mode
        self._prepare()

    def _prepare(self) -> FmuSlave:
        """Return an instance in the condition of a new one."""
        if self._slave is not None and self._used:
            if not self._fresh and not self._broken and self._came_back(self._slave):
                self._used = False
                return self._slave
            slave, self._slave = self._slave, None
            if not self._broken:
                with contextlib.suppress(OrchestratorError):
                    slave.terminate()
                slave.close()
        if self._slave is None:
            self._slave = FmuSlave("box", self._path, self._description)
            native = self._slave.native_calls(self._inputs, self._reads)
            if native is None:
                raise FmuError(f"{self._path}: its functions cannot be called")
            self._native = native
            self._calls = np.array([native.component, native.set[0], native.do_step, native.get[0]], dtype=np.int64)
            self._where = np.array(
                [
                    native.inputs[0].ctypes.data,
                    self._sent.ctypes.data,
                    native.outputs[0].ctypes.data,
                    self._read.ctypes.data,
                ],
                dtype=np.int64,
            )
            self._counts = np.array([len(self._inputs), len(self._reads)], dtype=np.int64)
        self._used, self._broken = False, False
        return self._slave

    def _came_back(self, slave: FmuSlave) -> bool:
        """Tell whether a reset is accepted; where it is not, a new instance is made for every run."""
        try:
            slave.reset()
        except OrchestratorError:
            self._fresh = self._broken = True
        return not self._fresh

    def _begun(self, job: Job, start: float, stop: float) -> FmuSlave:
        """Return an instance in initialisation mode, its start values set.

        They are set twice: some FMUs want them before the experiment is set up, others (20-sim's) forget them then.
        """
        slave = self._prepare()
        self._used = self._broken = True
        slave.set(job.starts)
        slave.begin(start, stop, self._tolerance)
        if job.starts and not self._only_before:
            try:
                slave.set(job.starts)
            except OrchestratorError:
                self._only_before = True
                return self._begun(job, start, stop)
        return slave

    def run(self, job: Job, values: Array, start: float, step: float, per_row: int, lead: float) -> Array:
        """Return what is read at every ``per_row``-th step, the initial values first.

        Args:
            job: what is set before and fed back in the run.
            values: (steps, inputs) of every step.
            start: time at which the run starts [s].
            step: communication step [s].
            per_row: steps for each row that is returned.
            lead: steps by which fed-back signals are extrapolated.

        Returns:
            Shape (rows, reads).

        Raises:
            OrchestratorError: the FMU refused or failed a call.
        """
        slave = self._begun(job, start, start + BEYOND * step * len(values))
        if len(self._inputs) and len(values):
            slave.set(dict(zip(self._inputs, values[0].tolist(), strict=True)))
        slave.start()
        out = np.empty((len(values) // per_row + 1, len(self._reads)))
        ports = np.array([[e.input, e.law, e.position, e.velocity] for e in job.effects], dtype=np.int64).reshape(-1, 4)
        sign = np.array([e.sign for e in job.effects], dtype=float)
        q = np.array([e.q for e in job.effects], dtype=float).reshape(-1, 4)
        grid = np.array([start, step, per_row], dtype=float)
        status, call, k = run_loop(
            self._calls, self._counts, self._where, self._sent, self._read, values, grid, ports, sign, q, lead, out
        )
        if status > 1:
            slave.failed(int(status), CALLS[call], start + k * step)
        self._broken = False
        return out
