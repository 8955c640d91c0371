"""Records of the independent simulator with what is true of them: one task each, made in any process."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.judging import Truth
from orchestrator.records.model_file import Model, default_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.hidden_effects import (
    MACHINES,
    OFF_CENTRE,
    SINGLE,
    UNKNOWN,
    Case,
    Ways,
    double_case,
    none_case,
    one_encoder_case,
    single_case,
    unknown_case,
)

# Effects that small sizes make alike -> what they have in common; no two of them are hidden together.
RELATIVES = {
    **dict.fromkeys(("backlash@shaft", "hardening_stiffness@shaft", "shaft_hysteresis@shaft"), "weak shaft"),
    **dict.fromkeys(("input_delay@actuator", "rate_limit@actuator", "drive_filter@actuator"), "late drive"),
    **dict.fromkeys(("torque_ripple@motor", "gravity_load@load"), "periodic torque"),
    **dict.fromkeys(("sensor_offset@motor", "sensor_offset@load"), "offset"),
    **{
        f"{kind}_friction@{site}": f"dry friction, {site}"
        for kind in ("coulomb", "stribeck", "load_dependent")
        for site in ("motor", "load")
    },
}
# Truth of the simulator -> label without site, parameter, whether its unit carries a torque.
RECOVERED = {
    "alpha": ("backlash", "alpha", False), "Fc_m": ("coulomb_friction@motor", "torque", True),
    "Fc_l": ("coulomb_friction@load", "torque", True), "delay": ("input_delay", "delay", False),
    "sat": ("torque_saturation", "limit", False), "rip": ("torque_ripple", "amplitude", True),
    "ecc": ("gear_eccentricity", "amplitude", False), "T0": ("load_torque", "torque", True),
    "grav": ("gravity_load", "amplitude", True), "J3": ("extra_resonance", "inertia", True),
    "qd": ("quadratic_drag", "coefficient", True),
    "enc_m": ("motor_encoder_eccentricity", "amplitude", False),
    "enc_l": ("load_encoder_eccentricity", "amplitude", False),
}  # fmt: skip


@dataclass(frozen=True)
class SimulatedTask:
    """One record of the independent simulator.

    Attributes:
        group: "none", "single", "double", "unknown", "one_encoder" or "off_centre".
        kinds: what is hidden.
        seed: of the record.
        ways: machine and nuisances.
        logger: "zeros", "stamps" or "": see ``logged``; no part of the key, so that rows are compared with ideal ones.
    """

    group: str
    kinds: tuple[str, ...]
    seed: int
    ways: Ways
    logger: str = ""

    @property
    def key(self) -> str:
        """Return what tells it from every other record."""
        nuisances = [name for name in ("torque_noise", "shifts", "gain") if getattr(self.ways, name)]
        return ":".join((self.group, "+".join(self.kinds), str(self.seed), self.ways.machine, *nuisances))

    def make(self) -> Case:
        """Return the record with its truth."""
        case = self._ideal()
        return replace(case, record=logged(case.record, self.logger, self.seed)) if self.logger else case

    def _ideal(self) -> Case:
        match self.group:
            case "none":
                return none_case(self.seed, ways=self.ways)
            case "single" | "off_centre":
                return single_case(self.kinds[0], self.seed, ways=self.ways)
            case "double":
                return double_case((self.kinds[0], self.kinds[1]), self.seed, ways=self.ways)
            case "unknown":
                return unknown_case(self.kinds[0], self.seed, ways=self.ways)
            case _:
                return one_encoder_case(self.seed, torque_noise=self.ways.torque_noise)


def logged(record: Record, logger: str, seed: int) -> Record:
    """Return a record as another logger has it.

    Args:
        record: with two encoders.
        logger: "zeros": the motor's encoder counts from anywhere within 20 rad; "stamps": those of a PC, late by up to
            5 to 40 % of a sample, half of them on a grid of 1 ms, with three rows lost.
        seed: of what is drawn.

    Returns:
        The record.
    """
    rng = np.random.default_rng([seed, 91])
    assert record.theta_l is not None
    columns = {"time": record.time, "u": record.u, "theta_m": record.theta_m, "theta_l": record.theta_l}
    if logger == "zeros":
        columns["theta_m"] = record.theta_m + rng.uniform(-20.0, 20.0)
    else:
        late = record.time + rng.uniform(0.05, 0.4) * record.step * rng.random(record.size)
        columns["time"] = np.round(late, 3) if rng.random() < 0.5 else late
        kept = np.delete(np.arange(record.size), rng.integers(1, record.size - 1, 3))
        columns = {name: values[kept] for name, values in columns.items()}
    return record_from_columns(columns, record.source)


@dataclass(frozen=True)
class Counts:
    """Records of each group."""

    none: int = 0
    single: int = 0
    double: int = 0
    unknown: int = 0
    one_encoder: int = 0
    off_centre: int = 0


def simulated_tasks(
    counts: Counts, seed: int, ways: Ways, machines: Sequence[str] = tuple(MACHINES), logger: str = ""
) -> list[SimulatedTask]:
    """Return records in a random order; kinds and machines take turns.

    Args:
        counts: of each group.
        seed: first one.
        ways: nuisances.
        machines: names of ``MACHINES``.
        logger: see ``logged``.

    Returns:
        The tasks.
    """
    pairs: list[tuple[str, ...]] = [pair for pair in itertools.combinations(SINGLE, 2) if not _are_relatives(*pair)]
    np.random.default_rng(seed).shuffle(pairs)
    kinds: dict[str, list[tuple[str, ...]]] = {
        "none": [()], "single": [(kind,) for kind in SINGLE], "double": list(pairs),
        "unknown": [(kind,) for kind in UNKNOWN], "one_encoder": [("backlash",)],
        "off_centre": [(kind,) for kind in OFF_CENTRE],
    }  # fmt: skip
    tasks = []
    for place, (group, hidden) in enumerate(kinds.items()):
        for n in range(getattr(counts, group)):
            machine = replace(ways, machine=machines[n % len(machines)])
            tasks.append(SimulatedTask(group, hidden[n % len(hidden)], seed + 1000 * place + n, machine, logger))
    return [tasks[n] for n in np.random.default_rng(seed + 1).permutation(len(tasks))]


def _are_relatives(a: str, b: str) -> bool:
    first, second = (SINGLE[kind][2][0] for kind in (a, b))
    return first == second or RELATIVES.get(first, first) == RELATIVES.get(second, second)


def truth_of(case: Case) -> Truth:
    """Return what is true of a record; a drive whose gain is off shows torques in units of its gain.

    Args:
        case: the record.

    Returns:
        The truth.
    """
    motor, load = case.truth["shifts"]
    # Angles that are all late are a dead time to one record; the log's own lateness is named as a nuisance.
    allowed: tuple[str, ...] = ("input_delay", "drive_filter", "early_torque") if motor else ()
    allowed += ("late_load",) if load != motor else ()
    sizes: dict[str, dict[str, tuple[float, float]]] = {}
    hidden = case.truth["effects"]
    for short, value in hidden.items():
        # Coulomb friction that stands for Stribeck friction has the size of neither of its torques.
        if short in RECOVERED and short.replace("Fc", "Fs") not in hidden.keys() - {short}:
            label, parameter, carries = RECOVERED[short]
            sizes.setdefault(label, {})[parameter] = (value / (case.truth["gain"] if carries else 1.0), 0.0)
    return Truth(case.right, allowed, sizes)


def model_of(case: Case) -> Model:
    """Return the nominal model of a case's machine, each linear parameter known to 5 %.

    Args:
        case: the record.

    Returns:
        The model.
    """
    model = default_model()
    known = dict(model.parameters)
    for name, value in case.truth["nominal"].items():
        known[name] = replace(known[name], value=value, uncertainty=0.05 * value)
    return replace(model, parameters=known)
