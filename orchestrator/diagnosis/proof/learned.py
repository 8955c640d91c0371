"""A law learned from what no effect explains: knots over the signal that predicts it best, fitted inside the predictor.

It is drawn, never named: the verdict stays "unknown". Every argument that the plant offers is screened by regression;
the most promising are fitted in full, together with the uncertain parameters, and the deciding part chooses. Time is an
argument where the missing torque repeats by a clock of its own. Where nothing lasting is found, a law that begins at
some time is looked for, in the later parts of what may be looked at. The law is then fitted to all of it, and judged by
free runs over the held-out part.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.fit.spread import widened
from orchestrator.diagnosis.outcome import LearnedLaw
from orchestrator.diagnosis.proof.clocked import cycle_of
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.search.candidate import annealed
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Screen
from orchestrator.diagnosis.verdict.where import missing_torque
from orchestrator.plants.effects import Effect, Scene
from orchestrator.plants.learned import (
    CYCLE_L,
    CYCLE_M,
    DRIVE,
    KNOTS,
    LOAD_ANGLE,
    LOAD_SPEED,
    MOTOR_SPEED,
    PERIOD,
    SINCE,
    TWIST,
    Argument,
    arguments_of,
    cycles_of,
    later_arguments_of,
    names,
    with_law,
)
from orchestrator.shared.cores import spread
from orchestrator.shared.inference.normal import NORMAL_95

Array = NDArray[np.float64]


SPEEDS = (MOTOR_SPEED, LOAD_SPEED)  # dry friction jumps where they change sign
JUMP = 0.005  # of a speed's range: within so much of zero, friction turns round


@dataclass(frozen=True)
class _Offer:
    """An argument that may be tried: its knots, the model with them and without the torque, what else is fitted."""

    argument: Argument
    knots: Array
    bare: Array
    free: tuple[Free, ...] = ()


@dataclass(frozen=True)
class _Tried:
    """One argument that was fitted: its knots, its effect and the fit."""

    argument: Argument
    knots: Array
    effect: Effect
    fit: Fit


def learned_law(likelihood: RecordLikelihood, base: Fit, parts: Parts, unit: str) -> LearnedLaw | None:
    """Return the law that explains most of what re-fitted parameters leave.

    Args:
        likelihood: of the record, over what may be looked at.
        base: the fit of re-fitted parameters alone.
        parts: of the record.
        unit: of the measured positions.

    Returns:
        The law; None: none predicts data that its fit has not seen.
    """
    added = likelihood.plant.resonance
    carried = added is not None and base.p[likelihood.plant.index(added.inertia)] > 0.0
    clocked = not likelihood.signals.runs and not carried  # several records have no common clock
    plant = with_law(likelihood.plant, clocked)
    nuisances = plant.nuisances[len(likelihood.plant.nuisances) :]
    nominal = np.array([*likelihood.nominal, *(entry.default for entry in nuisances)])
    wide = RecordLikelihood(plant, likelihood.signals, nominal, likelihood.stop, likelihood.settings)
    found, start = None, base
    for later in (False, True) if clocked else (False,):
        used = _late(parts) if later else parts
        start = annealed(wide, _widened(base.p, nominal), base.q, base.free, used, ())
        _, states = wide.innovations(start.p, start.q)
        offers = _begun(wide, start, states, used) if later else _lasting(wide, start, states, used, clocked)
        found = _best(wide, base, start, offers, used)
        if found is not None:
            return _judged(wide, found, start, parts, unit)
    return None


def _late(parts: Parts) -> Parts:
    """Return the parts in the roles that show what begins late: the later two thirds, the last of them deciding."""
    seen = parts.seen
    size = seen.stop - seen.start
    cut = seen.stop - size // 9
    return Parts(slice(seen.start + size // 3, cut), slice(cut, seen.stop), parts.held_out)


def _best(
    wide: RecordLikelihood, base: Fit, start: Fit, offers: Sequence[_Offer], parts: Parts
) -> _Tried | None:  # fmt: skip
    """Return the best fit of the most promising offers; None: none leaves so little that it is worth a curve."""
    settings, scene = wide.settings.learned, scene_of(wide, start)
    promising = []
    for offer in offers:
        effect = _effect(offer.argument)
        guesses = Screen(wide, replace(start, p=offer.bare), parts).guesses(effect, scene)
        if guesses:
            promising.append((guesses[0].gain, offer, effect, guesses[0].values))
    promising.sort(key=lambda entry: -entry[0])
    tried = []
    for _, offer, effect, values in promising[: settings.fitted]:
        free = (*_free(wide, base, effect, scene), *offer.free)
        p = effect.put(wide.plant, offer.bare, values, ())
        fitted = annealed(wide, p, start.q, free, parts, ())
        if offer.argument.later:
            fitted = _begun_better(wide, fitted, parts)
        tried.append(_Tried(offer.argument, offer.knots, effect, fitted))
    best = min(tried, key=lambda one: _left(wide, one, start, parts), default=None)
    return None if best is None or _left(wide, best, start, parts) > settings.left else best


def _lasting(wide: RecordLikelihood, start: Fit, states: Array, parts: Parts, clocked: bool) -> list[_Offer]:
    """Return the laws over a signal of the plant, and over time where the missing torque repeats by a clock."""
    plant, offers = wide.plant, []
    for argument in arguments_of(plant):
        knots = knots_of(signal_of(wide, start.p, states, argument)[parts.fitted], argument.kind in SPEEDS)
        if knots is not None:
            offers.append(_Offer(argument, knots, _with_knots(plant.index, start.p, argument, knots)))
    if not clocked:
        return offers
    missing = missing_torque(wide, start)
    rows = slice(0, parts.fitted.stop - wide.settings.likelihood.settled)
    shown = wide.signals.u[wide.settings.likelihood.settled :][rows]
    for argument in cycles_of(plant):
        torque = missing.torque[f"torque of the {argument.site}"][rows]
        cycle = cycle_of(torque, shown, missing.time[rows], KNOTS, wide.settings.learned.cycle)
        if cycle is None:
            continue
        bare = _with_knots(plant.index, start.p, argument, cycle.knots)
        place = plant.index(PERIOD)
        bare[plant.index(SINCE)], bare[place] = cycle.since, cycle.period
        span = (cycle.period - cycle.resolution, cycle.period + cycle.resolution)
        free = Free(place, cycle.resolution, *span, (cycle.period, cycle.resolution))
        offers.append(_Offer(argument, cycle.knots, bare, (free,)))
    return offers


def _begun(wide: RecordLikelihood, start: Fit, states: Array, parts: Parts) -> list[_Offer]:
    """Return the laws over a signal that begin at some time, each at the time that promises most."""
    plant, h, count = wide.plant, wide.signals.h, wide.settings.learned.starts
    scene, offers = scene_of(wide, start), []
    first, step = h * parts.fitted.start, h * (parts.fitted.stop - parts.fitted.start) / (count + 1)
    for argument in later_arguments_of(plant) if count else ():
        signal = signal_of(wide, start.p, states, argument)

        def tried(since: float, argument: Argument = argument, signal: Array = signal) -> tuple[float, float, _Offer]:
            acting = signal[max(int(since / h), parts.fitted.start) : parts.fitted.stop]
            knots = knots_of(acting, argument.kind in SPEEDS)
            if knots is None:
                return 0.0, since, _Offer(argument, start.p, start.p)
            bare = _with_knots(plant.index, start.p, argument, knots)
            bare[plant.index(SINCE)] = since
            guesses = Screen(wide, replace(start, p=bare), parts).guesses(_effect(argument), scene)
            return (guesses[0].gain if guesses else 0.0), since, _Offer(argument, knots, bare)

        best = max((tried(first + step * n) for n in range(1, count + 1)), key=lambda one: one[0])
        nearby = best[1] + step * np.linspace(-1.0, 1.0, count + 2)[1:-1]
        best = max((best, *(tried(float(since)) for since in nearby)), key=lambda one: one[0])
        if best[0] > 0.0:
            offers.append(best[2])
    return offers


def _begun_better(wide: RecordLikelihood, fitted: Fit, parts: Parts) -> Fit:
    """Return a law's fit with the time at which it begins where it is likeliest, fitted again from there, twice."""
    place, h = wide.plant.index(SINCE), wide.signals.h

    def at(since: float) -> Array:
        p = fitted.p.copy()
        p[place] = since
        return p

    def likelihood_of(since: float) -> float:
        z = wide.whitened(at(since), fitted.q)
        return wide.log_likelihood(z, fitted.q, parts.fitted, fitted.colour, at(since))

    for _ in range(2):
        times = np.linspace(h * parts.fitted.start, h * parts.fitted.stop, wide.settings.learned.refined + 2)[1:-1]
        likeliest = times[int(np.argmax(spread(likelihood_of, times.tolist())))]
        fitted = annealed(wide, at(likeliest), fitted.q, fitted.free, parts, ())
    return fitted


