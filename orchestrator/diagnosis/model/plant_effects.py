"""The rows of a plant's bank as effects that the analysis can fit."""

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.model.interface import CandidateEffect, Values, WaveScan
from orchestrator.effects.effect import Effect, SignalScales
from orchestrator.effects.of_plants import LEAST_CYCLES
from orchestrator.plants.description import Plant
from orchestrator.records.columns import Column
from orchestrator.records.model_file import Model

MOST_CYCLES = 40.0  # a revolution: teeth and poles of drives lie below
SINE, COSINE = "sine", "cosine"


def candidate_effects(model: Model, scales: SignalScales, channels: Sequence[str]) -> dict[str, CandidateEffect]:
    """Return the effects that a model may lack, by label, also those that this record cannot show: another one may."""
    plant, own = model.plant, effects_of(model)
    return {
        row.label: _candidate(plant, row, scales, channels)
        for row in plant.bank
        if row.label not in own and (scales.angular or not row.angular)
        and not (row.both_encoders and len(channels) < 2)
    }  # fmt: skip


def effects_of(model: Model) -> tuple[str, ...]:
    """Return the labels of the effects that a model has by its own values."""
    plant = model.plant
    sizes = {row.label: row.places(plant)[row.size] for row in plant.bank}
    return tuple(
        label for label, place in sizes.items()
        if place < len(plant.table) and model.values[place] != plant.entry(place).default
    )  # fmt: skip


def keep_effects(model: Model, labels: Collection[str]) -> Model:
    """Return a model without its effects that are not among some labels: their values are the plant's defaults."""
    plant = model.plant
    kept = {name for row in plant.bank if row.label in labels for name in row.parameters.values()}
    gone = {name for row in plant.bank if row.label in effects_of(model) for name in row.parameters.values()} - kept
    parameters = {
        name: replace(one, value=plant.entry(plant.index(name)).default, uncertainty=0.0) if name in gone else one
        for name, one in model.parameters.items()
    }
    return replace(model, parameters=parameters)


def _candidate(plant: Plant, row: Effect, scales: SignalScales, channels: Sequence[str]) -> CandidateEffect:
    names = _coordinates(row)
    steps, starts = dict(row.scales(scales)), row.starts(scales)
    amplitudes = row.amplitudes
    if row.phase:
        size = steps[row.size]
        steps |= {SINE: size, COSINE: size}
        amplitudes = (SINE, COSINE)
    lists = [starts.get(name, (_default(plant, row, name),)) for name in names]
    wave = _wave_scan(row, scales, channels, names) if "cycles_per_rev" in names else None
    bounds, priors = _bounds(plant, row, scales, names), row.priors(scales)
    fitted = tuple(n for n, name in enumerate(names) if name in steps)
    at = {name: n for n, name in enumerate(names)}
    sizes = amplitudes or (row.size,)
    late_drive = tuple(other.label for other in plant.bank if _delays_drive(other) and other is not row)
    simpler = f"{row.contains}@{row.site}" if row.contains else ""
    grown = tuple(other.label for other in plant.bank if other.contains == row.name and other.site == row.site)
    return CandidateEffect(
        label=row.label, kind=row.kind, values=names, scales=tuple(steps.get(name, 1.0) for name in names),
        starts=tuple(itertools.product(*lists)), amplitudes=tuple(at[name] for name in amplitudes), fitted=fitted,
        sizes=tuple(at[name] for name in sizes), unreported=len(row.unreported),
        lower=tuple(low for low, _ in bounds),
        upper=tuple(high for _, high in bounds),
        positive=() if row.signed or row.phase else tuple(at[name] for name in amplitudes),
        prior={at[name]: prior for name, prior in priors.items()}, wave=wave, contains=(simpler,) if simpler else (),
        excludes=(late_drive if _delays_drive(row) else ()) + grown,
        takes_drive=row.takes_drive, of_log=row.measurement,
    )  # fmt: skip


