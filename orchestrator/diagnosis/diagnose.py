"""The diagnosis of one record: search, verdict, where, gap."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.admission import check_comparable, check_resolved
from orchestrator.diagnosis.bank import Effect
from orchestrator.diagnosis.fitting import Fit, Parts, split
from orchestrator.diagnosis.free_run import free_run
from orchestrator.diagnosis.likelihood import HEAD, Likelihood, Signals, signals_of
from orchestrator.diagnosis.outcome import Diagnosis, Estimate, Gap, Named, Workings
from orchestrator.diagnosis.plants import Plant, plant_of
from orchestrator.diagnosis.remainder import Predictable, Remainder, remainder
from orchestrator.diagnosis.search import MOST_EFFECTS, Candidate, Search, Step, annealed, in_metres, ladder
from orchestrator.diagnosis.spread import widened
from orchestrator.diagnosis.where import missing_torque, places
from orchestrator.model_file import Model
from orchestrator.record import Record

Array = NDArray[np.float64]

MOST_IN_A_REPEAT = 2  # effects: what shows in one quarter alone explains a gap at once, or not at all
SEGMENT = 2.0  # s, length of a free run; the length of the thesis's tests
LEAST_EXPLAINED = 0.4  # share of the missing log-likelihood that named effects must recover
LEAST_MISSING = 0.05  # per sample: missing log-likelihood below which nothing is left to explain
GROWN = 3.0  # innovations that grow this much on the held-out part speak of something that changes with time
ALIKE = 0.05  # share of the gain within which effects of a family cannot be told apart
EXPLAINED_BY_NOMINAL = 3.0  # per parameter: log-likelihood that re-fitting gains when the nominal values hold

# Units of a plant's table when its position is a length.
METRIC = {"rad": "m", "rad/s": "m/s", "N.m": "N", "kg.m2": "kg", "N.m.s/rad": "N.s/m", "N.m.s2/rad2": "N.s2/m2"}
# Of a ripple along a position: its phase stays an angle, and advances by so many radians a metre.
PERIODIC_METRIC = {"phase": "rad", "cycles_per_rev": "rad/m"}

Progress = Callable[[int, int, str], None]


def diagnose(record: Record, model: Model, progress: Progress = lambda done, expected, what: None) -> Diagnosis:
    """Compare a record with a model; name what is missing.

    Args:
        record: at least 200 samples; one encoder or two.
        model: nominal values and how far each may be off.
        progress: called with (fits done, expected, what was fitted).

    Raises:
        ScenarioError: the model's backlash model cannot be diagnosed, or it is too fast for the record.
        RecordError: nothing moves, or nothing drives.
    """
    plant = plant_of(model)
    check_comparable(record)
    record = record if len(plant.measured) > 1 else record.without_load_encoder()
    nominal = plant.extended(model.values)
    check_resolved(plant, nominal, record.step, model.source)
    tau = float(nominal[plant.index("tau")])
    signals = signals_of(record, tau)
    found = _passes(plant, model, signals, nominal, progress)
    likelihood, parts = found.likelihood, found.parts
    search, best, base_fit, final, left = found.search, found.best, found.base, found.final, found.left
    unknown = found.unknown
    units = METRIC if in_metres(model) else {}
    named = tuple(_name(plant, effect, final, search.steps, units) for effect in best.effects)
    chosen = final
    if unknown:
        chosen = widened(likelihood, plant, base_fit, parts.seen, ())
    verdict = "unknown" if unknown else "effects" if named else _plain_verdict(likelihood, nominal, base_fit, parts)
    untouched = replace(base_fit, p=nominal)
    before = missing_torque(likelihood, plant, untouched if verdict in ("none", "parameters") else base_fit)
    after = missing_torque(likelihood, plant, chosen)
    stages = _stages(nominal, base_fit, search.steps, best, chosen, unknown)
    return Diagnosis(
        verdict=verdict,
        effects=() if unknown else named,
        suspects=named if unknown else (),
        parameters=_parameters(plant, model, chosen),
        where=tuple(replace(place, unit=units.get(place.unit, place.unit)) for place in places(before, signals.h)),
        gap=held_out_gap(plant, signals, nominal, chosen.q, stages, parts.held_out, units.get("rad", "rad")),
        remainder=left,
        warnings=_warnings(found, named, signals.channels, len(plant.measured)),
        corrected={name: float(chosen.p[plant.index(name)]) for name in _changed(plant, nominal, chosen.p)},
        workings=Workings(
            plant, likelihood, parts, nominal, base_fit, chosen, best, tuple(search.steps), before, after
        ),
    )


@dataclass(frozen=True)
class _Found:
    """One pass of the search, with its fits to all that may be looked at."""

    likelihood: Likelihood
    parts: Parts
    search: Search
    best: Candidate
    base: Fit
    final: Fit
    left: Remainder
    floor_off: bool
    unknown: bool


def _passes(plant: Plant, model: Model, signals: Signals, nominal: Array, progress: Progress) -> _Found:
    """Search; where nothing is found but a gap, search again with the parts of the record in other roles."""
    parts, size = split(signals.size, HEAD), signals.size
    likelihood = Likelihood(plant, signals, nominal, parts.validated.stop)
    found = _search(plant, model, likelihood, parts, parts, MOST_EFFECTS, progress)
    if found.unknown:
        # What shows on the deciding part alone (a limit that is reached once) must be fitted to be found.
        exchanged = Parts(slice(size // 4, parts.validated.stop), slice(HEAD, size // 4), parts.held_out)
        again = _search(plant, model, likelihood, parts, exchanged, MOST_IN_A_REPEAT, progress)
        found = found if again.unknown else again
    if found.unknown and found.left.growth > GROWN:
        # What shows on the held-out part alone must be looked at: the first quarter is held out in its place.
        turned = Parts(slice(size // 4, 3 * size // 4), slice(3 * size // 4, size), slice(HEAD, size // 4))
        exchanged = Parts(slice(size // 2, size), slice(size // 4, size // 2), turned.held_out)
        whole = Likelihood(plant, signals, nominal, size)
        again = _search(plant, model, whole, turned, exchanged, MOST_IN_A_REPEAT, progress)
        found = found if again.unknown else again
    return found


def _search(
    plant: Plant, model: Model, likelihood: Likelihood, parts: Parts, used: Parts, most: int, progress: Progress
) -> _Found:  # fmt: skip
    """Search for at most ``most`` effects with the parts ``used``; judge what is left on ``parts``."""
    signals, nominal = likelihood.signals, likelihood.nominal
    search = Search(likelihood, plant, model, used, progress, most)
    base, best = search.run()
    whole = Parts(parts.seen, parts.validated, parts.held_out)
    base_fit = annealed(likelihood, base.fit.p, base.fit.q, base.fit.free, whole, ())
    final = base_fit
    if best.effects:
        final = annealed(likelihood, best.fit.p, best.fit.q, best.fit.free, whole, best.effects)
    final = widened(likelihood, plant, final, whole.fitted, best.effects)
    left = _left(likelihood, plant, base_fit, final, best.fit, parts, ladder(best.effects, final.q)[-1])
    growth = _growth(plant, signals, nominal, final, whole)
    left = replace(left, growth=growth if best.effects else max(growth, left.growth))
    floor_off = left.missing > LEAST_MISSING * (parts.seen.stop - parts.seen.start)
    unknown = (floor_off and left.explained < LEAST_EXPLAINED) or left.growth > GROWN
    return _Found(likelihood, parts, search, best, base_fit, final, left, floor_off, unknown)


def _growth(plant: Plant, signals: Signals, nominal: Array, final: Fit, whole: Parts) -> float:
    """Return how much larger innovations are on the held-out part than where the final model was fitted."""
    z = Likelihood(plant, signals, nominal, signals.size).whitened(final.p, final.q)
    return float(np.max(np.std(z[whole.held_out], axis=0) / np.maximum(np.std(z[whole.fitted], axis=0), 1e-300)))


def held_out_gap(
    plant: Plant,
    signals: Signals,
    nominal: Array,
    q: float,
    stages: Sequence[tuple[str, Array]],
    part: slice,
    unit: str = "rad",
) -> tuple[Gap, ...]:
    """Return the gap of each model over free runs of ``SEGMENT`` seconds that cover a part of a record.

    Args:
        plant: the plant.
        signals: of the record.
        nominal: nominal parameters (they make the filter's gains).
        q: process noise of the filter that guesses each segment's initial state.
        stages: name and parameters of each model, in the order of the report.
        part: the samples, which no fit has touched.
        unit: of the measured positions.
    """
    length = max(round(SEGMENT / signals.h), 40)
    begin, end, _ = part.indices(signals.size)
    starts = list(range(begin, end - length + 1, length)) or [begin]
    whole = Likelihood(plant, signals, nominal, signals.size)
    rows = []
    for name, p in stages:
        _, states = whole.innovations(p, q)
        squares = [free_run(plant, p, states[s], signals, slice(s, min(s + length, end))).rms ** 2 for s in starts]
        rows.append((name, np.sqrt(np.mean(squares, axis=0))))
    return tuple(
        Gap(signal, unit, float(signals.noise[n]), tuple((name, float(rms[n])) for name, rms in rows))
        for n, signal in enumerate(("theta_m", "theta_l")[: signals.channels])
    )


def _left(
    likelihood: Likelihood, plant: Plant, base: Fit, final: Fit, fitted: Fit, parts: Parts, lowest: float
) -> Remainder:  # fmt: skip
    """Return the remainder of the final fit; growth and predictability are those of the fit to the first part.

    ``lowest`` is the level of process noise that the final model could have reached at best.
    """
    seen = remainder(likelihood, plant, base, fitted, parts, lowest)
    floor = seen.missing + fitted.fitted + fitted.validated
    had, left = floor - base.fitted, floor - final.fitted
    explained = 1.0 - left / had if had > 0.0 else 0.0
    return Remainder(left, explained, seen.growth, seen.predictable)


def _plain_verdict(likelihood: Likelihood, nominal: Array, base: Fit, parts: Parts) -> str:
    """Return "none" when the nominal values explain the record as well as re-fitted ones do, else "parameters"."""
    part = parts.seen
    z = likelihood.whitened(nominal, base.q)
    gained = base.fitted - likelihood.log_likelihood(z, base.q, part)
    return "none" if gained < EXPLAINED_BY_NOMINAL * len(base.free) else "parameters"


def _name(plant: Plant, effect: Effect, final: Fit, steps: Sequence[Step], units: Mapping[str, str]) -> Named:
    step = next(s for s in reversed(steps) if any(effect in c.effects[-1:] for c in s.candidates))
    own = next(c for c in step.candidates if c.effects[-1] is effect)
    others = [c for c in step.candidates if c is not own]
    gain = own.gain_over(step.before)
    runner = others[0] if others else None
    alike = [
        c.effects[-1].label
        for c in others
        if effect.family and c.effects[-1].family == effect.family and own.score - c.score < max(8.0, ALIKE * gain)
    ]
    family = (effect.label, *alike) if alike else ()
    parameters = {
        short: Estimate(
            float(final.p[place]),
            final.standard_error(place),
            final.interval(place),
            _unit(short, plant.table[place].unit, units),
        )
        for short, place in effect.places(plant).items()
        if place < len(plant.table)
    }
    margin = own.score - runner.score if runner else gain
    return Named(effect.name, effect.site, parameters, gain, runner.effects[-1].label if runner else "", margin, family)


def _unit(short: str, own: str, units: Mapping[str, str]) -> str:
    return PERIODIC_METRIC[short] if units and short in PERIODIC_METRIC else units.get(own, own)


def _parameters(plant: Plant, model: Model, final: Fit) -> dict[str, dict[str, Any]]:
    return {
        u.name: {
            "nominal": u.value,
            "value": float(final.p[plant.index(u.name)]),
            "standard_error": final.standard_error(plant.index(u.name)),
            "interval": [*final.interval(plant.index(u.name))],
            "unit": METRIC.get(u.unit, u.unit) if in_metres(model) else u.unit,
        }
        for u in model.uncertain
    }


def _changed(plant: Plant, nominal: Array, p: Array) -> list[str]:
    """Return the names of the plant's own parameters whose value differs from the nominal one."""
    return [entry.name for n, entry in enumerate(plant.table) if p[n] != nominal[n]]


def _stages(
    nominal: Array, base: Fit, steps: Sequence[Step], best: Candidate, chosen: Fit, unknown: bool
) -> list[tuple[str, Array]]:
    stages = [("nominal", nominal), ("parameters", base.p)]
    if unknown or not best.effects:
        return stages
    for step in steps[1:]:
        if step.before.effects and step.accepted:
            stages.append((f"+ {step.before.effects[-1].label}", step.before.fit.p))
    return [*stages, (f"+ {best.effects[-1].label}", chosen.p)]


def _warnings(found: _Found, named: Sequence[Named], channels: int, encoders: int) -> tuple[str, ...]:
    left, warnings = found.left, []
    if found.unknown:
        warnings.append(f"a gap is left that nothing in the library explains; it {_kind(left)}")
        if named:
            names = ", ".join(f"{n.name} ({n.site})" for n in named)
            warnings.append(f"{names} would take {100 * max(left.explained, 0):.0f} % of it: too little to be named")
    elif found.floor_off and left.explained < 0.8:
        warnings.append(f"{100 * (1 - left.explained):.0f} % of the gap's evidence is left; it {_kind(left)}")
    for effect in named:
        if effect.family:
            warnings.append(f"this record cannot tell {' from '.join(effect.family)}; {_experiment(effect)}")
    if found.parts.held_out.start < found.parts.fitted.start:
        warnings.append("what is named shows in the last quarter of the record: the first was held out in its place")
    if channels < encoders:
        warnings.append("one encoder: an effect of the shaft and one of the load are harder to tell apart")
    return tuple(warnings)


def _kind(left: Remainder) -> str:
    """Return in words of which kind the rest is."""
    if left.growth > GROWN:
        return f"changes with time: innovations are {left.growth:.1f} times larger on later parts than before"
    top = left.predictable[0] if left.predictable else None
    if top is None or top.gain < 8.0:
        return "does not repeat with speed, twist, angle or input: a disturbance, or something with a memory of its own"
    return f"follows {_words(top)} ({100 * top.share:.0f} % of the innovations on data that was not fitted)"


def _words(entry: Predictable) -> str:
    return {
        "speed": "the speed", "angle": "the angle", "input": "the input", "twist": "the twist of the shaft",
        "twist memory": "the history of the twist (hysteresis)", "memory of position": "the history of the position",
    }[entry.kind] + f" at the {entry.site}"  # fmt: skip


def _experiment(effect: Named) -> str:
    """Return the experiment that would tell the members of a family apart."""
    if "shaft" in effect.site:
        return "torque reversals that swing the twist over the whole range, slowly and then fast, would"
    if "friction" in effect.name:
        return "a slow reversal (speeds well below the Stribeck speed, held for a while) would"
    if "offset" in effect.name:
        return "turning one side by hand through the index mark of its encoder would"
    return "travel over more revolutions would"
