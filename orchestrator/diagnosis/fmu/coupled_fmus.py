"""The child's side: FMUs opened behind the walls, coupled to one another, that run a record many times over.

Requests are plain data and arrays, pickled: runs that share a table send it once.
"""

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orchestrator.diagnosis.fmu.loop import LOOP
from orchestrator.diagnosis.fmu.loop_kernel import AWAY, SET, STEP
from orchestrator.errors import FmuError, OrchestratorError, SlaveError
from orchestrator.fmi.instances import make_slave
from orchestrator.fmi.model_description import read_description
from orchestrator.fmi.slave import FmuSlave
from orchestrator.fmi.slave3 import Fmu3Slave
from orchestrator.master.protocol import NativeTransfer, Value
from orchestrator.master.result import MOST_REMARKS, RunRemark
from orchestrator.master.system import split
from orchestrator.shared.arrays import Array

BEYOND = 1.01
"""Stop time that an FMU is given, over the length of the run: some refuse steps beyond one of their own."""


@dataclass(frozen=True)
class Feedthrough:
    """What wire ``wire`` hands on depends at once, by ``gain``, on what wire ``by`` feeds."""

    wire: int
    by: int
    gain: float


@dataclass(frozen=True)
class LoadRequest:
    """Load the FMUs; set ``inputs``, read ``reads``.

    ``members``: folder by name; variables of a member are called ``name.variable``, those of a lone FMU, whose name is
    empty, as they are. ``tunables``: parameters that runs with further columns in their table set at every step.
    ``wires``: target, source, factor and offset: ``inputs[target] += factor * reads[source] + offset``.
    """

    members: dict[str, str]
    inputs: list[str]
    reads: list[str]
    tolerance: float | None = None
    tunables: list[str] = field(default_factory=list)
    wires: list[tuple[int, int, float, float]] = field(default_factory=list)


@dataclass(frozen=True)
class Run:
    """One run: start values by name, inputs (steps, inputs) that are held over each step, effects at ports and cuts."""

    starts: dict[str, Value]
    table: Array
    # of each effect: place of the input, law, places of position and speed (-1: differentiated)
    ports: tuple[tuple[int, ...], ...] = ()
    # of each effect: its four parameters, the direction in which the input pushes, the effort that ends a run
    laws: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True)
class Batch:
    """Runs from one time [s] at one communication step [s]; ``fresh``: a new instance for every run, no reset."""

    start: float
    step: float
    runs: list[Run]
    feedthrough: list[Feedthrough] = field(default_factory=list)
    fresh: bool = False


class Ran(NamedTuple):
    """What became of one run: what was read (steps + 1, reads), or why it failed."""

    rows: Array | None
    reason: str = ""


@dataclass(frozen=True)
class RanBatch:
    """What became of the runs of a batch, in their order, the time taken [s], and what was to be remarked."""

    runs: tuple[Ran, ...]
    seconds: float
    remarks: tuple[RunRemark, ...]


def open_fmus(request: LoadRequest) -> Callable[[Batch], RanBatch]:
    """Return what runs batches."""
    fmus = CoupledFmus(request)

    def run(job: Run, batch: Batch) -> Ran:
        try:
            rows = fmus.run(job, batch)
        except OrchestratorError as error:
            return Ran(None, str(error))
        return Ran(rows) if np.all(np.isfinite(rows)) else Ran(None, "it returned values that are not finite")

    def run_batch(batch: Batch) -> RanBatch:
        begun = time.monotonic()
        ran = tuple(run(job, batch) for job in batch.runs)
        return RanBatch(ran, time.monotonic() - begun, tuple(fmus.take_remarks()[:MOST_REMARKS]))

    return run_batch


def split_name(name: str, members: Mapping[str, object]) -> tuple[str, str]:
    """Return the FMU that a variable belongs to, and what it is called there."""
    return ("", name) if "" in members else split(name)


def _is_plain(transfers: Sequence[NativeTransfer]) -> bool:
    """Tell whether doubles are set or read in one call, as many as there are variables."""
    return len(transfers) <= 1 and all(t.number == "f8" and t.count == len(t.references) for t in transfers)


