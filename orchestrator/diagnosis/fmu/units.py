"""Names and units of an effect's values as a user has them."""

from collections.abc import Mapping

from orchestrator.diagnosis.fmu.bank import CUT, PORT, BoxEffect
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.diagnosis.model.interface import Values


def named_values(effect: BoxEffect, values: Values) -> dict[str, float]:
    """Return the values of an effect by name; a gain is the factor, 1 where there is none.

    Args:
        values: as they are fitted, a gain by what it has more than 1.
    """
    more = 1.0 if effect.kind.name.endswith("_gain") else 0.0
    return {name: more + value for name, value in zip(effect.kind.parameters, values, strict=False)}


def effect_units(problem: BoxProblem, effect: BoxEffect) -> Mapping[str, str]:
    """Return the units of an effect's values, at the place where it acts."""
    if effect.kind.where == PORT:
        port = problem.map.ports[effect.place]
        flow = problem.units.get(port.position, "")
        names = {"effort": problem.units.get(port.input, ""), "flow": f"({flow or '1'}.s)" if port.flow_only else flow}
    elif effect.kind.where == CUT:
        cut = problem.map.cuts[effect.place]
        names = {"effort": problem.units.get(cut.effort or "", ""), "flow": problem.units.get(cut.input, "")}
    else:
        unit = problem.units.get(effect.place, "")
        names = {"effort": unit, "flow": unit, "signal": effect.signal}
    found = {}
    for parameter, unit in zip(effect.kind.parameters, effect.kind.units, strict=True):
        shown = unit
        for key, name in names.items():
            shown = shown.replace(key, name or "1")
        found[parameter] = shown
    return found
