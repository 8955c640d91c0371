"""Every threshold of the diagnosis of any FMU, in groups, each with one line of why.

``diagnose_fmu(..., settings=...)`` takes others, or the path of a TOML file of them. Log-likelihoods are natural.
"""

from typing import Annotated

from orchestrator.shared.settings import Settings, note, setting, share


class BoxSearchSettings(Settings, frozen=True):
    """Which effects are tried, and what one must earn to be named."""

    penalty: Annotated[float, setting("log-likelihood that each further value must earn")] = 5.0
    pays: Annotated[float, setting("least gain beyond it for which an effect is named")] = 10.0
    pays_disturbed: Annotated[
        float, setting("the same where noise at the ports is left: it is not as white as it is taken to be")
    ] = 30.0
    quiet: Annotated[float, share("port noise, of the drive, up to which that does not apply")] = 3e-4
    decided: Annotated[float, setting("least gain on the deciding part alone")] = 5.0
    decided_share: Annotated[float, share("and its least share of the gain on the fitted part")] = 0.06
    leaves: Annotated[float, share("of what is gained already, what a further effect must bring: no law is exact")] = (
        0.005
    )
    promise: Annotated[float, setting("least predicted gain for which an effect is fitted at all")] = 8.0
    shortlist: Annotated[int, setting("effects that are fitted in full, in each step", ge=1)] = 8
    starts: Annotated[int, setting("starts of one effect that are fitted in full", ge=1)] = 2
    settled: Annotated[int, setting("effects of a step that are fitted to the end", ge=1)] = 3
    rest: Annotated[float, share("of its gain, what others must promise once one explains the record")] = 0.3
    most: Annotated[int, setting("effects that are named at most", ge=0)] = 4
    beam: Annotated[int, setting("models that are carried on", ge=1)] = 2
    family: Annotated[float, setting("log-likelihood within which a record does not tell two effects apart")] = 6.0
    noise_margin: Annotated[
        float, setting("standard deviations of pure noise's log-likelihood within which a record is explained")
    ] = 4.0


class StartSettings(Settings, frozen=True):
    """What is granted to a start that the FMU does not expose."""

    spread: Annotated[float, setting("how far it may be off, in noise deviations of the outputs")] = 10.0
    pays: Annotated[float, setting("gain in log-likelihood for which that is granted")] = 15.0


class RestSettings(Settings, frozen=True):
    """When what a model leaves is noise, or a small disturbance, and when something is missing."""

    deviations: Annotated[float, setting("standard deviations by which a test may miss what pure noise gives")] = 5.0
    most_correlated: Annotated[
        float, setting("the same for correlation: the filter is that of a surrogate, and not exact")
    ] = 9.0
    most_kurtosis: Annotated[float, setting("excess from which what is left comes in bursts")] = 1.0
    blocks: Annotated[int, setting("equal parts of the record whose power is compared", ge=2)] = 8
    lags: Annotated[int, setting("samples over which correlation is looked for", ge=1)] = 5
    most_port_noise: Annotated[
        float, share("of the drive, up to which what is left may be a disturbance and no missing effect")
    ] = 0.03
    most_with_effects: Annotated[
        float, share("the same where effects are named: beside more of it, what a law leaves could be anything")
    ] = 0.015
    beginnings: Annotated[int, setting("times at which an effort that begins is tried", ge=1)] = 12
    begins: Annotated[float, setting("gain from which an effort that begins at some time is no chance")] = 12.0
    driven: Annotated[
        float, setting("standard deviations of chance from which what is left follows from the drive: no disturbance")
    ] = 5.5
    driven_lags: Annotated[int, setting("samples of the inputs that it may follow from", ge=1)] = 24
    worse: Annotated[
        float, setting("times the misfit without effects from which effects do harm on data not fitted", ge=1)
    ] = 1.1


class BoxSettings(Settings, frozen=True):
    """All thresholds of a diagnosis of any FMU."""

    search: Annotated[BoxSearchSettings, note("the search")] = BoxSearchSettings()
    start: Annotated[StartSettings, note("the start")] = StartSettings()
    rest: Annotated[RestSettings, note("what is left")] = RestSettings()


DEFAULT = BoxSettings()