def _delays_drive(row: Effect) -> bool:
    """Tell whether an effect makes the drive's torque late: of these a record shows one at most."""
    return row.kind == "timing" and not row.both_encoders


def _coordinates(row: Effect) -> tuple[str, ...]:
    """Return the names of an effect's values: amplitude and phase become sine and cosine."""
    names = [name for name in row.parameters if not (row.phase and name in (row.size, row.phase))]
    return (*((SINE, COSINE) if row.phase else ()), *names, *row.unreported)


def _default(plant: Plant, row: Effect, name: str) -> float:
    if name in (SINE, COSINE) or name in row.amplitudes:
        return 0.0
    return plant.entry(row.places(plant)[name]).default


def _bounds(plant: Plant, row: Effect, scales: SignalScales, names: Sequence[str]) -> list[tuple[float, float]]:
    narrower, places = row.bounds(scales), row.places(plant)
    found = []
    for name in names:
        if name in (SINE, COSINE):
            found.append((-math.inf, math.inf))
            continue
        entry = plant.entry(places[name])
        low, high = narrower.get(name, (entry.minimum, entry.maximum))
        found.append((max(low, entry.minimum), min(high, entry.maximum)))
    return found


def _wave_scan(row: Effect, scales: SignalScales, channels: Sequence[str], names: Sequence[str]) -> WaveScan:
    """Return where cycles are looked for: so close that no line lies between, up to what the samples follow."""
    phase = scales.angles[row.wave_site]
    spacing = max(0.35 / scales.turns, 0.01)
    least = LEAST_CYCLES / scales.turns
    channel = channels.index(row.site) if row.site in channels else len(channels) - 1
    return WaveScan(phase, channel, list(names).index("cycles_per_rev"), np.arange(least, MOST_CYCLES, spacing))


def effect_parameters(plant: Plant, effect: CandidateEffect, values: Values) -> Mapping[str, float]:
    """Return an effect's values by name in the plant's table; sine and cosine as amplitude and phase."""
    row = plant.effect(effect.label)
    given = dict(zip(effect.values, values, strict=True))
    if row.phase:
        sine, cosine = given.pop(SINE), given.pop(COSINE)
        given |= {row.size: math.hypot(sine, cosine), row.phase: math.atan2(cosine, sine)}
    full = {**row.parameters, **row.unreported}
    return {full[short]: value for short, value in given.items()}


METRIC = {"rad": "m", "rad/s": "m/s", "N.m": "N", "kg.m2": "kg", "N.m.s/rad": "N.s/m", "N.m.s2/rad2": "N.s2/m2",
          "N.m/s": "N/s", "N.m/rad": "N/m"}  # fmt: skip
# Of a wave along a position: its phase stays an angle, and advances by so many radians a metre.
PERIODIC = {"phase": "rad", "cycles_per_rev": "rad/m"}


def in_metres(model: Model) -> bool:
    """Tell whether the model's position is a length."""
    column = model.columns.get("theta_m")
    return column is not None and column.unit in ("m", "mm")


def unit_in(unit: str, model: Model, parameter: str = "") -> str:
    """Return the unit of a parameter of the plant's table, or of a signal, as a model and its log have it."""
    metric = in_metres(model)
    if metric:
        unit = PERIODIC.get(parameter, METRIC.get(unit, unit))
    if own := _unit_of_log(model):  # an inertia is a torque for an acceleration
        inertia, torque, path = ("kg", "N", "m") if metric else ("kg.m2", "N.m", "rad")
        unit = f"{own}.s2/{path}" if unit == inertia else unit.replace(torque, own)
    return unit


def _unit_of_log(model: Model) -> str:
    """Return the unit of a torque that nothing turns into N.m: sizes are in it; "": it is in N.m or N."""
    u = model.columns.get("u", Column())
    if u.torque_constant == 1.0:
        return "A" if u.resistance is None else "V" if u.resistance == 1.0 else ""
    return "%" if u.rated_value == 100.0 else ""
