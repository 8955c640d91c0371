"""A law learned from what no effect explains: knots over the signal that predicts it best, fitted inside the predictor.

It is drawn, never named: the verdict stays "unknown". Every argument that the plant offers is screened by regression;
the most promising are fitted in full, together with the uncertain parameters, and the deciding part chooses. Time is an
argument where the missing torque repeats by a clock of its own. Where nothing lasting is found, a law that begins at
some time is looked for, in the later parts of what may be looked at. The law is then fitted to all of it, and judged by
free runs over the held-out part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.fit.spread import widened
from orchestrator.diagnosis.outcome import FittedLaw, LearnedLaw
from orchestrator.diagnosis.proof.clocked import cycle_of
from orchestrator.diagnosis.proof.curves import Short, curve, drawn, formula_of, knots_of
from orchestrator.diagnosis.proof.few_terms import of_few_terms, rows_of, short_law, with_terms
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.proof.righted import free_of, in_the_log, righted
from orchestrator.diagnosis.search.candidate import annealed, best_settled
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Screen
from orchestrator.diagnosis.verdict.where import missing_torque
from orchestrator.plants.description import Plant
from orchestrator.plants.effects import Effect, Scene
from orchestrator.plants.learned import (
    CYCLE_L,
    CYCLE_M,
    DRIVE,
    DRY,
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
    rubbing,
    with_law,
)
from orchestrator.shared.cores import spread
from orchestrator.shared.inference.normal import NORMAL_95

Array = NDArray[np.float64]


SPEEDS = (MOTOR_SPEED, LOAD_SPEED)  # dry friction jumps where they change sign


@dataclass(frozen=True)
class _Offer:
    """An argument that may be tried: its knots, the model with them and without the torque, what else is fitted."""

    argument: Argument
    knots: Array
    bare: Array
    free: tuple[Free, ...] = ()


@dataclass(frozen=True)
class _Tried:
    """One argument that was fitted: its effect, the fit of all knots, the terms that are enough, the fit with these."""

    argument: Argument
    effect: Effect
    full: Fit
    terms: tuple[str, ...]
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
    for later in (False, True) if clocked else (False,):
        used = _late(parts) if later else parts
        begun = annealed(wide, _widened(base.p, nominal), base.q, base.free, used, ())
        logged = righted(wide, begun, used)
        _, states = wide.innovations(logged.p, logged.q)
        offers = _begun(wide, logged, states, used) if later else _lasting(wide, logged, states, used, clocked)
        best = _best(wide, (begun, logged), _tried(wide, logged, offers, used), used)
        if best is not None:
            return _judged(wide, best, base, parts, unit)
    return None


def _late(parts: Parts) -> Parts:
    """Return the parts in the roles that show what begins late: the later two thirds, the last of them deciding."""
    seen = parts.seen
    size = seen.stop - seen.start
    cut = seen.stop - size // 9
    return Parts(slice(seen.start + size // 3, cut), slice(cut, seen.stop), parts.held_out)


def _best(
    wide: RecordLikelihood, starts: Sequence[Fit], tried: Sequence[_Tried], parts: Parts
) -> _Tried | None:  # fmt: skip
    """Return the law with which free runs over the deciding part get closest; None: none is worth a curve.

    What putting the log right gains alone is no merit of a law.
    """
    stages = [("", one.p) for one in (*starts, *(one.fit for one in tried))]
    found = held_out_misfit(wide, starts[0].q, stages, parts.validated, "")
    rms = np.array([[value for _, value in one.stages] for one in found])  # (signals, models)
    rms = np.where(np.isfinite(rms), rms, np.inf)
    before = np.min(rms[:, : len(starts)], axis=1)
    left = np.max(rms[:, len(starts) :] / np.maximum(before, 1e-300)[:, None], axis=0)
    if not tried or not np.min(left) <= wide.settings.learned.left:
        return None
    return tried[int(np.argmin(left))]


def _tried(wide: RecordLikelihood, start: Fit, offers: Sequence[_Offer], parts: Parts) -> list[_Tried]:
    """Return fits of the most promising offers, each with the log put right beside it."""
    settings, scene = wide.settings.learned, scene_of(wide, start)
    promising = []
    for offer in offers:
        effect = _effect(wide.plant, offer.argument)
        guesses = Screen(wide, replace(start, p=offer.bare), parts).guesses(effect, scene)
        if guesses:
            promising.append((guesses[0].gain, offer, effect, guesses[0].values))
    promising.sort(key=lambda entry: -entry[0])
    tried = []
    for _, offer, effect, values in promising[: settings.fitted]:
        free = (*_free(wide, start, effect, scene), *offer.free)
        p = effect.put(wide.plant, offer.bare, values, ())
        fitted = annealed(wide, p, start.q, free, parts, ())
        if offer.argument.later:
            fitted = _begun_better(wide, offer.argument, fitted, parts)
        fitted = righted(wide, fitted, parts)
        tried.append(_Tried(offer.argument, effect, fitted, *short_law(wide, offer.argument, effect, fitted, parts)))
    return tried


def _lasting(wide: RecordLikelihood, start: Fit, states: Array, parts: Parts, clocked: bool) -> list[_Offer]:
    """Return the laws over a signal of the plant, and over time where the missing torque repeats by a clock."""
    plant, offers = wide.plant, []
    for argument in arguments_of(plant):
        knots = knots_of(signal_of(wide, start.p, states, argument)[parts.fitted], _steep(plant, argument))
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
            knots = knots_of(acting, _steep(plant, argument))
            if knots is None:
                return 0.0, since, _Offer(argument, start.p, start.p)
            bare = _with_knots(plant.index, start.p, argument, knots)
            bare[plant.index(SINCE)] = since
            guesses = Screen(wide, replace(start, p=bare), parts).guesses(_effect(plant, argument), scene)
            return (guesses[0].gain if guesses else 0.0), since, _Offer(argument, knots, bare)

        best = max((tried(first + step * n) for n in range(1, count + 1)), key=lambda one: one[0])
        nearby = best[1] + step * np.linspace(-1.0, 1.0, count + 2)[1:-1]
        best = max((best, *(tried(float(since)) for since in nearby)), key=lambda one: one[0])
        if best[0] > 0.0:
            offers.append(best[2])
    return offers


def _begun_better(wide: RecordLikelihood, argument: Argument, fitted: Fit, parts: Parts) -> Fit:
    """Return a law's fit with the time at which it begins where it is likeliest, fitted again from there, twice."""
    place, h = wide.plant.index(SINCE), wide.signals.h

    def at(since: float) -> Array:
        p = fitted.p.copy()
        p[place] = since
        return p

    def likelihood_of(since: float) -> float:
        z = wide.whitened(at(since), fitted.q)
        return wide.log_likelihood(z, fitted.q, parts.fitted, fitted.colour, at(since))

    def begun(since: float) -> Fit:
        p = _knotted(wide, argument, replace(fitted, p=at(since)), parts.fitted)
        return best_settled(wide, [p], fitted.q, fitted.free, parts)

    # A curve that was fitted from a wrong time on makes up for what came before, and is likeliest from there.
    first, last = h * parts.fitted.start, h * parts.fitted.stop
    several = [begun(float(since)) for since in np.linspace(first, last, wide.settings.learned.starts + 2)[1:-1]]
    fitted = max(fitted, *several, key=lambda one: one.rank(parts))
    for _ in range(2):
        times = np.linspace(first, last, wide.settings.learned.refined + 2)[1:-1]
        likeliest = times[int(np.argmax(spread(likelihood_of, times.tolist())))]
        p = _knotted(wide, argument, replace(fitted, p=at(likeliest)), parts.fitted)
        fitted = annealed(wide, p, fitted.q, fitted.free, parts, ())
    return fitted


