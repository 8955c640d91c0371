"""What is wrong with a system or the file that describes it, all of it at once."""

from dataclasses import dataclass

from orchestrator.errors import ConnectionMismatchError, ScenarioError
from orchestrator.plain_text import plain_text


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong with a scenario, and where."""

    path: str  # such as ``$.connections[2].to``
    text: str  # "`x` must ..., but is ..."
    mismatch: bool = False  # two variables cannot be connected

    def __str__(self) -> str:
        return f"{self.path}: {self.text}"


def raise_problems(problems: list[Problem], origin: str = "", *arguments: str) -> None:
    """Raise one error that names all ``problems``; none, no error."""
    if not problems:
        return
    text = plain_text((f"{origin}: " if origin else "") + "; ".join(str(p) for p in problems))
    kind = ConnectionMismatchError if all(p.mismatch for p in problems) else ScenarioError
    raise kind(text, *arguments)
