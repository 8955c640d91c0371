"""What repeats with an angle: ripple, gravity, eccentricity, a varying inertia.

In all functions: ``angle`` [rad]; ``phase``: at angle zero [rad].
"""

from math import cos, sin

from .parameter_rows import BIG, Parameter, mark_linear

LARGEST = 1.7976931348623157e308


def wave_rows(
    effect: str,
    unit: str,
    text: str,
    cycles: float,
    of_cycles: str = "Its cycles per revolution",
    of_phase: str = "Its phase at angle zero",
) -> tuple[Parameter, ...]:
    """Return amplitude, cycles and phase of what repeats with an angle, with their descriptions."""
    return (
        Parameter(f"effects.{effect}.amplitude", unit, 0.0, -BIG, BIG, text),
        *mark_linear(
            Parameter(f"effects.{effect}.cycles_per_rev", "1", cycles, 0.0, BIG, of_cycles),
            Parameter(f"effects.{effect}.phase", "rad", 0.0, -BIG, BIG, of_phase),
        ),
    )


def ripple_rows(text: str, of_cycles: str, zero: str) -> tuple[Parameter, ...]:
    """Return the rows of a drive's torque ripple; ``zero`` names what its phase is counted at."""
    return wave_rows("torque_ripple", "N.m", text, 6.0, of_cycles, f"Ripple phase at {zero} zero")


def _harmonic_rows(order: str) -> tuple[Parameter, ...]:
    """Return amplitude and phase of a harmonic of the torque ripple."""
    return (
        Parameter(f"effects.torque_ripple.{order}.amplitude", "N.m", 0.0, -BIG, BIG, f"Its {order} harmonic"),
        *mark_linear(
            Parameter(f"effects.torque_ripple.{order}.phase", "rad", 0.0, -BIG, BIG, "Phase of that at angle zero"),
        ),
    )


def gravity_rows(zero: str) -> tuple[Parameter, ...]:
    """Return amplitude and phase of the gravity torque; ``zero`` names what its phase is counted at."""
    return (
        Parameter("effects.gravity_load.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the gravity torque"),
        *mark_linear(
            Parameter("effects.gravity_load.phase", "rad", 0.0, -BIG, BIG, f"Gravity phase at {zero} zero"),
        ),
    )


HARMONICS = (*_harmonic_rows("second"), *_harmonic_rows("third"))
VARYING_INERTIA = wave_rows("varying_inertia", "kg.m2", "Part of the load's inertia that turns with its angle", 1.0)


def sine(angle: float) -> float:
    """Return the sine, and 0 for an angle that is not finite: a trial step that overflows is refused, not raised."""
    return sin(angle) if abs(angle) <= LARGEST else 0.0


def cosine(angle: float) -> float:
    """Return the cosine, and 0 for an angle that is not finite."""
    return cos(angle) if abs(angle) <= LARGEST else 0.0


def periodic(angle: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return ``amplitude sin(cycles_per_rev angle + phase)``, in the unit of the amplitude."""
    if amplitude == 0.0:
        return 0.0
    return amplitude * sine(cycles_per_rev * angle + phase)


def wave(angle: float, sine_part: float, cosine_part: float, cycles_per_rev: float) -> float:
    """Return :func:`periodic` by its parts of sine and cosine, in which it is linear."""
    return sine_part * sine(cycles_per_rev * angle) + cosine_part * cosine(cycles_per_rev * angle)


def periodic_slope(angle: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return the derivative of :func:`periodic` by the angle, in the unit of the amplitude a radian."""
    if amplitude == 0.0:
        return 0.0
    return amplitude * cycles_per_rev * cosine(cycles_per_rev * angle + phase)


def periodic_curvature(angle: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return the second derivative of :func:`periodic` by the angle, in the unit of the amplitude a radian squared."""
    if amplitude == 0.0:
        return 0.0
    return -amplitude * cycles_per_rev * cycles_per_rev * sine(cycles_per_rev * angle + phase)


def inertia_torque(angle: float, speed: float, amplitude: float, cycles: float, phase: float) -> float:
    """Return the torque against a part [N.m] whose inertia turns with its angle, at a ``speed`` [rad/s]."""
    return 0.5 * periodic_slope(angle, amplitude, cycles, phase) * speed * speed


def inertia_at(inertia: float, angle: float, amplitude: float, cycles: float, phase: float) -> float:
    """Return the inertia [kg.m2] at an angle; a wave larger than the mean ``inertia`` leaves a thousandth of it."""
    return max(1e-3 * inertia, inertia + periodic(angle, amplitude, cycles, phase))
