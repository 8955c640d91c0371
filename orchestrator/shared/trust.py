"""How far a result can be trusted: one level with its reasons, computed once and shown everywhere.

Green: the answer may be used as it stands. Amber: it may be right, and the reasons say what was not shown. Red: it must
not be used. A level is the worst of what single checks find, so that no good news outweighs a bad one.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from orchestrator.shared.results import TrustFound


class Level(IntEnum):
    """Levels of trust, worst last."""

    GREEN = 0
    AMBER = 1
    RED = 2

    @property
    def word(self) -> str:
        """The level's name in results: "green", "amber" or "red"."""
        return self.name.lower()


@dataclass(frozen=True)
class Reason:
    """What one check found: a level and a sentence part without a full stop."""

    level: Level
    text: str


@dataclass(frozen=True)
class Trust:
    """A level with the reasons that keep it from green; no reasons: green."""

    level: Level  # the worst level of the reasons
    reasons: tuple[str, ...] = ()  # what was found, worst first

    def to_result(self) -> TrustFound:
        """Return the level's word and the reasons, as they stand in result files."""
        return TrustFound(self.level.word, self.reasons)

    def __str__(self) -> str:
        """Return one line: the level, then the reasons."""
        return self.level.word if not self.reasons else f"{self.level.word}: {'; '.join(self.reasons)}"


def trust_of(checks: Iterable[Reason]) -> Trust:
    """Return the trust that single checks leave."""
    reasons = sorted((r for r in checks if r.level is not Level.GREEN), key=lambda r: -r.level)
    return Trust(reasons[0].level if reasons else Level.GREEN, tuple(r.text for r in reasons))