class MemberFmu:
    """An instance of one FMU that is reset, or made anew, before every run.

    ``inputs`` and, where a run asks for it, ``tunables`` are set at every step; ``reads`` are read after it.
    """

    def __init__(
        self, path: Path, tolerance: float | None, inputs: list[str], tunables: list[str], reads: list[str]
    ) -> None:  # fmt: skip
        self._path, self._tolerance = path, tolerance
        self._description = read_description(path, events=False)
        variables = self._description.model.variables
        for name in (*inputs, *tunables, *reads):
            if name not in variables or variables[name].type != "Real":
                raise FmuError(f"{path}: `{name}` must be a variable of type Real, but is not")
        self.inputs, self.tunables, self.reads = inputs, tunables, reads
        self._remarks: list[RunRemark] = []  # of instances that are gone
        self._refuses_reset = False
        self.slave = self._make()

    def _make(self) -> FmuSlave:
        slave = make_slave("box", self._path, self._description)
        native = slave.native_calls([*self.inputs, *self.tunables], self.reads)
        if native is None or not all(map(_is_plain, (native.inputs, native.outputs))):
            raise FmuError(f"{self._path}: what is set and read must be of 64 bits and no part of an array, but is")
        self.native = native
        self._used, self.broken = False, False  # the latter: by a run that did not end well, it is not called again
        return slave

    def take_remarks(self) -> list[RunRemark]:
        """Return what the FMU had to say of runs that went on, and forget it."""
        remarks, self._remarks = self._remarks, []
        return [*remarks, *self.slave.take_remarks()]

    def name_of_call(self, call: int) -> str:
        """Return the name of the function that ``run_loop`` names by a number."""
        if call == STEP:
            return self.native.step_name
        return (self.native.inputs if call == SET else self.native.outputs)[0].name

    def begin(self, starts: Mapping[str, Value], start: float, stop: float, fresh: bool) -> FmuSlave:
        """Return an instance in initialisation mode, its start values set, for a run from ``start`` to ``stop`` [s]."""
        if self._used and (fresh or not self._reset()):
            self._remarks += self.slave.take_remarks()
            if not self.broken:
                with contextlib.suppress(OrchestratorError):
                    self.slave.terminate()
                self.slave.close()
            self.broken = True  # until there is another
            self.slave = self._make()
        self._used = self.broken = True
        self.slave.set(starts)
        self.slave.begin(start, stop, self._tolerance)
        return self.slave

    def _reset(self) -> bool:
        """Tell whether a reset is accepted; where it is not, a new instance is made for every run."""
        if self._refuses_reset or self.broken:
            return False
        try:
            self.slave.reset()
        except OrchestratorError:
            self._refuses_reset = self.broken = True
        return not self._refuses_reset


