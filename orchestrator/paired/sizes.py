"""The sizes of a sweep in their text form, checked against what the experiment claims."""

import math
from dataclasses import dataclass

from orchestrator.engine.grid import MAX_CASES
from orchestrator.errors import CalibrationError, ScenarioError
from orchestrator.paired.experiment import Experiment
from orchestrator.shared.numbers import exact_text

THESIS_RANGE = (1.2, 4.8)
RANGES = ("range", "logrange")
FORMS = "numbers such as 0.01,0.02, or range:LOW:HIGH:N, logrange:LOW:HIGH:N or random:N"


@dataclass(frozen=True)
class Sizes:
    """Half-gaps as the engine's designs take them; ``count`` is the number of random ones, 0 where none is."""

    specification: str
    count: int = 0


def read_sizes(text: str, experiment: Experiment) -> Sizes:
    """Return half-gaps [rad]: ``0.01,0.02``, ``range:LOW:HIGH:N``, ``logrange:LOW:HIGH:N`` or ``random:N``.

    Random sizes are drawn from all that the experiment claims, evenly in the logarithm; those of the thesis's
    experiment evenly from 1.2 to 4.8 rad, as the thesis did.
    """
    kind, _, rest = text.strip().partition(":")
    if kind == "random":
        count = _count(text, rest)
        if experiment.name == "thesis":
            return Sizes("random:{}:{}".format(*THESIS_RANGE), count)
        return Sizes(f"lograndom:{experiment.smallest}:{experiment.largest}", count)
    if kind in RANGES:
        words = rest.split(":")
        if len(words) != 3:
            raise _unreadable(text)
        _count(text, words.pop())
    else:
        words = text.split(",")
    for word in words:
        _require(_number(text, word), experiment)
    return Sizes(text.strip())


def _unreadable(text: str) -> ScenarioError:
    return ScenarioError(f"`sizes` must be {FORMS}, but is {text!r}", "sizes")


def _count(text: str, word: str) -> int:
    try:
        count = int(word)
    except ValueError:
        raise _unreadable(text) from None
    if not 1 <= count <= MAX_CASES:
        raise ScenarioError(f"`sizes` must have a count of 1 to {MAX_CASES:,}, but is {text!r}", "sizes")
    return count


def _number(text: str, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise _unreadable(text) from None


def _require(alpha: float, experiment: Experiment) -> None:
    if not (math.isfinite(alpha) and alpha > 0.0):
        raise ScenarioError(f"`sizes` must be finite and positive, but one is {alpha:g}", "sizes")
    if not experiment.smallest <= alpha <= experiment.largest:
        low, high = exact_text(experiment.smallest), exact_text(experiment.largest)
        raise CalibrationError(
            f"`sizes` must lie within the calibrated {low} to {high} rad of the {experiment.name} experiment, but one "
            f"is {alpha:g}",
            "sizes",
        )
