"""Units of a plant's table when its position is a length."""

from orchestrator.records.model_file import Model

METRIC = {"rad": "m", "rad/s": "m/s", "N.m": "N", "kg.m2": "kg", "N.m.s/rad": "N.s/m", "N.m.s2/rad2": "N.s2/m2",
          "N.m/s": "N/s", "N.m/rad": "N/m"}  # fmt: skip
# Of a wave along a position: its phase stays an angle, and advances by so many radians a metre.
PERIODIC = {"phase": "rad", "cycles_per_rev": "rad/m"}


def in_metres(model: Model) -> bool:
    """Tell whether the model's position is a length."""
    column = model.columns.get("theta_m")
    return column is not None and column.unit in ("m", "mm")


def unit_in(unit: str, model: Model, parameter: str = "") -> str:
    """Return the unit of a parameter of the plant's table as a model has it."""
    if not in_metres(model):
        return unit
    return PERIODIC.get(parameter, METRIC.get(unit, unit))