def _left(wide: RecordLikelihood, tried: _Tried, start: Fit, parts: Parts) -> float:
    """Return the deciding part's misfit with a law over that without, of the signal that gains least."""
    stages = (("parameters", start.p), ("learned law", tried.fit.p))
    return max(
        one.after / max(one.before, 1e-300) for one in held_out_misfit(wide, start.q, stages, parts.validated, "")
    )


def _judged(wide: RecordLikelihood, best: _Tried, start: Fit, parts: Parts, unit: str) -> LearnedLaw | None:
    """Return the law fitted to all that may be looked at, if free runs over the held-out part get closer with it."""
    whole = Parts(parts.seen, parts.validated, parts.held_out)
    final = annealed(wide, best.fit.p, best.fit.q, best.fit.free, whole, ())
    since = int(final.p[wide.plant.index(SINCE)] / wide.signals.h) if best.argument.later else 0
    final = widened(wide, final, slice(max(whole.fitted.start, since), whole.fitted.stop), ())
    stages = (("parameters", start.p), ("learned law", final.p))
    misfit = held_out_misfit(wide, final.q, stages, parts.held_out, unit)
    if any(one.after > one.before for one in misfit):
        return None
    places = list(best.effect.places(wide.plant).values())
    values = final.p[places]
    errors = np.array([final.standard_error(place) for place in places])
    band, argument, metric = NORMAL_95 * errors, best.argument, unit == "m"
    torque = "N" if metric else "N.m"
    value_unit = f"{torque} per {unit}/s" if argument.with_speed else torque
    signal_unit = argument.unit.replace("rad", unit).replace("N.m", torque)
    return LearnedLaw(
        argument.site, _words(wide, argument, final.p), signal_unit, value_unit, tuple(best.knots.tolist()),
        tuple(values.tolist()), tuple((values - band).tolist()), tuple((values + band).tolist()),
        formula_of(best.knots, values, errors, wide.settings.learned.formula), misfit,
    )  # fmt: skip


