"""Default gains of the controller's and the estimator's FMU, so that each runs alone in any tool."""


def default_starts(class_name: str) -> dict[str, float]:
    """Return start values that are computed with ``control`` rather than written down."""
    return {}
