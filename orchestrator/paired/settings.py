"""Every threshold of a calibration, with one line of why."""

from typing import Annotated

from orchestrator.shared.settings import Settings, setting, share


class MapSettings(Settings, frozen=True):
    """How the map from S to the half-gap is made."""

    clean_sizes: Annotated[int, setting("runs without noise: the nodes of the map", ge=9)] = 241
    noisy_sizes: Annotated[int, setting("half-gaps with noisy runs: the effect of noise changes slowly", ge=5)] = 121
    seeds_per_size: Annotated[
        int, setting("noisy runs per half-gap; neighbouring half-gaps are averaged as well", ge=2)
    ] = 24
    validation_runs: Annotated[int, setting("separate runs that determine the width of the interval", ge=20)] = 4000
    level: Annotated[float, share("probability of the intervals", le=0.999)] = 0.95
    margin_below: Annotated[
        float, setting("smallest calibrated half-gap over the smallest claimed", gt=0.0, le=1.0)
    ] = 0.75
    margin_above: Annotated[float, setting("largest calibrated half-gap over the largest claimed", ge=1.0)] = 1.1
    edge_deviations: Annotated[float, setting("noise deviations below the smallest S that count as a tiny gap")] = 5.0
    least_spread: Annotated[float, setting("smallest standard deviation of log alpha: rounding errors", gt=0.0)] = 1e-12
    least_slope: Annotated[float, setting("smallest slope of the map by which a deviation of S is divided", gt=0.0)] = (
        1e-6
    )