def _words(wide: RecordLikelihood, argument: Argument, p: Array) -> str:
    """Return what a torque follows, in words, with the time at which it begins or its period."""
    since, period = (float(p[wide.plant.index(name)]) for name in (SINCE, PERIOD))
    if argument.kind in (CYCLE_M, CYCLE_L):
        return f"{argument.words}, which lasts {period:.5g} s"
    return f"{argument.words}, from {since:.3g} s on" if argument.later else argument.words


def knots_of(values: Array, jump: bool = False) -> Array | None:
    """Return the knots of a law: half-way between even steps and even shares of the values.

    Args:
        values: (n,) that the argument takes.
        jump: the law may jump where the values change sign: two of the knots lie close together there.

    Returns:
        Knots, rising; None: the values have no range.
    """
    low, high = np.quantile(values, [0.002, 0.998])
    jump = jump and low < 0.0 < high
    count = KNOTS - 2 if jump else KNOTS
    shares = np.quantile(values, np.linspace(0.002, 0.998, count))
    knots = 0.5 * (shares + np.linspace(shares[0], shares[-1], count))
    if jump:
        close = JUMP * (high - low)
        away = np.where(np.abs(knots) < 2.0 * close, np.where(knots < 0.0, -3.0, 3.0) * close, knots)
        knots = np.sort([*away, -close, close])
    return knots if np.all(np.diff(knots) > 1e-9 * max(float(np.ptp(knots)), 1e-300)) else None


