"""FMUs in this process, ready to run a record many times over."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from orchestrator.diagnosis.fmu.loop import AWAY, SET, STEP, run_loop
from orchestrator.diagnosis.fmu.wire import Array, Batch, Job, Load
from orchestrator.errors import FmuError, OrchestratorError, SlaveError
from orchestrator.fmi.instances import make_slave
from orchestrator.fmi.model_description import read_description
from orchestrator.fmi.slave import FmuSlave
from orchestrator.fmi.slave3 import Fmu3Slave
from orchestrator.master.protocol import NativeTransfer, Value
from orchestrator.master.result import RunRemark
from orchestrator.master.system import split

BEYOND = 1.01
"""Stop time that an FMU is told, over the length of the run: some refuse steps beyond one of their own."""


def owned(name: str, members: Mapping[str, object]) -> tuple[str, str]:
    """Return the FMU that a variable belongs to, and what it is called there."""
    return ("", name) if "" in members else split(name)


def _plain(transfers: Sequence[NativeTransfer]) -> bool:
    """Tell whether doubles are set or read in one call, as many as there are variables."""
    return not transfers or (
        len(transfers) == 1 and transfers[0].number == "f8" and transfers[0].count == len(transfers[0].references)
    )


class Member:
    """An instance of one FMU that is reset, or made anew, before every run.

    Args:
        inputs, tunables: variables that are set at every step, the latter only where a run asks for it.
        reads: variables that are read after every step.
        tolerance: of the FMU's own solver; None: its own.
    """

    def __init__(
        self,
        path: Path,
        inputs: Sequence[str],
        tunables: Sequence[str],
        reads: Sequence[str],
        tolerance: float | None,
    ) -> None:
        self._path, self._tolerance = path, tolerance
        self._description = read_description(path, events=False)
        variables = self._description.model.variables
        for name in (*inputs, *tunables, *reads):
            if name not in variables or variables[name].type != "Real":
                raise FmuError(f"{path}: `{name}` must be a variable of type Real, but is not")
        self.inputs, self.tunables, self.reads = list(inputs), list(tunables), list(reads)
        self._slave: FmuSlave | None = None
        self._said: list[RunRemark] = []  # of instances that are gone
        self._used = self._broken = self._refused = False  # the last: it refuses a reset
        self._prepare(False)

    @property
    def slave(self) -> FmuSlave:
        """Return the instance."""
        assert self._slave is not None
        return self._slave

    def take_remarks(self) -> list[RunRemark]:
        """Return what the FMU had to say of runs that went on, and forget it."""
        said, self._said = self._said, []
        return [*said, *(self._slave.take_remarks() if self._slave else ())]

    def done(self) -> None:
        """Note that the run went well: the instance may be reset."""
        self._broken = False

    def _prepare(self, fresh: bool) -> FmuSlave:
        """Return an instance in the condition of a new one, or a new one."""
        if self._slave is not None and self._used:
            if not fresh and not self._refused and not self._broken and self._came_back(self._slave):
                self._used = False
                return self._slave
            slave, self._slave = self._slave, None
            self._said += slave.take_remarks()
            if not self._broken:
                with contextlib.suppress(OrchestratorError):
                    slave.terminate()
                slave.close()
        if self._slave is None:
            self._slave = make_slave("box", self._path, self._description)
            native = self._slave.native_calls([*self.inputs, *self.tunables], self.reads)
            if native is None or not all(map(_plain, (native.inputs, native.outputs))):
                raise FmuError(f"{self._path}: what is set and read must be of 64 bits and no part of an array, but is")
            self.native = native
        self._used, self._broken = False, False
        return self._slave

    def called(self, call: int) -> str:
        """Return the name of the function that ``run_loop`` names by a number."""
        if call == STEP:
            return self.native.step_name
        return (self.native.inputs if call == SET else self.native.outputs)[0].name

    def _came_back(self, slave: FmuSlave) -> bool:
        """Tell whether a reset is accepted; where it is not, a new instance is made for every run."""
        try:
            slave.reset()
        except OrchestratorError:
            self._refused = self._broken = True
        return not self._refused

    def begun(self, starts: Mapping[str, Value], start: float, stop: float, fresh: bool) -> FmuSlave:
        """Return an instance in initialisation mode, its start values set.

        Args:
            start, stop: of the run [s].
        """
        slave = self._prepare(fresh)
        self._used = self._broken = True
        slave.set(starts)
        slave.begin(start, stop, self._tolerance)
        return slave


class Box:
    """One FMU, or several that hand values to one another, behind one list of inputs and one of what is read.

    Args:
        request: what is loaded, set and read.
    """

    def __init__(self, request: Load) -> None:
        members, self._request = request.members, request
        owners = {n: owned(n, members) for n in (*request.inputs, *request.tunables, *request.reads)}

        def of(member: str, names: Sequence[str]) -> list[str]:
            return [owners[name][1] for name in names if owners[name][0] == member]

        self._members = {
            name: Member(
                Path(path), of(name, request.inputs), of(name, request.tunables), of(name, request.reads),
                request.tolerance,
            )
            for name, path in members.items()
        }  # fmt: skip
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
        self._wires = np.array([[w.target, w.source] for w in request.wires], dtype=np.int64).reshape(-1, 2)
        self._gains = np.array([[w.factor, w.offset] for w in request.wires], dtype=float).reshape(-1, 2)

    def run(self, job: Job, batch: Batch) -> Array:
        """Return what is read at every ``per_row``-th step, the initial values first.

        Returns:
            Shape (rows, reads).
        """
        values, start, step, per_row = batch.tables[job.table], batch.start, batch.step, batch.per_row
        self._begin(job, values, batch)
        calls, counts, where = self._tables(values.shape[1] > len(self._request.inputs))
        out = np.empty((len(values) // per_row + 1, len(self._request.reads)))
        ports = np.array([[e.input, e.law, e.position, e.velocity] for e in job.effects], dtype=np.int64).reshape(-1, 4)
        sign = np.array([e.sign for e in job.effects], dtype=float)
        q = np.array([e.q for e in job.effects], dtype=float).reshape(-1, 4)
        most = np.array([e.most for e in job.effects], dtype=float)
        grid = np.array([start, step, per_row], dtype=float)
        passing = np.array([[t.wire, t.by] for t in batch.through], dtype=np.int64).reshape(-1, 2)
        passed = np.array([t.gain for t in batch.through], dtype=float)
        into = self._into[: values.shape[1]]
        warned = np.zeros((len(self._members), 3), dtype=np.int64)
        astray = np.zeros((len(self._members), 3))
        status, call, k, n = run_loop(
            calls, counts, where, self._sent, self._read, into, self._outof, values, grid, self._wires, self._gains,
            passing, passed, ports, sign, q, most, batch.lead, warned, astray, out,
        )  # fmt: skip
        members = list(self._members.values())
        for member, (count, first, at) in zip(members, warned.tolist(), strict=True):
            if count:
                member.slave.warned(count, member.called(first), start + at * step)
        for member, (number, begin, off) in zip(members, astray.tolist(), strict=True):
            if number:
                assert isinstance(member.slave, Fmu3Slave)
                member.slave.came_elsewhere(int(number), start + begin * step, off)
        if call == AWAY:
            for member in members:
                member.done()
            raise SlaveError(
                f"efforts at ports must stay within those of the drive, but run away at {start + k * step:g} s"
            )
        if status > 1:
            members[n].slave.failed(int(status), members[n].called(call), start + k * step, start + k * step)
        for member in members:
            member.done()
        return out

    def take_remarks(self) -> list[RunRemark]:
        """Return what the FMUs had to say of runs that went on, and forget it."""
        return [replace(r, instance=name) for name, member in self._members.items() for r in member.take_remarks()]

    def _begin(self, job: Job, values: Array, batch: Batch) -> None:
        """Bring all members to where the first step begins."""
        names = [*self._request.inputs, *self._request.tunables][: values.shape[1]]
        first = {} if not len(values) else dict(zip(names, values[0].tolist(), strict=True))
        stop = batch.start + BEYOND * batch.step * len(values)
        begun = {}
        for name, member in self._members.items():
            begun[name] = member.begun(self._of(name, job.starts), batch.start, stop, batch.fresh)
            if mine := self._of(name, first):
                begun[name].set(mine)
        for slave in begun.values():
            slave.start()

    def _of(self, member: str, values: Mapping[str, Value]) -> dict[str, Value]:
        """Return the values of one member, by its own names."""
        placed = [(owned(name, self._members), value) for name, value in values.items()]
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