class CoupledFmus:
    """One FMU, or several that hand values to one another, behind one list of inputs and one of what is read."""

    def __init__(self, request: LoadRequest) -> None:
        members, self._request = request.members, request
        owners = {n: split_name(n, members) for n in (*request.inputs, *request.tunables, *request.reads)}

        self._members = {}
        for name, path in members.items():
            lists = (request.inputs, request.tunables, request.reads)
            mine = ([owners[full][1] for full in names if owners[full][0] == name] for names in lists)
            self._members[name] = MemberFmu(Path(path), request.tolerance, *mine)
        sent: dict[tuple[str, str], int] = {}
        read: dict[tuple[str, str], int] = {}
        self._first: list[tuple[int, int]] = []  # where a member's values begin
        for name, member in self._members.items():
            self._first.append((len(sent), len(read)))
            sent |= {(name, v): len(sent) + k for k, v in enumerate([*member.inputs, *member.tunables])}
            read |= {(name, v): len(read) + k for k, v in enumerate(member.reads)}
        self._sent, self._read = np.zeros(max(len(sent), 1)), np.zeros(max(len(read), 1))
        names = (*request.inputs, *request.tunables)
        self._into = np.array([sent[owners[name]] for name in names], dtype=np.int64)
        self._outof = np.array([read[owners[name]] for name in request.reads], dtype=np.int64)
        self._wires = np.array([wire[:2] for wire in request.wires], dtype=np.int64).reshape(-1, 2)
        self._gains = np.array([wire[2:] for wire in request.wires], dtype=float).reshape(-1, 2)

    def run(self, job: Run, batch: Batch) -> Array:
        """Return what is read (steps + 1, reads): the initial values, then what follows each step."""
        values, start, step = np.ascontiguousarray(job.table), batch.start, batch.step
        self._begin(job, values, batch)
        calls, counts, where = self._tables(values.shape[1] > len(self._request.inputs))
        out = np.empty((len(values) + 1, len(self._request.reads)))
        ports = np.array(job.ports, dtype=np.int64).reshape(-1, 4)
        laws = np.array(job.laws, dtype=float).reshape(-1, 6)
        passing = np.array([[t.wire, t.by] for t in batch.feedthrough], dtype=np.int64).reshape(-1, 2)
        gains = np.array([t.gain for t in batch.feedthrough], dtype=float)
        warned, astray = np.zeros((len(self._members), 3), dtype=np.int64), np.zeros((len(self._members), 3))
        last, handed = np.zeros((len(ports), 3)), np.zeros((len(self._wires), 4))
        outcome = np.zeros(4, dtype=np.int64)
        LOOP.run_loop(
            calls, counts, where, self._sent, self._read, self._into[: values.shape[1]], self._outof, values, start,
            step, self._wires, self._gains, passing, gains, ports, laws, last, handed, warned, astray, outcome, out,
        )  # fmt: skip
        status, call, k, n = outcome.tolist()
        members = list(self._members.values())
        for member, (count, first, at) in zip(members, warned.tolist(), strict=True):
            if count:
                member.slave.note_warnings(count, member.name_of_call(first), start + at * step)
        for member, (number, begin, off) in zip(members, astray.tolist(), strict=True):
            if number:
                assert isinstance(member.slave, Fmu3Slave)
                member.slave.came_elsewhere(int(number), start + begin * step, off)
        if status > 1 and call != AWAY:
            reached = start + k * step
            members[n].slave.raise_for_status(int(status), members[n].name_of_call(call), reached, reached, step)
        for member in members:
            member.broken = False
        if call == AWAY:
            raise SlaveError(
                f"efforts at ports must stay within those of the drive, but run away at {start + k * step:g} s"
            )
        return out

    def take_remarks(self) -> list[RunRemark]:
        """Return what the FMUs had to say of runs that went on, and forget it."""
        return [replace(r, instance=name) for name, member in self._members.items() for r in member.take_remarks()]

    def _begin(self, job: Run, values: Array, batch: Batch) -> None:
        """Bring all members to where the first step begins."""
        names = [*self._request.inputs, *self._request.tunables][: values.shape[1]]
        first = {} if not len(values) else dict(zip(names, values[0].tolist(), strict=True))
        stop = batch.start + BEYOND * batch.step * len(values)
        begun = {}
        for name, member in self._members.items():
            begun[name] = member.begin(self._of(name, job.starts), batch.start, stop, batch.fresh)
            if mine := self._of(name, first):
                begun[name].set(mine)
        for slave in begun.values():
            slave.start()

    def _of(self, member: str, values: Mapping[str, Value]) -> dict[str, Value]:
        """Return the values of one member, by its own names."""
        placed = [(split_name(name, self._members), value) for name, value in values.items()]
        return {variable: value for (owner, variable), value in placed if owner == member}

    def _tables(self, tuned: bool) -> tuple[Array, Array, Array]:
        """Return components and functions, numbers of values and addresses of every member, for the loop."""
        calls, counts, where = [], [], []
        for (sent, read), member in zip(self._first, self._members.values(), strict=True):
            native, none = member.native, np.zeros(1, dtype=np.uint32)
            ends = [t[0] if t else None for t in (native.inputs, native.outputs)]
            functions = [0 if t is None else t.function for t in ends]
            calls.append([native.component, functions[0], native.do_step, functions[1], int(native.reports)])
            counts.append([len(member.inputs) + (len(member.tunables) if tuned else 0), len(member.reads)])
            values = self._sent[sent:].ctypes.data, self._read[read:].ctypes.data
            references = [(none if t is None else t.references).ctypes.data for t in ends]
            where.append([references[0], values[0], references[1], values[1]])
        return tuple(np.array(rows, dtype=np.int64) for rows in (calls, counts, where))  # type: ignore[return-value]
