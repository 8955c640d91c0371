"""The machine of a fitted model, as far as that can be trusted."""

from pathlib import Path

from orchestrator.control.machine import Machine, machine_of
from orchestrator.errors import ScenarioError
from orchestrator.records.model_file import Model, read_model

NAMES = ("corrected.toml", "diagnosis/corrected.toml")  # beside estimate.json; where a diagnosis was made, the second
FAR = 4.0  # standard deviations of a value that is given beside the one that the record gave


def read_fitted_model(path: Path) -> Model:
    """Return the model that a record was fitted to.

    ``path``: a model file, or ``estimate.json`` or ``diagnose.json`` with the corrected model beside it.
    """
    if path.suffix != ".json":
        return read_model(path)
    found = [path.parent / name for name in NAMES if (path.parent / name).exists()]
    if not found:
        raise ScenarioError(
            f"`model` must have a corrected.toml beside it, but {path} has none: run the command again that wrote it",
            "model",
        )
    return read_model(found[-1])


def require_machine(
    model: Model, alpha: float | None, torque_limit: float | None, force: bool
) -> tuple[Machine, tuple[str, ...]]:
    """Return the machine, and what was to be said of the model before it was forced."""
    machine = machine_of(model, alpha=alpha, torque_limit=torque_limit)
    record = model.record
    assert record is not None
    doubts = []
    if record.trust == "red" or record.verdict == "unknown":
        why = "; ".join(record.reasons) or "the cause of the remaining misfit is unknown"
        doubts.append(f"the diagnosis of {model.source} must be neither red nor unknown, but is {record.trust}: {why}")
    for n, name in enumerate(record.unknowns):
        value = machine.alpha if name == "alpha" else machine.value(name)
        off, deviation = abs(value - record.values[n]), record.covariance[n][n] ** 0.5
        if off > FAR * deviation + 1e-9 * abs(value):
            doubts.append(
                f"`{name}` must agree with the record, {record.values[n]:.4g} with a standard error of "
                f"{deviation:.2g}, but is {value:.4g}"
            )
    if doubts and not force:
        raise ScenarioError(
            f"{'; '.join(doubts)}. The controller may cause hard impacts or be unstable: log a better "
            "record (`estimate` with `design` proposes one), or give `force`",
            "model",
            "force",
        )
    return machine, tuple(f"Forced although {doubt}." for doubt in doubts)