def _knotted(wide: RecordLikelihood, argument: Argument, fitted: Fit, part: slice) -> Array:
    """Return a law's parameters with its knots where the samples of a part are on which it acts, its curve as it was.

    A value that no sample asks for stays where its prior is, and data that come there later find a wrong law.
    """
    plant, p = wide.plant, fitted.p
    if argument.kind in (CYCLE_M, CYCLE_L):
        return p
    since = int(p[plant.index(SINCE)] / wide.signals.h) if argument.later else 0
    _, states = wide.innovations(p, fitted.q)
    acting = signal_of(wide, p, states, argument)[max(part.start, since) : part.stop]
    knots = knots_of(acting, _steep(plant, argument)) if acting.size else None
    if knots is None:
        return p
    moved = _with_knots(plant.index, p, argument, knots)
    before, values = ([plant.index(name) for name in group] for group in names()[1:])
    moved[values] = curve(p[before], p[values], knots)
    return moved


def _judged(wide: RecordLikelihood, best: _Tried, base: Fit, parts: Parts, unit: str) -> LearnedLaw | None:
    """Return the law fitted to all that may be looked at, if free runs over the held-out part get closer with it.

    They must get closer than with re-fitted parameters, and than with the log put right as it is beside the law.
    """
    whole, plant = Parts(parts.seen, parts.validated, parts.held_out), wide.plant
    p = _knotted(wide, best.argument, best.full, whole.fitted)
    final = annealed(wide, p, best.full.q, best.full.free, whole, ())
    since = int(final.p[plant.index(SINCE)] / wide.signals.h) if best.argument.later else 0
    final = widened(wide, final, slice(max(whole.fitted.start, since), whole.fitted.stop), ())
    knots, values, errors = _shown(plant, best, final)
    if best.terms:
        short = of_few_terms(wide, best.argument, best.effect, final, best.terms)[0]
        p, free = with_terms(wide, best.effect, final, short)
        final = annealed(wide, p, final.q, free, whole, ())
        knots, values, errors = _shown(plant, best, final, short)
    stages = [("parameters", _widened(base.p, wide.nominal)), *_put_right(wide, best, base, final, whole)]
    misfit = held_out_misfit(wide, final.q, [*stages, ("learned law", final.p)], parts.held_out, unit)
    if any(not one.after <= min(before for _, before in one.stages[:-1]) for one in misfit):
        return None
    band, argument, metric = NORMAL_95 * errors, best.argument, unit == "m"
    torque = "N" if metric else "N.m"
    value_unit = f"{torque} per {unit}/s" if argument.with_speed else torque
    signal_unit = argument.unit.replace("rad", unit).replace("N.m", torque)
    return LearnedLaw(
        argument.site, _words(wide, argument, final.p), signal_unit, value_unit, tuple(knots.tolist()),
        tuple(values.tolist()), tuple((values - band).tolist()), tuple((values + band).tolist()),
        formula_of(knots, values, errors, wide.settings.learned.formula), misfit, in_the_log(plant, base.p, final.p),
        FittedLaw(wide, final.p, final.q),
    )  # fmt: skip


