"""The rows of the bank at their places around an FMU, as effects that the analysis can fit."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.bank import REMEMBERS, BoxEffect
from orchestrator.diagnosis.model.interface import CandidateEffect, Values, WaveScan

Array = NDArray[np.float64]
COMBS = 4
"""Combs that look for a quantum, one within the other."""

AT_REST = "at_rest"
"""Name of a value that is not fitted: 1 where a signal was zero before the record, 0 where it had its first value."""

SORTS = {
    "input_gain": "gain", "output_gain": "gain", "input_offset": "constant", "output_offset": "constant",
    "load": "constant", "input_delay": "timing", "input_lag": "timing", "output_delay": "timing",
    "output_lag": "timing", "input_saturation": "limit", "input_dead_zone": "limit", "input_rate_limit": "limit",
    "input_quantisation": "resolution", "output_quantisation": "resolution", "coulomb_friction": "friction",
    "stribeck_friction": "friction", "quadratic_drag": "speed", "viscous_drag": "speed",
    "directional_friction": "speed", "spring": "position", "hardening_spring": "position", "gravity": "position",
    "ripple": "wave", "hysteresis": "memory", "added_inertia": "inertia", "parameter_drift": "parameter",
    "parameter_dependence": "parameter", "backlash": "gap", "compliance": "resonance",
}  # fmt: skip
POSITIVE = ("coulomb_friction", "stribeck_friction", "quadratic_drag", "viscous_drag", "spring", "hysteresis",
            "compliance")  # fmt: skip


@dataclass(frozen=True, eq=False)
class PlacedEffect:
    """An effect of the bank at a place, and how the analysis sees it."""

    effect: BoxEffect
    candidate: CandidateEffect

    def at(self, values: Values) -> tuple[BoxEffect, Array]:
        """Return the effect and its values as the bank has them."""
        count = len(self.effect.kind.parameters)
        given = self.effect.bounded(np.array(values[:count]))
        at_rest = len(values) > count and values[count] > 0.5
        return replace(self.effect, at_rest=at_rest), given


def place_effects(
    effects: Sequence[BoxEffect],
    motions: dict[str, Array],
    through: Callable[[str, Array], Array],
    starts_off: float,
    linear: bool,
) -> dict[str, PlacedEffect]:
    """Return effects as the analysis sees them, by label.

    Args:
        motions: port -> its position (n,), over which ripples repeat.
        through: port, gradient (outputs, n) by the residuals -> gradient (n,) by the effort at the port.
    """
    sorts = {effect.label: SORTS[effect.kind.name] for effect in effects}
    found = {}
    for effect in effects:
        timing = tuple(o for o, sort in sorts.items() if sort == sorts[effect.label] == "timing" and o != effect.label)
        simpler = f"{effect.kind.needs}@{effect.place}" if effect.kind.needs else ""
        grown = tuple(o.label for o in effects if o.kind.needs == effect.kind.name and o.place == effect.place)
        wave = None
        if effect.kind.name == "ripple":
            wave = _wave_scan(effect, motions[effect.place], through)
        found[effect.label] = PlacedEffect(
            effect, _candidate(effect, wave, simpler, timing + grown, starts_off, linear)
        )
    return found


def _candidate(
    effect: BoxEffect,
    wave: WaveScan | None,
    simpler: str,
    excludes: tuple[str, ...],
    starts_off: float,
    linear: bool,
) -> CandidateEffect:
    kind, scene = effect.kind, effect.scene
    count = len(kind.parameters)
    amplitudes = (0, 1) if kind.name == "stribeck_friction" else tuple(range(effect.amplitudes))
    starts = _starts(effect, amplitudes, linear)
    remembers = kind.name in REMEMBERS and abs(scene.signal[0]) > starts_off * scene.size
    flags = ((0.0,), (1.0,)) if remembers else ((),)
    positive = tuple(n for n in amplitudes if kind.name in POSITIVE)
    return CandidateEffect(
        label=effect.label, kind=SORTS[kind.name], values=(*kind.parameters, *((AT_REST,) if remembers else ())),
        scales=(*kind.scales(scene), *((1.0,) if remembers else ())),
        starts=tuple((*start, *flag) for start in starts for flag in flags), amplitudes=amplitudes,
        fitted=tuple(range(count)), sizes=amplitudes or (0,),
        lower=(*(kind.lower or (-np.inf,) * count), *((0.0,) if remembers else ())), positive=positive, wave=wave,
        comb=COMBS if SORTS[kind.name] == "resolution" else 0,
        contains=(simpler,) if simpler else (), excludes=excludes,
    )  # fmt: skip


def _starts(effect: BoxEffect, amplitudes: Sequence[int], linear: bool) -> list[Values]:
    """Return values to try, those that regression finds at zero."""
    kind, scene = effect.kind, effect.scene
    given = list(kind.starts(scene))
    if kind.name == "stribeck_friction":
        walk = scene.speed * scene.h
        given = [(0.0, 0.0, v * scene.speed, d * walk) for v in (0.1, 0.3) for d in (0.1, 0.6, 3.0)]
    elif not amplitudes and linear:
        given += [(value,) for value in kind.scan(scene)]
    elif kind.name == "ripple":
        given = given[:1]
    starts = [tuple(0.0 if n in amplitudes else v for n, v in enumerate(start)) for start in given]
    return list(dict.fromkeys(starts))


def _wave_scan(effect: BoxEffect, position: Array, through: Callable[[str, Array], Array]) -> WaveScan:
    place = effect.place
    return WaveScan(
        position, 0, len(effect.kind.parameters) - 1, np.array(effect.scene.cycles), lambda g: through(place, g)
    )
