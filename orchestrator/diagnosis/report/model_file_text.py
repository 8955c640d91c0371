"""The corrected model as a model file, which a validation without a search takes."""

from orchestrator.diagnosis.result import Diagnosis, ValueEstimate
from orchestrator.records.model_file import Model


def corrected_model(model: Model, diagnosis: Diagnosis) -> str:
    """Return the TOML text of a model with the values of a diagnosis.

    Every value that differs from the FMU's default is stated. Those that were fitted carry the half-width of their
    95 % interval as uncertainty, so that another record may move them.

    Args:
        model: the model that the record was compared with; its columns and encoders are kept.
        diagnosis: of the record.

    Returns:
        The text.
    """
    plant, final = model.plant, diagnosis.workings.final
    fitted: dict[str, ValueEstimate] = dict(diagnosis.parameters)
    for row in plant.bank:
        named = next((one for one in diagnosis.effects if one.label == row.label and one.in_model), None)
        if named is not None:
            fitted |= {name: named.parameters[short] for short, name in row.parameters.items()}
    lines = [f'fmu = "{model.fmu}"']
    for place, entry in enumerate(plant.table):
        value = float(final[place])
        if value == entry.default and entry.name not in fitted:
            continue
        lines += ["", f'[parameters."{entry.name}"]', f"value = {value!r}"]
        if entry.name in fitted:
            low, high = fitted[entry.name].interval
            lines.append(f"uncertainty = {0.5 * (high - low)!r}")
    for name, encoder in model.encoders.items():
        lines += ["", f"[encoders.{name}]"]
        lines += [f"{key} = {v!r}" for key in ("resolution", "noise") if (v := getattr(encoder, key)) is not None]
    for name, column in model.columns.items():
        lines += ["", f"[columns.{name}]", f'name = "{column.name}"']
        lines += [f'unit = "{column.unit}"'] if column.unit else []
    return "\n".join(lines) + "\n"