def _put_right(
    wide: RecordLikelihood, best: _Tried, base: Fit, final: Fit, parts: Parts
) -> list[tuple[str, Array]]:  # fmt: skip
    """Return the model without the law whose log is put right as beside it, fitted again; none where nothing is."""
    plant = wide.plant
    own = {plant.index(PERIOD), *best.effect.places(plant).values()}
    free = [entry for entry in final.free if entry.place not in own]
    if len(free) == len(base.free):
        return []
    bare = final.p.copy()
    bare[[plant.index(name) for name in (names()[0], *names()[2], DRY)]] = 0.0
    return [("log put right", annealed(wide, bare, final.q, free, parts, ()).p)]


def _shown(plant: Plant, best: _Tried, final: Fit, short: Short | None = None) -> tuple[Array, Array, Array]:
    """Return knots, values and their standard errors of a law as it is shown: dry friction is a jump at rest."""
    places, jumps = [plant.index(name) for name in best.effect.parameters.values()], _jumps(plant, best.argument)
    at, shares = drawn(final.p[[plant.index(name) for name in names()[1]]], jumps)
    shares = shares[:, : len(places)]
    rows = [] if short else rows_of(final, places)
    covariance = short.covariance if short else final.covariance[np.ix_(rows, rows)]
    errors = np.sqrt(np.maximum(np.sum((shares @ covariance) * shares, axis=1), 0.0))
    return at, shares @ final.p[places], errors


def _words(wide: RecordLikelihood, argument: Argument, p: Array) -> str:
    """Return what a torque follows, in words, with the time at which it begins or its period."""
    since, period = (float(p[wide.plant.index(name)]) for name in (SINCE, PERIOD))
    if argument.kind in (CYCLE_M, CYCLE_L):
        return f"{argument.words}, which lasts {period:.5g} s"
    return f"{argument.words}, from {since:.3g} s on" if argument.later else argument.words


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


def _steep(plant: Plant, argument: Argument) -> bool:
    """Tell whether a jump at rest must be a steep line, for want of dry friction in the plant."""
    return argument.kind in SPEEDS and not _jumps(plant, argument)


def _jumps(plant: Plant, argument: Argument) -> bool:
    return rubbing(plant, argument) is not None


def _effect(plant: Plant, argument: Argument) -> Effect:
    _, _, values = names()
    shorts = {f"value_{n}": name for n, name in enumerate(values)}

    def unit(scene: Scene) -> float:
        return 0.01 * scene.torque

    rubs = rubbing(plant, argument)
    if rubs is None:
        return Effect("learned_law", argument.site, shorts, "value_0", unit, amplitudes=tuple(shorts))
    shorts["dry"] = DRY
    return Effect(
        "learned_law", argument.site, shorts, "value_0", unit, rubs.starts, tuple(shorts), scales=rubs.scales,
        nuisances=rubs.nuisances, priors=rubs.priors,
    )  # fmt: skip


def _free(wide: RecordLikelihood, base: Fit, effect: Effect, scene: Scene) -> tuple[Free, ...]:
    spread, found = wide.settings.learned.spread * scene.torque * scene.ratio, []
    for entry, short in zip(free_of(wide, effect, scene), effect.places(wide.plant), strict=True):
        found.append(entry if short in effect.nuisances else replace(entry, prior=(0.0, spread)))
    return (*base.free, *found)


def _with_knots(index, p: Array, argument: Argument, knots: Array) -> Array:  # type: ignore[no-untyped-def]
    code, places, _ = names()
    moved = p.copy()
    moved[index(code)] = float(argument.code)
    for name, knot in zip(places, knots, strict=True):
        moved[index(name)] = knot
    return moved


def _widened(p: Array, nominal: Array) -> Array:
    return np.concatenate([p, nominal[len(p) :]])
