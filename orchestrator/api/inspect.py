"""What is in a record, what it would show, and a model file to start from."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from orchestrator.api.methods import MethodResult, describe_record, method_entry
from orchestrator.api.plotted import PlottedResult
from orchestrator.api.records import as_record
from orchestrator.api.shown import Block, doubts_of
from orchestrator.diagnosis.data.records import check_whole
from orchestrator.effects.effect import AXIS
from orchestrator.estimation.inspection.channels import (
    channels_of,
    delay_between,
    excitation_of,
    reversals_of,
)
from orchestrator.estimation.inspection.machine import (
    RoughMachine,
    as_model,
    is_of,
    rough_axis,
    rough_machine,
    visible_effects,
)
from orchestrator.estimation.inspection.starter import OF_DEFAULT, assume_columns, blank_starter, starter
from orchestrator.estimation.inspection.sufficiency import SEEN, Sufficiency, sufficiency
from orchestrator.estimation.inspection.verdict import verdict_of
from orchestrator.estimation.methods import two_encoders
from orchestrator.estimation.protocol import Estimate, NotApplicableError
from orchestrator.estimation.zeros import set_zeros
from orchestrator.records.checks import LARGEST_SHARE_MISSING
from orchestrator.records.model_file import DEFAULT, Model, read_model
from orchestrator.records.record import Record
from orchestrator.shared.output import write_arrays
from orchestrator.shared.results.estimate import ExcitationFound
from orchestrator.shared.results.fields import copy_fields
from orchestrator.shared.results.inspect import (
    BandFound,
    ChannelFound,
    EffectShown,
    GapShown,
    InspectFound,
    LagFound,
    ReversalsFound,
    inspect_tables,
)

STARTER = "model.toml"
ALL_FILES = ("inspect.json", "report.html", "inspect_record.npz", "inspect_record.png")
"""What an inspection leaves beside the model file; a later one that refuses its log takes them away."""
OF_GIVEN = "of the model that was given"
OF_FMU = "ASSUMED: what the FMU has when nothing is said; put in the machine's"
ROUGHLY = "roughly, from the record; see the model file"
SHOWN_EXPERIMENTS = 3


@dataclass(frozen=True, repr=False)
class InspectResult(PlottedResult):
    """What a record holds and would show.

    Attributes:
        record: as it was read, with the units it was converted from.
        model: the machine that the judgement is for: the given one, or a rough one from the record.
        channels: facts of each column.
        excitation: the torque's power by frequency.
        delay: lag of the load's angle behind the motor's and its standard error [s], or None.
        reversals: sign changes of torque, None without one, and of motor speed.
        sufficiency: which gaps would be seen, and which experiment would do better.
        effects: the smallest size of each effect that would show, with its unit.
        assumed: what was assumed, a sentence each.
        starter: text of a model file to start from.
        two_angles: the half-gap from the two angles alone, where the log has no torque.
    """

    command: ClassVar[str] = "inspect"
    replaces: ClassVar[tuple[str, ...]] = ("inspect.png",)
    record: Record
    model: Model
    channels: tuple[ChannelFound, ...]
    excitation: tuple[BandFound, ...]
    delay: tuple[float, float] | None
    reversals: tuple[int | None, int]
    sufficiency: Sufficiency
    effects: tuple[EffectShown, ...]
    assumed: tuple[str, ...]
    starter: str
    two_angles: Estimate | None = None

    @property
    def smallest_gap(self) -> float:
        """Smallest half-gap that the record would show [rad], or infinity."""
        return self.sufficiency.smallest

    def verdict(self) -> list[str]:
        """Say whether the record suffices, what it lacks, and what would do better.

        Returns:
            One sentence for each thing that the log shows or lacks.
        """
        return verdict_of(self.sufficiency, self.reversals, self.two_angles, self.assumed)

    def blocks(self) -> Sequence[Block]:
        """Return what was read, the tables and the verdict."""
        r = self.record
        read = [*doubts_of([r]), *([f"{r.source}: {'; '.join(r.notes)}"] if r.notes else [])]
        timing = "" if r.timing is None else f"; {r.timing.describe()}"
        read.append(f"{r.size} rows, {r.duration:g} s{timing}; {r.n_missing} rows with missing samples")
        assumed = [f"Assumed: {'; '.join(self.assumed)}."] if self.assumed else []
        channels, *others = inspect_tables(self.results())
        return [*read, channels, *self._between(), *others, *assumed, *self.verdict()]

    def _between(self) -> list[str]:
        torque, speed = self.reversals
        driven = "" if torque is None else f"the torque changes sign {torque} times, "
        said = [f"{driven}the motor's speed changes sign {speed} times.".capitalize()]
        if self.delay is not None:
            lag, error = self.delay
            said.append(
                f"The load's angle lags the motor's by {1e3 * lag:.3g} ms (standard error {1e3 * error:.2g} ms, "
                f"{lag / self.record.step:.2g} samples); the elastic shaft causes a part of this lag."
            )
        return said

    def results(self, place: Path | None = None) -> InspectFound:
        r, found, angles = self.record, self.sufficiency, self.two_angles
        return copy_fields(
            InspectFound,
            self,
            record=describe_record(r),
            reversals=ReversalsFound(*self.reversals),
            delay=None if self.delay is None else LagFound(*self.delay),
            smallest_gap=found.smallest if math.isfinite(found.smallest) else None,
            gaps=tuple(
                GapShown(size, bound if math.isfinite(bound) else None, bound < SEEN * size)
                for size, bound in found.bounds
            ),
            better_experiments=tuple(
                ExcitationFound(c.name, c.bound, c.torque, c.speed) for c in found.better[:SHOWN_EXPERIMENTS]
            ),
            verdict=tuple(self.verdict()),
            two_angles=None if angles is None else method_entry(MethodResult(angles.method, angles, math.inf, 0.0)),
        )

    def write_data(self, folder: Path) -> None:
        """Write the model file to start from, and the record as it was read."""
        (folder / STARTER).write_text(self.starter, encoding="utf-8")
        r = self.record
        columns = {"time": r.time, "u": r.u if r.has_torque else None, "theta_m": r.theta_m, "theta_l": r.theta_l}
        write_arrays(folder / "inspect_record.npz", {n: values for n, values in columns.items() if values is not None})


def inspect(
    record: Record | Path | str,
    model: Model | None = None,
    *,
    part: tuple[float, float] | None = None,
    resample: str | None = None,
    rate: float | None = None,
    header: int | None = None,
) -> InspectResult:
    """Look at a record before any fit: what is in it, what it would show, what is assumed.

    Args:
        record: a measured record, or its path; with a path, missing factors of units are assumed and said.
        model: the machine (default, and where it states no parameter: the thesis's where the record shows its
            inertia, else a rough one from the record).
        part: first and last time to keep [s] (default: all).
        resample: as ``read_record`` has it.
        rate: as ``read_record`` has it [Hz].
        header: as ``read_record`` has it.

    Returns:
        Channels, excitation, the smallest gap and effects that would show, better experiments and a model file.

    Raises:
        RecordError: the record cannot be read, or a column is missing or ambiguous.
        ScenarioError: the model cannot be read.

    Examples:
        >>> seen = oc.inspect("machine.csv")
        >>> seen.smallest_gap < 0.001
        True
    """
    base = read_model(None) if model is None else model
    base = base if header is None else replace(base, header=header)
    assumed: tuple[str, ...] = ()
    columns = dict(base.columns)
    if not isinstance(record, Record):
        columns, assumed = assume_columns(Path(record), columns, base.header)
        base = replace(base, columns=columns)
    measured = _longest_part(
        as_record(record, base, torque_needed=False, part=part, resample=resample, rate=rate, holes=True)
    )
    machine, origin, more = _machine(measured, base, given=model is not None, sure=not assumed)
    assumed = (*assumed, *more)
    measured = set_zeros(measured, machine)
    with np.errstate(all="ignore"):
        enough = sufficiency(measured, machine)
        effects = visible_effects(measured, machine)
    text = starter(machine, columns, origin, assumed, measured.source)
    return InspectResult(
        measured, machine, tuple(channels_of(measured)), tuple(excitation_of(measured)), delay_between(measured),
        reversals_of(measured), enough, tuple(effects), assumed, text, _of_two_angles(measured, machine),
        arguments={
            "record": measured.source, "model": base.source, "part": part, "resample": resample, "rate": rate,
            "header": header,
        },
    )  # fmt: skip


def draft_model(record: Path | str, model: Model | None = None, *, header: int | None = None, problem: str = "") -> str:
    """Draft a model file for a log that cannot be read yet, with blanks for what is missing.

    Args:
        record: path of the log.
        model: what is stated of its columns already (default: nothing).
        header: as ``read_record`` has it.
        problem: why the log is refused, in one line; the file says it.

    Returns:
        The text: the columns that were recognised, and what each blank means, with its place in data sheets.

    Raises:
        RecordError: the file is no log at all.

    Examples:
        >>> "torque_constant" in oc.draft_model("machine.csv")
        True
    """
    base = read_model(None) if model is None else model
    return blank_starter(Path(record), base.columns, base.header if header is None else header, problem)


def _longest_part(record: Record) -> Record:
    """Return the longest part between holes where these are most of a record; else the record itself."""
    part, parts = record, record.parts_between_holes()
    if record.n_missing > LARGEST_SHARE_MISSING * record.size and len(parts) > 1:
        part = max(parts, key=lambda piece: piece.size)
        note = (
            f"holes divide what was logged into {len(parts)} parts: the longest one is looked at, `diagnose` fits all"
        )
        part = replace(part, notes=(*part.notes, note))
    check_whole(part)
    return part


def _machine(record: Record, base: Model, given: bool, sure: bool) -> tuple[Model, Mapping[str, str], tuple[str, ...]]:
    """Return the machine that the judgement is for, where each of its values is from, and what was assumed."""
    said_of = {name: OF_GIVEN if name in base.stated else OF_DEFAULT for name in base.plant.linear}
    axis = base.fmu == AXIS and record.has_torque
    lacking = [name for name in said_of if name not in base.stated]
    if not lacking or not (axis or base.fmu == DEFAULT):
        return base, said_of | dict.fromkeys(lacking, OF_FMU), ()
    rough = rough_axis(record) if axis else rough_machine(record)
    if axis or (given and len(lacking) < len(said_of)):
        held = dict.fromkeys(said_of, OF_FMU) if axis else {}
        origin = {**held, **rough.origin, **{n: OF_GIVEN for n in base.stated if n in said_of}}
        told = ", ".join(name for name in lacking if name in rough.values)
        return _complete(base, rough), origin, (f"{told} {ROUGHLY}",) if told else ()
    if not record.has_torque:
        return as_model(rough, base), rough.origin, ()
    if sure and is_of(record, base):
        return base, dict.fromkeys(base.plant.linear, OF_DEFAULT), ("the default model's values, each known to 5 %",)
    return as_model(rough, base), rough.origin, (f"inertias, stiffness, friction and lag {ROUGHLY}",)


def _complete(base: Model, rough: RoughMachine) -> Model:
    """Return a model with rough values for what its file does not state."""
    whole = as_model(rough, base)
    return replace(whole, parameters={**whole.parameters, **{name: base.parameters[name] for name in base.stated}})


def _of_two_angles(record: Record, model: Model) -> Estimate | None:
    """Return the half-gap from the two angles of a log without a torque."""
    if record.has_torque:
        return None
    try:
        return two_encoders.estimate(record, model)
    except NotApplicableError:
        return None
