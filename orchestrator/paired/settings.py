"""Every threshold of a calibration, with one line of why."""

from typing import Annotated

from orchestrator.shared.settings import Settings, setting, share


class MapSettings(Settings, frozen=True):
    """How the map from S to the half-gap is made."""

    clean_sizes: Annotated[int, setting("runs without noise: nodes of the map", ge=9)] = 241
    noisy_sizes: Annotated[int, setting("sizes at which noise is drawn: its effect changes slowly", ge=5)] = 121
    seeds_per_size: Annotated[int, setting("draws at each: neighbours are averaged too", ge=2)] = 24
    validation_runs: Annotated[int, setting("disjoint runs that set the interval's width", ge=20)] = 4000
    level: Annotated[float, share("of the intervals that hold the size", le=0.999)] = 0.95
    margin_below: Annotated[float, setting("smallest size calibrated over the smallest claimed", gt=0.0, le=1.0)] = 0.75
    margin_above: Annotated[float, setting("largest size calibrated over the largest claimed", ge=1.0)] = 1.1
    edge_deviations: Annotated[float, setting("noise deviations below the smallest S that still mean a tiny gap")] = 5.0
    least_spread: Annotated[float, setting("least spread of log alpha: rounding, where nothing else is", gt=0.0)] = (
        1e-12
    )
    least_slope: Annotated[float, setting("least slope of the map by which a spread of S is divided", gt=0.0)] = 1e-6
