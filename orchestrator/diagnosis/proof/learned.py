"""A law learned from what no effect explains: knots over the signal that predicts it best, fitted inside the predictor.

It is drawn, never named: the verdict stays "unknown". Every argument that the plant offers is screened by regression;
the most promising are fitted in full, together with the uncertain parameters, and the deciding part chooses. The law is
then fitted to all that may be looked at, and judged by free runs over the held-out part.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Free, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.spread import widened
from orchestrator.diagnosis.outcome import LearnedLaw
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.diagnosis.search.candidate import annealed
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.diagnosis.search.screening import Screen
from orchestrator.plants.effects import Effect, Scene
from orchestrator.plants.learned import (
    DRIVE,
    KNOTS,
    LOAD_ANGLE,
    LOAD_SPEED,
    MOTOR_SPEED,
    TWIST,
    WITH_SPEED,
    Argument,
    arguments_of,
    names,
    with_law,
)
from orchestrator.shared.inference.normal import NORMAL_95

Array = NDArray[np.float64]


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
    settings = likelihood.settings.learned
    plant = with_law(likelihood.plant)
    nominal = np.array([*likelihood.nominal, *(entry.default for entry in plant.nuisances[-1 - 2 * KNOTS :])])
    wide = RecordLikelihood(plant, likelihood.signals, nominal, likelihood.stop, likelihood.settings)
    start = annealed(wide, _widened(base.p, nominal), base.q, base.free, parts, ())
    scene = scene_of(wide, start)
    _, states = wide.innovations(start.p, start.q)
    promising = []
    for argument in arguments_of(plant):
        knots = knots_of(signal_of(wide, start.p, states, argument)[parts.fitted])
        if knots is None:
            continue
        effect = _effect(argument)
        bare = _with_knots(plant.index, start.p, argument, knots)
        guesses = Screen(wide, replace(start, p=bare), parts).guesses(effect, scene)
        if guesses:
            promising.append((guesses[0].gain, argument, knots, effect, bare, guesses[0].values))
    promising.sort(key=lambda entry: -entry[0])
    tried = []
    for _, argument, knots, effect, bare, values in promising[: settings.fitted]:
        free = _free(wide, base, effect, scene)
        p = effect.put(plant, bare, values, ())
        tried.append(_Tried(argument, knots, effect, annealed(wide, p, start.q, free, parts, ())))
    best = min(tried, key=lambda one: _left(wide, one, start, parts), default=None)
    if best is None or _left(wide, best, start, parts) > settings.left:
        return None
    return _judged(wide, best, start, parts, unit)


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
    final = widened(wide, final, whole.fitted, ())
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
        argument.site, argument.words, signal_unit, value_unit, tuple(best.knots.tolist()),
        tuple(values.tolist()), tuple((values - band).tolist()), tuple((values + band).tolist()),
        formula_of(best.knots, values, errors, wide.settings.learned.formula), misfit,
    )  # fmt: skip


def knots_of(values: Array) -> Array | None:
    """Return the knots of a law: half-way between even steps and even shares of the values.

    Args:
        values: (n,) that the argument takes.

    Returns:
        Knots, rising; None: the values have no range.
    """
    shares = np.quantile(values, np.linspace(0.002, 0.998, KNOTS))
    even = np.linspace(shares[0], shares[-1], KNOTS)
    knots = 0.5 * (shares + even)
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
    kind = argument.code % WITH_SPEED
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
