"""Where every signal of a run lies in one flat array, and what feeds every input.

The outputs that somebody needs and the inputs that somebody feeds have one slot each. An instance's outputs are
neighbours, and so are its inputs: a slave reads and writes its slots in place, and a connection is a copy from slot
to slot within one array.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.master import units
from orchestrator.master.protocol import Signals, Variable
from orchestrator.master.signals import Signal
from orchestrator.master.system import System, split

_TYPE_ORDER = {"Real": 0, "Integer": 1, "Enumeration": 1, "Boolean": 2}


@dataclass(frozen=True, slots=True)
class Feed:
    """What an input slot gets before a step: ``round_to(quantum, factor * slots[source] + offset + signal)``."""

    slot: int  # the input's slot
    source: int  # the output's slot, or -1
    factor: float  # of the source, unit conversion included
    offset: float  # in the input's unit
    quantum: float  # resolution, 0 for none
    signal: int  # row of the table of signals, or -1

    @property
    def plain(self) -> bool:
        """Whether the input is a mere copy of the source."""
        return self.source >= 0 and self.signal < 0 and (self.factor, self.offset, self.quantum) == (1.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Block:
    """One instance's part of the array."""

    name: str  # the instance's name
    inputs: tuple[str, ...]  # names of the fed inputs, in the order of their slots
    outputs: tuple[str, ...]  # names of the needed outputs, in the order of their slots
    first_input: int  # slot of the first input
    first_output: int  # slot of the first output
    feeds: tuple[Feed, ...]  # one per fed input, in the order of slots


@dataclass(frozen=True)
class Layout:
    """The plan of one run's signals."""

    blocks: tuple[Block, ...]  # one per instance, in execution order
    size: int
    slots: Mapping[str, int]  # slot by ``instance.variable``
    recorded: tuple[int, ...]  # slots of the recorded signals, in the order asked for
    # for each row of the table of signals, the sources (index into ``System.sources``, factor and offset of the unit
    # conversion, whether the value at the end of the step counts) that are added up in it
    signals: tuple[tuple[tuple[int, float, float, bool], ...], ...]
    system: System  # what was laid out

    def signal_table(self, times: Signals, replaced: Mapping[int, Signal]) -> NDArray[np.float64]:
        """Return what the sources add to inputs: column 0 for initialisation, column ``n + 1`` for step ``n``.

        ``times``: communication points [s], shape (steps + 1,).

        Returns:
            Shape (rows of ``signals``, steps + 1), in the units of the inputs.
        """
        rows = [self.signal_row(row, times, replaced) for row in range(len(self.signals))]
        return np.array(rows).reshape(len(rows), len(times))

    def signal_row(self, row: int, times: Signals, replaced: Mapping[int, Signal]) -> NDArray[np.float64]:
        """Return one row of the table, (steps + 1,) in the input's unit, at the communication points ``times`` [s]."""
        found = np.zeros(len(times))
        for values, at_end in self._source_samples(row, times, replaced):
            found[0] += values[0]
            found[1:] += values[1:] if at_end else values[:-1]
        return found

    def signal_values(self, row: int, times: Signals, replaced: Mapping[int, Signal]) -> NDArray[np.float64]:
        """Return what the sources of a row add at any ``times`` (n,) [s]: (n,) in the unit of the input."""
        return np.sum([values for values, _ in self._source_samples(row, times, replaced)], axis=0)

    def _source_samples(
        self, row: int, times: Signals, replaced: Mapping[int, Signal]
    ) -> Iterator[tuple[NDArray[np.float64], bool]]:
        for index, factor, offset, at_end in self.signals[row]:
            signal = replaced.get(index, self.system.sources[index].signal)
            yield factor * signal.sample(times) + offset, at_end


