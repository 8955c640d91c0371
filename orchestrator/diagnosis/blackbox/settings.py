"""Every threshold of the diagnosis of any FMU, in groups, each with one line of why.

``diagnose(record, fmu, map, settings=...)`` takes others, or the path of a TOML file. Log-likelihoods are natural.
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
    near: Annotated[float, share("of what the best model gains, by which another may be behind to be carried on")] = 0.3
    family: Annotated[float, setting("log-likelihood within which a record does not tell two effects apart")] = 6.0
    noise_margin: Annotated[
        float, setting("standard deviations of pure noise's log-likelihood within which a record is explained")
    ] = 4.0


class ScreenSettings(Settings, frozen=True):
    """How far linearisation is trusted before anything is fitted."""

    smallest: Annotated[
        float, share("of a start down to which the response to it is scaled, where it is proportional")
    ] = 0.01
    least: Annotated[float, share("the same for an effect of a finite size: beyond, another start is nearer")] = 0.3
    most: Annotated[float, setting("times its own response that a start may stand for", ge=1)] = 2.0
    exact: Annotated[float, share("by which a scanned value's response may be off: a surrogate is not exact")] = 0.2
    scanned: Annotated[int, setting("values of one effect that its scan hands on to the FMU", ge=1)] = 3
    apart: Annotated[int, setting("places in a scan by which they are apart: neighbours lead to one fit", ge=1)] = 3
    parts: Annotated[int, setting("parts into which the scan's step is cut around the best value", ge=1)] = 8
    straight: Annotated[float, share("of the record up to which a run that goes astray earlier is screened apart")] = (
        0.9
    )


class FitterSettings(Settings, frozen=True):
    """How a model is fitted by free runs."""

    iterations: Annotated[int, setting("Gauss-Newton iterations at most", ge=1)] = 6
    difference: Annotated[float, setting("step of a difference, in standard deviations of a parameter's prior")] = 0.1
    enough: Annotated[float, setting("gain in log-likelihood below which an iteration is the last")] = 0.05
    as_expected: Annotated[float, share("of what an iteration promised, from which its Jacobian serves once more")] = (
        0.9
    )
    astray: Annotated[float, share("of an output's standard deviation beyond which a free run has gone astray")] = 0.2
    astray_noise: Annotated[float, setting("the same in noise deviations, whichever is more")] = 10.0
    lost: Annotated[float, share("of the fitted part that a free run must keep close, to be fitted over all of it")] = (
        0.7
    )
    stages: Annotated[int, setting("growing parts of the record at most", ge=0)] = 8
    further: Annotated[float, setting("times its reach that a run is fitted over next", ge=1)] = 1.3
    annealed_from: Annotated[float, share("port noise, of the drive, from which a fit is tried with ever less")] = 3e-4
    annealed: Annotated[int, setting("iterations at each of these levels", ge=1)] = 3
    pieces: Annotated[int, setting("pieces of a record whose parts take turns: every third one decides", ge=3)] = 24
    comb: Annotated[
        float, setting("half width of the first comb over a value that acts in steps, in small changes of it")
    ] = 4.0
    combs: Annotated[int, setting("combs, one within the other", ge=0)] = 3
    teeth: Annotated[int, setting("values of each: their distance is that of the next comb's width", ge=3)] = 25
    finer: Annotated[float, share("width of a comb over that of the one before")] = 0.1


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
    push: Annotated[float, share("of the drive, by which its response is measured")] = 0.02
    begins: Annotated[float, setting("gain from which an effort that begins at some time is no chance")] = 12.0
    driven: Annotated[
        float, setting("standard deviations of chance from which what is left follows from the drive: no disturbance")
    ] = 5.5
    driven_lags: Annotated[int, setting("samples of the inputs that it may follow from", ge=1)] = 24
    stretches: Annotated[
        int, setting("parts of an output's range in each of which what is left may act in a way of its own", ge=2)
    ] = 12
    stands_out: Annotated[float, setting("times the expected power from which a stretch of time is pointed at")] = 1.3
    worse: Annotated[
        float, setting("times the misfit without effects from which effects do harm on data not fitted", ge=1)
    ] = 1.1
    notable_misfit: Annotated[
        float,
        setting(
            "times its noise from which an output's misfit on data not fitted takes a result from green: noise alone "
            "stays below over 300 rows, by five deviations",
            ge=1,
        ),
    ] = 1.2


class CalibrationSettings(Settings, frozen=True):
    """What is said of parameters that are fitted alone."""

    confounded: Annotated[float, share("correlation from which two parameters count as not told apart")] = 0.95
    learned: Annotated[float, share("of its uncertainty, below which a record has said little of a parameter")] = 0.3


class BoxSettings(Settings, frozen=True):
    """All thresholds of a diagnosis of any FMU."""

    search: Annotated[BoxSearchSettings, note("the search")] = BoxSearchSettings()
    screen: Annotated[ScreenSettings, note("the screening before it")] = ScreenSettings()
    fit: Annotated[FitterSettings, note("each fit")] = FitterSettings()
    start: Annotated[StartSettings, note("the start")] = StartSettings()
    rest: Annotated[RestSettings, note("what is left")] = RestSettings()
    calibration: Annotated[CalibrationSettings, note("parameters alone")] = CalibrationSettings()


DEFAULT = BoxSettings()
