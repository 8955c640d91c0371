"""Speed and accuracy as ratios measured in one run; the work is in ``benchmarks/masters`` of the source tree."""

from collections.abc import Callable, Mapping, Sequence

from orchestrator.api.shown import Result
from orchestrator.shared.source_tree import import_masters


def benchmark(
    tools: Sequence[str] | None = None,
    *,
    rounds: int = 3,
    pythons: Mapping[str, str] | None = None,
    scaling_too: bool = False,
    native: bool = False,
    fmi: int = 2,
    progress: Callable[[str], None] = lambda text: None,
) -> Result:
    """Run the paired loops under this master and under others, turn by turn; in a clone of the project alone.

    Args:
        tools: which (default: all; those that are not installed say so).
        rounds: turns that every tool gets.
        pythons: interpreter by tool, for tools that cannot share an environment.
        scaling_too: measure also cost against FMUs, steps and cases, and memory.
        native: the FMUs are native builds for this platform instead of Python FMUs.
        fmi: version of FMI of the FMUs, 2 or 3; tools that do not take those of FMI 3.0 say so.
        progress: called with a line on what is measured.

    Returns:
        Its ``rows`` hold medians of wall and CPU time [s], ratios, and deviations [rad] from the reference.

    Raises:
        ScenarioError: a tool is unknown, an interpreter missing, or ``rounds`` out of range; or there is no clone.

    Examples:
        >>> measured = oc.benchmark(["ours"], rounds=1)
        >>> measured.rows[0].deviation < 1e-9
        True
    """
    result: Result = import_masters("benchmark").benchmark(
        tools, rounds=rounds, pythons=pythons, scaling_too=scaling_too, native=native, fmi=fmi, progress=progress
    )
    return result