def signal_of(likelihood: RecordLikelihood, p: Array, x: Array, argument: Argument) -> Array:
    """Return what a law is a function of.

    Args:
        likelihood: of the record.
        p: parameters of the model.
        x: (n, 8) states.
        argument: of the law.

    Returns:
        Its values (n,).
    """
    plant = likelihood.plant
    first, last = plant.bodies[0], plant.bodies[-1]
    kind = argument.kind
    if kind == TWIST:
        return plant.twist(p, x)
    place = {MOTOR_SPEED: first.speed, LOAD_SPEED: last.speed, LOAD_ANGLE: last.angle, DRIVE: plant.drive.torque}[kind]
    return np.asarray(x[:, place])


def formula_of(knots: Array, values: Array, errors: Array, most: float) -> str:
    """Return the shortest sum of at most two simple terms that runs within the errors of a law.

    Args:
        knots: (k,) arguments.
        values: (k,) of the law.
        errors: (k,) standard errors of the values.
        most: mean squared error in standard errors up to which a formula holds.

    Returns:
        The formula, s being the argument; empty: none does.
    """
    s = knots
    terms = {
        "1": np.ones_like(s), "s": s, "sign(s)": np.sign(s), "|s|": np.abs(s), "s |s|": s * np.abs(s), "s^2": s**2,
        "s^3": s**3, "sin(s)": np.sin(s), "cos(s)": np.cos(s),
    }  # fmt: skip
    weight = 1.0 / np.maximum(errors, 1e-3 * float(np.max(np.abs(values))))
    for count in (1, 2):
        found = []
        for chosen in itertools.combinations(terms, count):
            columns = np.column_stack([terms[name] for name in chosen])
            size, *_ = np.linalg.lstsq(columns * weight[:, None], values * weight, rcond=None)
            left = float(np.mean(((values - columns @ size) * weight) ** 2))
            found.append((left, chosen, size))
        left, chosen, size = min(found, key=lambda entry: entry[0])
        if left < most:
            return " ".join(f"{value:+.4g} {name}" for value, name in zip(size, chosen, strict=True)).lstrip("+")
    return ""


def _effect(argument: Argument) -> Effect:
    _, _, values = names()
    shorts = {f"value_{n}": name for n, name in enumerate(values)}
    return Effect(
        "learned_law", argument.site, shorts, "value_0", lambda scene: 0.01 * scene.torque, amplitudes=tuple(shorts)
    )


def _free(wide: RecordLikelihood, base: Fit, effect: Effect, scene: Scene) -> tuple[Free, ...]:
    unit = effect.unit_of_size(scene)
    spread = wide.settings.learned.spread * scene.torque * scene.ratio
    values: Sequence[int] = list(effect.places(wide.plant).values())
    return (*base.free, *(Free(place, unit, -np.inf, np.inf, (0.0, spread)) for place in values))


def _with_knots(index, p: Array, argument: Argument, knots: Array) -> Array:  # type: ignore[no-untyped-def]
    code, places, _ = names()
    moved = p.copy()
    moved[index(code)] = float(argument.code)
    for name, knot in zip(places, knots, strict=True):
        moved[index(name)] = knot
    return moved


def _widened(p: Array, nominal: Array) -> Array:
    return np.concatenate([p, nominal[len(p) :]])
