"""Torque balances of a plant along a measured motion: residuals without any simulation.

At each body, the torque that its measured acceleration needs is compared with the torque that acts on it:

    motor   r_m = T - J_m (a_m - f_m)          load   r_l = -J_l (a_l - f_l)

``T`` is the drive's torque, ``a`` the measured acceleration and ``f`` the acceleration that the plant's own equations
give at the measured angles and speeds without ``T`` (Gautier and Khalil's inverse dynamic model). All terms stand
under the triangle average of :mod:`orchestrator.diagnosis.data.signals`.

Residuals are scaled by ``sqrt(J0 / J)``, half-way between a regression of torque on motion, which is right where a
controller holds the path, and one of motion on torque, which is right where the motion is free: either alone explains a
record by an inertia of zero or of infinity. The load's balance has no measured torque in it and counts as an
acceleration. An effect that takes torque away from the drive is charged for it: no torque at all would explain best.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Self

import numpy as np

from orchestrator.diagnosis.data.signals import (
    Signals,
    first_derivative,
    prepare_signals,
    second_derivative,
    second_difference_gain,
    smooth,
    triangle_average,
)
from orchestrator.diagnosis.model.drive import delivered_torque, logged_torque, shift_signal
from orchestrator.diagnosis.model.encoders import centre_angles
from orchestrator.diagnosis.model.interface import (
    CandidateEffect,
    ModelPoint,
    NoiseSources,
    ResidualModel,
    UncertainParameter,
    as_uncertain,
)
from orchestrator.diagnosis.model.plant_effects import candidate_effects, effect_parameters, in_metres
from orchestrator.diagnosis.settings import BalanceSettings, DiagnosisSettings
from orchestrator.effects.effect import SignalScales, rms
from orchestrator.effects.of_logs import LEAD, SAMPLED, SHIFT
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array

SHORTEST = 1e-9  # rad: distance over which friction of a body that does not move builds up
INITIAL_TORQUE = "initial torque"
ZERO = "zero of the load's encoder"  # a value of the log: no effect of the machine is what is left of our correction
ZERO_SPREAD = 0.03  # rad: how far an estimate of it may be off
MOST_KEPT = 60  # intermediate signals, for the next values
_POOL = ThreadPoolExecutor(2)


class TorqueBalance(ResidualModel):
    """A plant of ours beside one record: a :class:`ResidualModel`.

    ``signals`` have as many angles as the plant has bodies with an encoder.
    """

    def __init__(self, model: Model, signals: Signals, settings: BalanceSettings, angular: bool = True) -> None:
        plant = model.plant
        self.plant, self.signals, self.settings, self.scaled = plant, signals, settings, True
        self.angular = angular
        self.nominal = plant.extend_values(model.values)
        self.step, self.size, self.cutoffs = signals.step, signals.size, signals.cutoffs
        self.channels = tuple(body.name for body in plant.bodies[: len(signals.angles)])
        self.edges = settings.fade if len(self.channels) > 1 else 0.3 * settings.fade
        self.hides_load = len(plant.bodies) > len(self.channels)
        self.inertias = tuple(plant.index(body.inertia) for body in plant.bodies[: len(self.channels)])
        top = 3.0 * max(signals.cutoffs)
        self._angles = [smooth(angle, self.step, min(0.3 / self.step, top)) for angle in signals.angles]
        self._speeds = [first_derivative(angle, self.step) for angle in self._angles]
        self._accelerations = [second_derivative(angle, self.step) for angle in signals.angles]
        self._bristles: dict[tuple[int, float], Array] = {}
        self._torques: dict[tuple[float, ...], Array] = {}
        self._drive = tuple(
            plant.index(name)
            for name in (*vars(plant.drive).values(), LEAD.name, SAMPLED.name)
            if isinstance(name, str) and name in plant.names
        )
        self.parameters = self._uncertain(model)
        self._places = [plant.index(entry.name) for entry in self.parameters if not entry.local]
        self.active = np.array([self._active(speed) for speed in self._speeds])
        self._hidden = self._simulate_hidden_load(self.nominal)[0] if self.hides_load else np.empty((0, 2))
        self._known = candidate_effects(model, self.scales, self.channels)
        hidden = {row.label for row in plant.bank if not row.shown(self.scales)}
        if signals.zeros_set and plant.offsets:
            hidden |= {row.label for row in plant.bank if set(row.parameters.values()) <= set(plant.offsets)}
        self.effects: Mapping[str, CandidateEffect] = {
            label: one for label, one in self._known.items() if label not in hidden
        }

    def _uncertain(self, model: Model) -> tuple[UncertainParameter, ...]:
        known = tuple(
            as_uncertain(entry) for entry in model.uncertain if entry.value != 0.0 or entry.name in self.plant.linear
        )
        local, torque = [], rms(self.signals.torque)
        if self.plant.value(self.nominal, self.plant.drive.lag) > 3.0 * self.step:
            local.append(UncertainParameter(INITIAL_TORQUE, 0.0, 1.0, "N.m", True, scale=torque, reported=False))
        if self.signals.zeros_set:
            local.append(UncertainParameter(ZERO, 0.0, 1.0, "rad", True, scale=ZERO_SPREAD, reported=False))
        return (*known, *local)

    def _active(self, speed: Array) -> Array:
        """Return the rows (n,) at which a body moves: at rest dry friction takes whatever is left there."""
        slow = smooth(speed, self.step, min(0.3 / self.step, max(self.cutoffs)))
        moving = np.abs(slow) > self.settings.at_rest * rms(slow)
        return (moving & self.signals.measured).astype(float)

    @cached_property
    def scales(self) -> SignalScales:
        """Typical sizes of the record's signals."""
        plant, signals = self.plant, self.signals
        ratio = plant.ratio(self.nominal)
        angles, speeds, accelerations = list(self._angles), list(self._speeds), list(self._accelerations)
        resolutions = [
            max(6.0 * noise, 2e-5 * float(np.ptp(angle)), SHORTEST)
            for noise, angle in zip(signals.noise, angles, strict=True)
        ]
        if self.hides_load:
            angles.append(self._hidden[:, 0])
            speeds.append(self._hidden[:, 1])
            accelerations.append(first_derivative(self._hidden[:, 1], self.step))
            resolutions.append(resolutions[0] / ratio)
        twist = angles[0] / ratio - angles[1] if len(angles) > 1 else np.empty(0)
        return SignalScales(
            step=self.step, cycle=max(self.step / signals.rows_each, signals.torque_raster),
            cutoff=max(self.cutoffs), requests=signals.torque, torque=rms(signals.torque),
            angles={"motor": angles[0], "load": angles[-1]}, speeds={"motor": speeds[0], "load": speeds[-1]},
            resolutions={"motor": resolutions[0], "load": resolutions[-1]},
            acceleration=rms(triangle_average(accelerations[-1])),
            inertia=plant.value(self.nominal, plant.bodies[-1].inertia),
            stiffness=plant.value(self.nominal, plant.shaft.stiffness) if plant.shaft else 0.0, ratio=ratio,
            twist=twist, twist_is_measured=not self.hides_load, angular=self.angular,
            torque_raster=signals.torque_raster,
        )  # fmt: skip

    # --- residuals -----------------------------------------------------------------------------------------

    def values_at(self, point: ModelPoint) -> Array:
        """Return the plant's parameters (n,) at a point."""
        p = self.nominal.copy()
        p[self._places] = point.parameters[: len(self._places)]
        if self.signals.zeros_set:
            p[self.plant.index(self.plant.offsets[-1])] += self._local(ZERO, point)
        given: dict[str, float] = {}
        for label, values in point.effects.items():  # the first effect that has a parameter sets it
            given = {**effect_parameters(self.plant, self._known[label], values), **given}
        for name, value in given.items():
            p[self.plant.index(name)] = value
        return p

    def physical_values(self, point: ModelPoint) -> Array:
        """Return the plant's parameters (n,) at a point, distances over which friction builds up as the model has them.

        Those of the analysis are what the encoder's noise asks for, and nothing of the machine.
        """
        p = self.values_at(point)
        unreported = [self.plant.index(name) for row in self.plant.bank for name in row.unreported.values()]
        p[unreported] = self.nominal[unreported]
        return p

    def residuals(self, points: Sequence[ModelPoint]) -> list[Array]:
        """Return the residuals (channels, n) [N.m] at each of some points; see :class:`ResidualModel`."""
        if len(points) < 4:
            return [self.residual(point) for point in points]
        return list(_POOL.map(self.residual, points))

    def residual(self, point: ModelPoint) -> Array:
        """Return the residuals (channels, n) [N.m] at a point."""
        p = self.values_at(point)
        return np.asarray(self.balance(p, self._local(INITIAL_TORQUE, point)) * self.residual_scale(point, p)[:, None])

    def residual_scale(self, point: ModelPoint, p: Array) -> Array:
        """Return (channels,) residual over missing torque, as the head of the module says; ``p``: of the point."""
        if not self.scaled:
            return np.ones(len(self.channels))
        scale = np.array([self.nominal[place] / p[place] for place in self.inertias])
        scale[0] = np.sqrt(scale[0])
        if any(self._known[label].takes_drive for label in point.effects):
            scale *= rms(self.drive_torque(self.nominal)) / rms(self.drive_torque(p))
        return scale

    def _local(self, name: str, point: ModelPoint) -> float:
        pairs = zip(self.parameters, point.parameters, strict=False)
        return next((value for entry, value in pairs if entry.name == name), 0.0)

    def balance(self, p: Array, initial: float = 0.0) -> Array:
        """Return the torques (channels, n) [N.m] that are missing at each body.

        ``initial``: torque of the drive at the first row [N.m].
        """
        plant, step = self.plant, self.step
        angles, speeds, accelerations = self._motion(p)
        found = np.empty((self.size, 2))
        if self.hides_load:
            found[:, 0] = self._simulate_hidden_load(p)[1]
        else:
            motion = np.column_stack([angles[0], speeds[0], angles[-1], speeds[-1]])
            plant.motion.accelerate(motion, self._directions(p), p, step, self._uses_memory(p), found)
        missing = np.array(
            [p[place] * (triangle_average(found[:, n]) - accelerations[n]) for n, place in enumerate(self.inertias)]
        )
        missing[0] += self.drive_torque(p)
        if initial:
            missing[0] += initial * np.exp(-step * np.arange(self.size) / plant.value(p, plant.drive.lag))
        return missing

    def _simulate_hidden_load(self, p: Array) -> tuple[Array, Array]:
        """Return angle and speed (n, 2) of a load that no encoder shows, and the motor's acceleration (n,)."""
        (angle, *_), (speed, *_), _ = self._motion(p)
        motion, signs, acceleration = np.empty((self.size, 2)), np.empty(self.size), np.empty(self.size)
        width = float(np.exp(self.plant.value(p, self.plant.presliding[1])))
        substeps = max(2, self.plant.substeps(p, self.step))
        fill = self.plant.motion.accelerate_with_hidden_load
        bristle = np.ascontiguousarray(self._directions(p)[:, 0])
        fill(np.column_stack([angle, speed]), width, p, self.step, substeps, bristle, motion, signs, acceleration)
        return motion, acceleration

    def _motion(self, p: Array) -> tuple[list[Array], list[Array], list[Array]]:
        """Return angles, speeds and accelerations of the bodies, from how the log has them."""
        angles = list(self._angles)
        for n, name in enumerate(self.plant.offsets[: len(angles)]):
            angles[n] = angles[n] - float(p[self.plant.index(name)])
        speeds, accelerations = list(self._speeds), list(self._accelerations)
        late = self.plant.value(p, SHIFT.name) if SHIFT.name in self.plant.names else 0.0
        if late and len(angles) > 1:
            for values in (angles, speeds, accelerations):
                values[1] = shift_signal(values[1], -late / self.step)
        for n, (angle, centred) in enumerate(zip(angles, centre_angles(self.plant, p, angles), strict=True)):
            if centred is not angle:
                error = angle - centred
                angles[n], speeds[n] = centred, speeds[n] - first_derivative(error, self.step)
                accelerations[n] = accelerations[n] - second_derivative(error, self.step)
        return angles, speeds, accelerations

    def _directions(self, p: Array) -> Array:
        """Return the directions (n, 2) of dry friction, which build up over the distances in ``p``."""
        signs = np.zeros((self.size, 2))
        for n, (angle, distance) in enumerate(zip(self._angles, self.plant.presliding, strict=False)):
            key = (n, self.plant.value(p, distance))
            if key not in self._bristles:
                if len(self._bristles) > MOST_KEPT:
                    self._bristles.clear()
                steps, bristle = np.diff(angle, prepend=angle[0]), np.empty(self.size)
                self.plant.motion.slide_bristle(steps, float(np.exp(key[1])), bristle)
                self._bristles[key] = bristle
            signs[:, n] = self._bristles[key]
        return signs

    def drive_torque(self, p: Array) -> Array:
        """Return the drive's torque (n,) [N.m] under the triangle average, kept for what was asked for lately."""
        key = tuple(float(p[place]) for place in self._drive)
        if key not in self._torques:
            if len(self._torques) > MOST_KEPT:
                self._torques.clear()
            requests = logged_torque(self.plant, p, self.signals.torque, self.signals.smoothing)
            self._torques[key] = delivered_torque(self.plant, p, requests, self.step, self.signals.held)
        return self._torques[key]

    def _uses_memory(self, p: Array) -> bool:
        sizes = [effect.places(self.plant)[effect.size] for effect in self.plant.bank if effect.memory]
        return bool(np.any(p[sizes] != 0.0)) if sizes else False

    def reference_signals(self, point: ModelPoint) -> Array:
        """Return the drive's torque, and the torque that the load's acceleration needs; see :class:`ResidualModel`."""
        p = self.values_at(point)
        further = [p[n] * a for n, a in list(zip(self.inertias, self._accelerations, strict=True))[1:]]
        return np.array([self.drive_torque(p), *further])

    def inertia_shares(self) -> Mapping[str, float]:
        """Return each inertia's share as the motor feels it; see :class:`ResidualModel`."""
        felt = [
            self.nominal[place] / (self.plant.ratio(self.nominal) ** 2 if body.geared else 1.0)
            for place, body in ((self.plant.index(body.inertia), body) for body in self.plant.bodies)
        ]
        return {body.inertia: float(value / sum(felt)) for body, value in zip(self.plant.bodies, felt, strict=True)}

    def without_priors(self, spread: float) -> Self:
        """Return plain balances with every parameter unknown; see :class:`ResidualModel`."""
        other = super().without_priors(spread)
        other.scaled = False
        return other

    # --- noise ---------------------------------------------------------------------------------------------

    def noise_sources(self, frequencies: Array) -> NoiseSources:
        """Return encoders' noise through the linear plant, and torques at the bodies; see :class:`ResidualModel`."""
        s = 2j * np.pi * frequencies
        gain = second_difference_gain(frequencies, self.step)
        plant, count = self.plant, len(self.channels)
        jacobian = plant.jacobian(self.nominal)
        row = {place: n for n, place in enumerate(plant.states)}
        bodies = len(plant.bodies)
        measured = np.zeros((frequencies.size, bodies, bodies), dtype=complex)
        for r, body in enumerate(plant.bodies):
            inertia = plant.value(self.nominal, body.inertia)
            for c, other in enumerate(plant.bodies):
                rate = jacobian[row[body.speed], row[other.angle]] + s * jacobian[row[body.speed], row[other.speed]]
                measured[:, r, c] = inertia * (rate + (gain if r == c else 0.0))
        if self.hides_load:  # which follows the motor's angle
            through = measured[:, 0, 1] * measured[:, 1, 0] / np.where(measured[:, 1, 1] == 0.0, 1.0, measured[:, 1, 1])
            measured = (measured[:, 0, 0] - through)[:, None, None]
        process = np.broadcast_to(np.eye(count, dtype=complex), (frequencies.size, count, count))
        least = self.settings.torque_floor * rms(self.drive_torque(self.nominal)) ** 2
        floors = [
            least / cutoff * (self.plant.ratio(self.nominal) ** 2 if n else 1.0)
            for n, cutoff in enumerate(self.cutoffs)
        ]
        return NoiseSources(measured, self._encoder_levels(), process, np.array(floors))

    def _encoder_levels(self) -> Array:
        """Return each encoder's noise (one-sided density), read where second differences are highest in frequency."""
        from scipy.signal import welch

        levels = []
        for angle in self.signals.angles:
            frequencies, power = welch(
                np.diff(angle, 2) / self.step**2, 1.0 / self.step, nperseg=min(self.size // 4, 1024), detrend=False
            )
            top = frequencies > 0.6 * frequencies[-1]
            levels.append(np.median(power[top] / second_difference_gain(frequencies[top], self.step) ** 2))
        return np.array(levels)

    def is_possible(self, label: str, point: ModelPoint) -> bool:
        """Tell whether a machine can have an effect as a point has it; see :class:`ResidualModel`."""
        row = self.plant.effect(label)
        named = effect_parameters(self.plant, self._known[label], point.effects[label])
        short = {name: named[full] for name, full in row.parameters.items()}
        viscous = next((body.viscous for body in self.plant.bodies if body.name == row.site), "")
        short["viscous"] = self.plant.value(self.values_at(point), viscous) if viscous else 0.0
        return row.possible(short, self.scales)


def balance_of(record: Record, model: Model, settings: DiagnosisSettings) -> TorqueBalance:
    """Return the torque balances of a model beside a record."""
    plant = model.plant
    two = len(plant.bodies) > 1
    inertia = None if two else plant.value(plant.extend_values(model.values), plant.bodies[0].inertia)
    signals = prepare_signals(record, inertia, settings.band, two)
    return TorqueBalance(model, signals, settings.balance, angular=not in_metres(model))
