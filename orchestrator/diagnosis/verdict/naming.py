"""Named effects: their parameters with units and intervals, the runner-up, and effects that cannot be told apart."""

from collections.abc import Mapping, Sequence

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.outcome import Named, ParameterEstimate
from orchestrator.diagnosis.search.candidate import ForwardStep
from orchestrator.diagnosis.settings import VerdictSettings
from orchestrator.plants.description import Plant
from orchestrator.plants.effects import Effect

# Units of a plant's table when its position is a length.
METRIC = {"rad": "m", "rad/s": "m/s", "N.m": "N", "kg.m2": "kg", "N.m.s/rad": "N.s/m", "N.m.s2/rad2": "N.s2/m2"}
# Of a ripple along a position: its phase stays an angle, and advances by so many radians a metre.
PERIODIC_METRIC = {"phase": "rad", "cycles_per_rev": "rad/m"}


def named(
    plant: Plant, effect: Effect, final: Fit, steps: Sequence[ForwardStep], units: Mapping[str, str],
    settings: VerdictSettings, not_tried: Sequence[str] = (),
) -> Named:  # fmt: skip
    """Return an effect with its estimates, its gain and what it may be confused with.

    Args:
        plant: the plant.
        effect: the effect to name.
        final: the fit to all that may be looked at.
        steps: the forward steps of the search.
        units: units of the table -> units of the model's position; empty: those of the table.
        settings: of the verdict.
        not_tried: labels of effects that this record cannot tell from it, and that were left out.

    Returns:
        The effect, with 95 % intervals.
    """
    step = next(s for s in reversed(steps) if any(effect in c.effects[-1:] for c in s.candidates))
    own = next(c for c in step.candidates if c.effects[-1] is effect)
    others = [c for c in step.candidates if c is not own]
    gain = own.gain_over(step.before)
    runner = others[0] if others else None
    within = max(settings.alike_gain, settings.alike * gain)
    alike = [
        c.effects[-1].label
        for c in others
        if own.score - c.score
        < (within if effect.family and c.effects[-1].family == effect.family else settings.undecided)
    ]
    alike += [label for label in not_tried if label not in alike]
    family = (effect.label, *alike) if alike else ()
    parameters = {
        short: ParameterEstimate(
            float(final.p[place]),
            final.standard_error(place),
            final.interval(place),
            unit_of(short, plant.entry(place).unit, units),
        )
        for short, place in effect.places(plant).items()
        if place < len(plant.table) or effect.measurement
    }
    margin = own.score - runner.score if runner else gain
    return Named(effect.name, effect.site, parameters, gain, runner.effects[-1].label if runner else "", margin, family)


def unit_of(short: str, own: str, units: Mapping[str, str]) -> str:
    """Return the unit of a parameter where the position may be a length.

    Args:
        short: short name of the parameter.
        own: its unit in the plant's table.
        units: units of the table -> units of the model's position; empty: those of the table.

    Returns:
        The unit.
    """
    return PERIODIC_METRIC[short] if units and short in PERIODIC_METRIC else units.get(own, own)
