"""Whether what a model leaves follows a law of the motion, the inputs or the time: a disturbance follows none.

Noise at a port takes up what an effect outside the bank does. So efforts of any size that depend on the position, the
speed, the time or an input are put beside less noise, their sizes integrated out (a Bayes factor has its cost of values
built in). The same is done with copies of what is left whose phases are random: they have its spectrum, and follow
nothing. What such copies reach is chance: no filter is just right, and a law must be likelier by more than that.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.problem import BoxProblem
from orchestrator.diagnosis.blackbox.promises import Known
from orchestrator.diagnosis.blackbox.settings import DEFAULT, RestSettings
from orchestrator.diagnosis.blackbox.whitening import Ladder

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Law:
    """Efforts that may be at work: any sum of ``pushes`` (n - 1, c) at an input of the surrogate.

    Attributes:
        follows: what they depend on, in words.
        place: of the input.
        share: of the belief in all laws that this one has.
    """

    follows: str
    place: int
    share: float
    pushes: Array


@dataclass(frozen=True)
class Dependence:
    """How much likelier what is left is under the likeliest kind of law than as noise alone.

    Attributes:
        gain: logarithm of the Bayes factor, all laws of the kind together.
        by_chance: the same of copies that follow nothing: all but a small share of them stay below.
        statement: what the likeliest law depends on, and when it acts most; without a full stop.
    """

    gain: float
    by_chance: float
    statement: str


def dependence_of(fitter: Fitter, fit: BoxFit, settings: RestSettings = DEFAULT.rest) -> Dependence | None:
    """Return on what it depends what a model leaves over all of a record; None where it is noise.

    Args:
        fitter: gives the filters, the surrogate and the record.
        fit: of a model; its run and its Jacobian are those over all rows.
        settings: which laws, and how surely.

    Returns:
        The dependence that is surest.
    """
    ladder, n = fitter.ladder, fitter.problem.n
    read = fitter.problem.read([fit.model])[0]
    if read is None or len(fit.J) < n or ladder.surrogate.order == 0 or ladder.share(fit.level) <= settings.solver:
        return None
    copies = aimless(ladder, fit.level, fitter.whitened(fit.y, fit.level), settings.copies)
    found = [
        _judged(Known(fitter, fit, n), copies, laws, _levels(ladder, fit.level), settings)
        for laws in (laws_of_motion(fitter.problem, read, settings), laws_of_time(fitter.problem, read, settings))
        if laws
    ]
    sure = [d for d in found if d.gain > settings.lawful + max(d.by_chance, 0.0)]
    return max(sure, key=lambda d: d.gain, default=None)


def aimless(ladder: Ladder, level: int, e: Array, count: int) -> Array:
    """Return residuals (n, outputs, count) whose innovations have the spectra of ``e`` and random phases.

    Args:
        ladder: filters.
        level: of port noise, by which ``e`` was whitened.
        e: (n, outputs) innovations.
        count: copies.

    Returns:
        The residuals, in units of the noise.
    """
    n, rng = len(e), np.random.default_rng(0)
    spectrum = np.fft.rfft(e, axis=0)[:, :, None]
    turned = np.exp(2j * np.pi * rng.random((len(spectrum), 1, count)))  # one phase for all outputs: they go together
    turned[0] = np.sign(turned[0].real)
    if n % 2 == 0:
        turned[-1] = np.sign(turned[-1].real)
    return ladder[level].coloured(np.fft.irfft(spectrum * turned, n, axis=0))


def laws_of_motion(problem: BoxProblem, read: Array, settings: RestSettings = DEFAULT.rest) -> list[Law]:
    """Return laws of position, speed and inputs, each family as likely as the others.

    Args:
        problem: gives ports and inputs.
        read: (n, reads) what the model read.
        settings: into how many parts a range is cut.

    Returns:
        The laws.
    """
    count = settings.stretches
    found = []
    for name, (place, x, v) in _ports(problem, read).items():
        if problem.map.ports[name].flow_only:
            found.append((1.0, f"the flow at `{name}`", place, _cells(x, count)))
            continue
        for kind, size in (("", np.ones(len(x))), (" and the speed", v), (" and the direction", np.tanh(10.0 * v))):
            here = f"the position{kind} at `{name}`"
            found += [(1.0, here, place, _cells(x, k) * size[:, None]) for k in (count, 4 * count)]
            waves = np.pi / (2.0 * max(float(np.max(np.abs(x - x.mean()))), 1e-300)) * np.arange(1, settings.waves + 1)
            turns = [np.column_stack([np.cos(w * x), np.sin(w * x)]) * size[:, None] for w in waves]
            found += [(1.0 / settings.waves, here, place, turn) for turn in turns]
        found.append((1.0, f"the speed at `{name}`", place, _cells(v, count)))
    for place in range(len(problem.noise_places)):
        for name, u in zip(problem.inputs, problem.data.inputs.T, strict=True):
            if np.ptp(u) > 0.0:
                step = np.diff(u, prepend=u[0])
                found += [(1.0, f"`{name}`", place, _cells(u, count)),
                          (1.0, f"steps of `{name}`", place, _cells(step, count))]  # fmt: skip
    return [Law(follows, place, share, pushes[:-1]) for share, follows, place, pushes in found]


def laws_of_time(problem: BoxProblem, read: Array, settings: RestSettings = DEFAULT.rest) -> list[Law]:
    """Return efforts that begin at some time, and laws of time with the speed, the direction or an input.

    Args:
        problem: gives ports and inputs.
        read: (n, reads) what the model read.
        settings: into how many parts the time is cut.

    Returns:
        The laws.
    """
    n, count = len(read), settings.stretches
    when = (np.arange(n) * count // n)[:, None] == np.arange(count)
    found = []
    for name, (place, _, v) in _ports(problem, read).items():
        for kind, size in (("speed", v), ("direction", np.tanh(10.0 * v))):
            found.append((1.0, f"the time and the {kind} at `{name}`", place, when * size[:, None]))
    begins = np.linspace(0, n, 4 * count + 1)[:-1].astype(int)
    for place in range(len(problem.noise_places)):
        for first in begins:
            says = f"an effort that begins or ends at about {problem.data.time[first]:.4g} s"
            found.append((1.0 / len(begins), says, place, np.asarray(np.arange(n) >= first, dtype=float)[:, None]))
        sizes = np.maximum(np.sqrt(np.mean(problem.data.inputs**2, axis=0)), 1e-300)
        driven = zip(problem.inputs, (problem.data.inputs / sizes).T, strict=True)
        found += [(1.0, f"the time and `{name}`", place, when * u[:, None]) for name, u in driven if np.ptp(u) > 0.0]
    return [Law(follows, place, share, pushes[:-1]) for share, follows, place, pushes in found]


def _ports(problem: BoxProblem, read: Array) -> dict[str, tuple[int, Array, Array]]:
    """Return place, position and speed over its size, by port."""
    found = {}
    for name, port in problem.map.ports.items():
        x = read[:, problem.runner.reads.index(port.position)]
        v = x if port.flow_only else np.gradient(x)
        place = problem.noise_places.index(problem.runner.inputs.index(port.input))
        found[name] = (place, x, v / max(float(v.std()), 1e-300))
    return found


def _cells(x: Array, count: int) -> Array:
    """Return (n, count) 1 where ``x`` is in that part of its range: as many samples are in each."""
    bounds = np.quantile(x, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return np.asarray(np.searchsorted(bounds, x)[:, None] == np.arange(count), dtype=float)


def _levels(ladder: Ladder, chosen: int) -> list[int]:
    """Return levels with as little noise as was chosen or less, of its colour, and that of none."""
    most, colour = ladder.share(chosen), ladder.colour(chosen)
    return [k for k in range(ladder.size) if k == 0 or (ladder.colour(k) == colour and ladder.share(k) <= most)]


def _judged(
    known: Known, copies: Array, laws: Sequence[Law], levels: Sequence[int], settings: RestSettings
) -> Dependence:
    """Return by how much the laws together are likelier than noise alone, for what is left and for its copies."""
    ladder = known.fitter.ladder
    answers = [ladder.surrogate.response(law.pushes, law.place) for law in laws]
    belief = np.log(np.array([law.share for law in laws]) / sum(law.share for law in laws))
    plain, under, best = [], [], (-np.inf, 0, 0)
    for level in levels:
        e = np.column_stack([known.at(level)[1], known.beside(level, copies)])
        plain.append(-0.5 * np.sum(e * e, axis=0) - np.sum(ladder[level].half_log))
        factors = np.array([_factors(known.beside(level, D), e, ladder.shares[1:]) for D in answers]) + belief[:, None]
        top = factors.max(axis=0)
        under.append(plain[-1] + top + np.log(np.sum(np.exp(factors - top), axis=0)))
        best = max(best, (float(plain[-1][0] + factors[:, 0].max()), level, int(np.argmax(factors[:, 0]))))
    gains = np.max(under, axis=0) - np.max(plain, axis=0)
    by_chance = float(np.quantile(gains[1:], 1.0 - settings.by_chance))
    _, level, at = best
    when = _when(known, level, answers[at], laws[at].pushes, settings.blocks)
    return Dependence(float(gains[0]), by_chance, f"what is left follows {laws[at].follows}, most {when}")


def _when(known: Known, level: int, answers: Array, pushes: Array, blocks: int) -> str:
    """Return in which of equal parts of the record the likeliest efforts of a law are largest."""
    D, e = known.beside(level, answers), known.at(level)[1]
    efforts = pushes @ np.linalg.lstsq(D, e, rcond=1e-6)[0]
    sizes = [float(np.mean(part**2)) for part in np.array_split(efforts, blocks)]
    time = known.fitter.problem.data.time
    bounds = np.linspace(0, len(time) - 1, blocks + 1).astype(int)
    most = int(np.argmax(sizes))
    return f"from {time[bounds[most]]:.4g} to {time[bounds[most + 1]]:.4g} s"


def _factors(D: Array, e: Array, sizes: Sequence[float]) -> Array:
    """Return the logarithm of the Bayes factor of columns ``D`` for each of ``e``, each size as likely as the others.

    Their factors are normal with deviations ``sizes``; integrated in closed form along the principal axes of ``D``.
    """
    powers, axes = np.linalg.eigh(D.T @ D)
    along = (axes.T @ (D.T @ e)) ** 2
    powers = np.maximum(powers, 0.0)
    variances = np.square(sizes)[:, None]
    inside = 1.0 + variances * powers
    values = 0.5 * ((variances / inside) @ along - np.sum(np.log(inside), axis=1)[:, None])
    top = values.max(axis=0)
    return np.asarray(top + np.log(np.mean(np.exp(values - top), axis=0)))