def lay_out(system: System, record: Sequence[str], simultaneous: bool, states: bool = False) -> Layout:
    """Plan the signals of a sound system."""
    shown = _state_outputs(system) if states else []
    fed = _in_use(system, [c.target for c in system.connections] + [s.target for s in system.sources])
    needed = _in_use(system, [c.source for c in system.connections] + [*record, *shown], fed)
    slots: dict[str, int] = {}
    order = system.execution_order()
    for name in order:
        for variable in (*needed[name], *fed[name]):
            slots.setdefault(f"{name}.{variable}", len(slots))
    signals: list[tuple[tuple[int, float, float, bool], ...]] = []
    blocks = []
    for name in order:
        feeds = tuple(_feed(system, f"{name}.{v}", slots, order, simultaneous, signals) for v in fed[name])
        first_output = slots[f"{name}.{needed[name][0]}"] if needed[name] else 0
        first_input = slots[f"{name}.{fed[name][0]}"] if fed[name] else 0
        blocks.append(Block(name, fed[name], needed[name], first_input, first_output, feeds))
    recorded = tuple(slots[address] for address in record)
    return Layout(tuple(blocks), len(slots), slots, recorded, tuple(signals), system)


def _in_use(
    system: System, addresses: Sequence[str], known: Mapping[str, Sequence[str]] | None = None
) -> dict[str, tuple[str, ...]]:
    """Return the variables at addresses by instance, in order; without those of ``known``."""
    wanted: dict[str, dict[str, Variable]] = {i.name: {} for i in system.instances}
    for address in addresses:
        name, variable = split(address)
        found = system.variable(address)
        assert found is not None
        if known is None or variable not in known[name]:
            wanted[name][variable] = found
    return {i.name: _in_order(wanted[i.name], i.model.variables) for i in system.instances}


def _state_outputs(system: System) -> list[str]:
    """Return the continuous outputs that depend on no input at once: they change as the state does."""
    return [
        f"{instance.name}.{name}"
        for instance in system.instances
        for name, v in instance.model.variables.items()
        if v.causality == "output"
        and v.type == "Real"
        and v.variability == "continuous"
        and not instance.model.depends_on(name)
    ]


def _in_order(variables: Mapping[str, Variable], declared: Mapping[str, Variable]) -> tuple[str, ...]:
    """Return names by type; what shares a reference, as elements of an array do, is together and as declared."""
    firsts: dict[tuple[str, int], int] = {}
    for place, v in enumerate(variables.values()):
        firsts.setdefault((v.type, v.reference), place)
    places = {name: place for place, name in enumerate(declared)} if len(firsts) < len(variables) else {}

    def key(name: str) -> tuple[int, int, int]:
        v = variables[name]
        return _TYPE_ORDER[v.type], firsts[v.type, v.reference], places.get(name, 0)

    return tuple(sorted(variables, key=key))


def _feed(
    system: System,
    target: str,
    slots: Mapping[str, int],
    order: tuple[str, ...],
    simultaneous: bool,
    signals: list[tuple[tuple[int, float, float, bool], ...]],
) -> Feed:
    connection = next((c for c in system.connections if c.target == target), None)
    factor, offset, quantum, source = 1.0, 0.0, 0.0, -1
    newer = system.has_feedthrough(target)
    if connection is not None:
        ratio = units.conversion(system.unit(connection.source), system.unit(target))
        assert ratio is not None
        factor, offset = connection.factor * ratio[0], connection.factor * ratio[1] + connection.offset
        quantum, source = connection.quantum, slots[connection.source]
        newer = order.index(split(connection.source)[0]) < order.index(split(target)[0])
    parts = []
    for index, signal in enumerate(system.sources):
        if signal.target == target:
            ratio = (1.0, 0.0) if signal.unit is None else system.ratio(signal.unit, target)
            assert ratio is not None
            at_end = (newer and not simultaneous) if signal.at is None else signal.at == "end"
            parts.append((index, *ratio, at_end))
    row = -1
    if parts:
        row = len(signals)
        signals.append(tuple(parts))
    return Feed(slots[target], source, factor, offset, quantum, row)
