"""The page of a result directory."""

from pathlib import Path

from orchestrator.reporting import write_report


def report(directory: Path | str, command: str | None = None) -> Path:
    """Write ``report.html`` into a result directory, from its JSON and CSV files.

    Args:
        directory: where a command or ``save`` left its results.
        command: whose results, where the directory holds several.

    Returns:
        The path of the page.

    Raises:
        ScenarioError: there are no results, or several and ``command`` is not given, or they are damaged.
        OutputError: the directory cannot be written.

    Examples:
        >>> oc.run_pair(alpha=0.02).save("results").name
        'report.html'
        >>> oc.report("results").name
        'report.html'
    """
    return write_report(Path(directory), command)
