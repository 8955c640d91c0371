"""The size of a backlash as every result shows it: half-gap and total play, from load and motor, in rad and degrees."""

import math
from dataclasses import dataclass

from orchestrator.shared.results import Sizes

ARCMIN = 60.0 * 180.0 / math.pi  # arc minutes in a radian


@dataclass(frozen=True)
class Play:
    """A backlash."""

    alpha: float  # half-gap [rad] at the load
    ratio: float  # gear ratio, motor angle over load angle

    @property
    def total(self) -> float:
        """Return the total play [rad] at the load, from one flank to the other."""
        return 2.0 * self.alpha

    def to_result(self) -> Sizes:
        """Return half-gap and total play, at the load and at the motor, in rad and arc minutes."""
        return {
            name: {side: {"rad": value, "arcmin": value * ARCMIN} for side, value in self._sides(load).items()}
            for name, load in (("half_gap", self.alpha), ("total_play", self.total))
        }

    def __str__(self) -> str:
        """Return both sizes from both sides in a line."""
        parts = []
        for name, load in (("half-gap", self.alpha), ("total play", self.total)):
            seen = " and ".join(
                f"{value:.5g} rad ({_degrees(value)}) at the {s}" for s, value in self._sides(load).items()
            )
            parts.append(f"{name} {seen}")
        return "; ".join(parts)

    def _sides(self, load: float) -> dict[str, float]:
        return {"load": load, "motor": load * abs(self.ratio)}


def _degrees(angle: float) -> str:
    """Return an angle [rad] in arc minutes, from a degree on in degrees."""
    arcmin = angle * ARCMIN
    return f"{arcmin:.5g} arcmin" if abs(arcmin) < 60.0 else f"{arcmin / 60.0:.5g} deg"
