"""Encoders whose zeros lie anywhere: a drivetrain does not care, but sums of many turns and filters do."""

from dataclasses import replace

import numpy as np

from orchestrator.estimation.signals import shaft_signals
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.records.units import TURN

FAR_TWIST = 0.03  # rad of the load between the encoders' zeros, which no fit takes for an offset of sensors
FAR_ANGLE = 100.0  # rad from zero, beyond which whole turns are left out
TAIL = 0.02  # of the rows: flanks are where all others lie


def set_zeros(record: Record, model: Model) -> Record:
    """Return a record of a ``Drivetrain`` whose encoders' zeros lie near each other and near the record, with a note.

    The load's angle, and one that is alone, loses whole turns, so that what follows a turn stays where it is. The
    motor's zero goes to the middle of the play, where it lies outside: an offset as large is no property of sensors.
    The twist of a torque that the motor holds throughout, such as a weight's, is no offset.
    """
    if model.fmu != "Drivetrain":
        return record
    filled = record.fill_missing()
    if record.theta_l is None or filled.theta_l is None:
        return _shift(record, TURN * _far_turns(filled.theta_m), 0.0)
    load = TURN * _far_turns(filled.theta_l)
    filled = _shift(filled, 0.0, load)
    low, high = play_of(filled, model)
    centre = 0.5 * (low + high)
    lies_within = abs(centre) <= max(FAR_TWIST, 0.5 * (high - low)) + held_twist(filled, model)
    return _shift(record, 0.0 if lies_within else centre * model.parameters["i"].value, load)


def play_of(record: Record, model: Model) -> tuple[float, float]:
    """Return where the twist of a record without missing rows lies but for what the shaft is wound up by [rad]."""
    shaft = shaft_signals(record, model)
    low, high = np.quantile(shaft.twist - shaft.torque / model.parameters["k"].value, (TAIL, 1.0 - TAIL))
    return float(low), float(high)


def held_twist(record: Record, model: Model) -> float:
    """Return the twist [rad] by which the mean torque of a record without missing rows winds the shaft up."""
    torque = abs(float(np.mean(record.u)) * model.parameters["i"].value) if record.has_torque else 0.0
    return torque / model.parameters["k"].value


def _far_turns(angle: np.ndarray) -> int:
    middle = float(np.median(angle))
    return round(middle / TURN) if abs(middle) > FAR_ANGLE else 0


def _shift(record: Record, motor: float, load: float) -> Record:
    if motor == 0.0 and load == 0.0:
        return record
    shifts = [f"{shift:.9g} rad from {name}" for name, shift in (("theta_m", motor), ("theta_l", load)) if shift]
    note = f"the encoders' zeros differ: subtracted {' and '.join(shifts)}"
    theta_l = None if record.theta_l is None else record.theta_l - load
    return replace(
        record, theta_m=record.theta_m - motor, theta_l=theta_l, notes=(*record.notes, note), zeros_set=motor != 0.0
    )
