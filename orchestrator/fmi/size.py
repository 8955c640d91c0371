"""How large a system may be: a few bytes of a file can ask for more variables than a machine has memory."""

from collections.abc import Iterable
from pathlib import Path

from orchestrator.errors import ScenarioError

MOST_VARIABLES = 250_000
"""Variables of all FMUs and connectors of a system, arrays by their elements: six times the largest FMU seen.

Each takes about 1 KiB and 20 us before a run begins, and no limit of memory or time holds until then.
"""


def element_count(sizes: Iterable[int]) -> int:
    """Return the product of sizes of dimensions, all positive; beyond ``MOST_VARIABLES`` it is counted no further."""
    count = 1
    for size in sizes:
        count *= size
        if count > MOST_VARIABLES:
            break
    return count


class SystemSize:
    """Counts the variables of a system as they are found, before they are made.

    Args:
        origin: file that describes the system.
    """

    def __init__(self, origin: Path) -> None:
        self._origin, self._count = origin, 0

    def add(self, count: int, owner: str) -> None:
        """Count variables of ``owner``, and raise a ScenarioError where they are too many."""
        self._count += count
        if self._count > MOST_VARIABLES:
            text = f"must have at most {MOST_VARIABLES} variables, elements of arrays included, but has more"
            raise ScenarioError(f"{self._origin}: a system {text}: counted up to {owner}")
