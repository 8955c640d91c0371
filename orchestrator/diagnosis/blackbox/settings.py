"""Every threshold of the diagnosis of any FMU, in groups, each with one line of why.

``diagnose(record, fmu, map, settings=...)`` takes others, or the path of a TOML file. Log-likelihoods are natural.
"""

from typing import Annotated

from orchestrator.diagnosis.blackbox.probe_settings import ProbeSettings
from orchestrator.shared.settings import Settings, note, setting, share


class BoxSearchSettings(Settings, frozen=True):
    """Which effects are tried, and what one must earn to be named."""

    penalty: Annotated[float, setting("log-likelihood that each further value must earn")] = 5.0
    pays: Annotated[float, setting("least gain beyond it for which an effect is named")] = 10.0
    pays_disturbed: Annotated[
        float, setting("the same where noise at the ports is left: it is not as white as it is taken to be")
    ] = 30.0
    least_errors: Annotated[
        float, setting("standard errors by which a size must differ from zero once all rows are fitted, in fine steps")
    ] = 4.0
    least_sharp: Annotated[
        float, setting("standard errors by which a ripple's wavenumber must differ from zero: a smooth curve has none")
    ] = 10.0
    quiet: Annotated[float, share("port noise, of the drive, up to which that does not apply")] = 3e-4
    decided: Annotated[float, setting("least gain on the deciding part alone")] = 5.0
    decided_share: Annotated[float, share("and its least share of the gain on the fitted part")] = 0.06
    doubtful: Annotated[
        float, setting("gain beyond the penalty from which all of the record is asked, where it is too little")
    ] = 3.0
    doubted: Annotated[int, setting("effects of a step that it is asked about", ge=0)] = 3
    leaves: Annotated[float, share("of what is gained already, what a further effect must bring: no law is exact")] = (
        0.005
    )
    law: Annotated[
        float, share("of what an effect at a port changes of the outputs, that its law may be off by: no further one")
    ] = 0.01
    promise: Annotated[float, setting("least predicted gain for which an effect is fitted at all")] = 8.0
    slight: Annotated[
        float,
        share(
            "of what is first tried, a hundredth of the drive, below which an effort is a matter of the FMU's solver"
        ),
    ] = 1e-3
    ahead: Annotated[
        int, setting("effects of a step that a second is looked for beside, where none pays alone", ge=0)
    ] = 2
    ahead_to: Annotated[
        float, share("port noise, of the drive, up to which that is done: beyond it is called no disturbance")
    ] = 0.03
    kept: Annotated[float, share("of what an effect promises, that a fit must reach for it to be kept")] = 0.5
    led: Annotated[int, setting("promises not kept that are fitted at the port noise that they suppose", ge=0)] = 3
    shortlist: Annotated[int, setting("effects that are fitted in full, in each step", ge=1)] = 8
    starts: Annotated[int, setting("starts of one effect that are fitted in full", ge=1)] = 2
    settled: Annotated[int, setting("effects of a step that are fitted to the end", ge=1)] = 3
    surely: Annotated[
        float, setting("times the gain that names an effect, from which linearisation alone tells that it is needed")
    ] = 5.0
    ahead_of_it: Annotated[
        float, share("of what is missing, that inputs which come a little earlier must explain for it to be said")
    ] = 0.8
    rest: Annotated[float, share("of its gain, what others must promise once one explains the record")] = 0.3
    most: Annotated[int, setting("effects that are named at most", ge=0)] = 4
    beam: Annotated[int, setting("models that are carried on", ge=1)] = 2
    near: Annotated[float, share("of what the best model gains, by which another may be behind to be carried on")] = 0.3
    family: Annotated[float, setting("log-likelihood within which a record does not tell two effects apart")] = 6.0
    departs: Annotated[
        float, share("by which a law must differ from the one that it contains, to be told as of its family")
    ] = 0.1
    rivals: Annotated[
        int,
        setting(
            "effects put in the place of each that is named, to see whether they do as well: lags and delays on either "
            "side of an FMU are four",
            ge=0,
        ),
    ] = 3
    rivals_beside_noise: Annotated[
        int, setting("the same beside noise at the ports, where a fit's end says less of who rivals", ge=0)
    ] = 6
    rival_starts: Annotated[
        int, setting("starts of each then: where its own fit ended, and what it promises in that place", ge=1)
    ] = 2
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
    sifted: Annotated[int, setting("small values of one effect that are put among those of its scan", ge=0)] = 3
    stands_out: Annotated[
        float,
        setting(
            "times what the best of as many would be by chance, from which a small value is tried: between two values "
            "that are tried a little is lost, and its fit tells chance",
            ge=0,
        ),
    ] = 0.8
    at_once: Annotated[int, setting("errors of small values that are held in memory at a time", ge=1)] = 500_000
    parts: Annotated[int, setting("parts into which the scan's step is cut around the best value", ge=1)] = 8
    window: Annotated[
        int, setting("samples of the sliding cubic that gives speed and acceleration of a measured motion", ge=5)
    ] = 7
    straight: Annotated[float, share("of the record up to which a run that goes astray earlier is screened apart")] = (
        0.9
    )


class FitterSettings(Settings, frozen=True):
    """How a model is fitted by free runs."""

    iterations: Annotated[int, setting("Gauss-Newton iterations at most", ge=1)] = 6
    difference: Annotated[float, setting("step of a difference, in standard deviations of a parameter's prior")] = 0.1
    wild: Annotated[
        float, setting("change of the outputs, in units of their noise, from which a difference takes a smaller step")
    ] = 10.0
    least_step: Annotated[float, share("of its step as given, that such a smaller one has at least")] = 1e-6
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
    patience: Annotated[
        int, setting("of these levels in turn that lead to nothing likelier, until no more are tried", ge=1)
    ] = 2
    quieter: Annotated[float, setting("how many times less noise the next of them has at least", gt=1.0)] = 2.5
    shorter: Annotated[float, share("of a step that is tried where the whole gains little")] = 0.4
    half_way: Annotated[float, share("of what a step promised, from which no shorter one is tried")] = 0.5
    pieces: Annotated[int, setting("pieces of a record whose parts take turns: every third one decides", ge=3)] = 24
    comb: Annotated[
        float, setting("half width of the first comb over a value that acts in steps, in small changes of it")
    ] = 4.0
    combs: Annotated[int, setting("combs, one within the other", ge=0)] = 3
    teeth: Annotated[int, setting("values of each: their distance is that of the next comb's width", ge=3)] = 25
    alike: Annotated[
        float, setting("log-likelihood within which another quantum does as well: that of a 95 % interval")
    ] = 1.92
    alike_from: Annotated[float, share("of a quantum, the nearest other that is tried")] = 1e-6
    alike_to: Annotated[float, share("of a quantum, the farthest")] = 0.03
    alike_tried: Annotated[int, setting("others that are tried on either side", ge=2)] = 30
    finer: Annotated[float, share("width of a comb over that of the one before")] = 0.1
    shifted: Annotated[
        float, setting("standard errors by which finer steps shift a value, from which it is fitted with them")
    ] = 0.3
    halvings: Annotated[int, setting("times that steps are halved for that", ge=0)] = 2


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
    halved: Annotated[
        float,
        share("of the port noise without an effect, below which it must be beside it: else it is a stand-in"),
    ] = 0.5
    driven: Annotated[
        float, setting("standard deviations of chance from which what is left follows from the drive: no disturbance")
    ] = 5.5
    driven_lags: Annotated[int, setting("samples of the inputs that it may follow from", ge=1)] = 24
    solver: Annotated[float, share("port noise, of the drive, up to which what is left is a matter of the solver")] = (
        1e-5
    )
    stretches: Annotated[
        int,
        setting("parts of a position's range, or of time, in each of which what is left may act in its own way", ge=2),
    ] = 12
    waves: Annotated[int, setting("periods of a position, in each of which it may come back", ge=1)] = 30
    lawful: Annotated[
        float,
        setting(
            "log of how much likelier what is left must be with a law than as noise, beyond what its copies reach: "
            "odds of a hundred to one"
        ),
    ] = 4.6
    copies: Annotated[int, setting("copies of what is left, of random phases, that show what chance gives", ge=19)] = 39
    by_chance: Annotated[float, share("of them that may do as well: noise is never just as it is taken to be")] = 0.05
    stands_out: Annotated[float, setting("times the expected power from which a stretch of time is pointed at")] = 1.3
    shown: Annotated[
        float,
        share(
            "of the squared misfit on data not fitted that effects must remove to be named although more than noise "
            "is left"
        ),
    ] = 0.9
    follows: Annotated[float, share("of an output's variance there that the model must then explain")] = 0.9
    least_shown: Annotated[
        float,
        share(
            "of that misfit which any effects must remove, where they leave more than noise: less, and it is their like"
        ),
    ] = 0.65
    implausible: Annotated[
        float, setting("stated uncertainties from which a re-fitted value speaks against them", gt=0)
    ] = 3.0
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


class PlaceSettings(Settings, frozen=True):
    """Which effects a place offers, and what tells kin apart."""

    starts_off: Annotated[float, share("of its rms by which an input starts away from zero to be tried from both")] = (
        1e-3
    )
    one_way: Annotated[
        float, share("of a port's travel that it may go back, and still turns one way: friction is a load then")
    ] = 0.01
    half_a_row: Annotated[float, share("by which a delay may miss half a row, and may be a matter of the hold")] = 0.05
    as_wide: Annotated[float, setting("standard errors within which a dead zone is as wide as an offset")] = 3.0
    least_phase: Annotated[float, setting("radians of a ripple within the motion, from which it is no spring")] = 4.0
    most_cycles: Annotated[int, setting("wavenumbers that are looked through", ge=1)] = 500
    once: Annotated[float, share("of a turn by which a ripple must differ from gravity, which comes once a turn")] = (
        0.03
    )
    long: Annotated[float, share("of the motion over which hysteresis builds up at least: below, it is friction")] = (
        0.04
    )


class PortNoiseSettings(Settings, frozen=True):
    """Noise at the ports, and the surrogate that whitens."""

    shares: Annotated[tuple[float, ...], note("levels of port noise over the drive, from none upwards")] = (
        0.0, 1e-5, 1e-4, 3e-4, 1e-3, 1.8e-3, 3e-3, 5.5e-3, 1e-2, 1.4e-2, 2e-2, 2.8e-2, 4e-2, 0.1, 0.3, 1.0
    )  # fmt: skip
    colours: Annotated[tuple[float, ...], note("correlations of it from sample to sample that are tried")] = (
        0.0,
        0.7,
        0.9,
    )
    most_order: Annotated[
        int, setting("states of the surrogate at most: what is measured determines no more", ge=1)
    ] = 6
    least_singular: Annotated[float, share("of the largest singular value from which a state is kept")] = 1e-4
    grows: Annotated[
        float, share("by which a mode may grow over the responses: rounding, and nothing is made of it")
    ] = 0.01
    blocks: Annotated[int, setting("rows and columns of blocks of the Hankel matrix, about", ge=4)] = 40
    reach: Annotated[int, setting("samples over which efforts may have led to the start of the record", ge=1)] = 400


class GuideSettings(Settings, frozen=True):
    """How a guided run is led along the record."""

    speed: Annotated[float, share("of a radian a sample: how fast a guided run follows")] = 0.2
    caught: Annotated[
        float, setting("time constants after which it has caught up with the record: no row before is fitted", ge=0)
    ] = 5.0
    slower: Annotated[float, setting("how many times slower it is led where that does not hold", gt=1.0)] = 3.0
    massive: Annotated[
        float, setting("times its first sample that the second of an answer must be, of a mass: a store has 1")
    ] = 1.5


class ProcessSettings(Settings, frozen=True):
    """How long the FMU's process is waited for, and what it may take."""

    loading: Annotated[float, setting("seconds that loading may take: some FMUs unpack a whole tool", gt=0.0)] = 60.0
    patience: Annotated[float, setting("seconds that the first runs may take beyond loading")] = 20.0
    known: Annotated[
        float,
        setting("the same of any batch, beyond what is expected, once runs were timed; over one more than were lost"),
    ] = 5.0
    again: Annotated[
        float, setting("times as long as the first answer of the first process that of another may take more", ge=0)
    ] = 2.0
    slower: Annotated[float, setting("how many times as long as expected a batch may take", ge=1)] = 20.0
    most_lost: Annotated[
        int, setting("processes that an FMU may cost: one effect that it cannot stand costs a few", ge=0)
    ] = 25
    chunk: Annotated[int, setting("runs that are sent to a process at a time", ge=1)] = 3
    small: Annotated[float, setting("seconds of work below which a second process is not asked")] = 0.01
    total: Annotated[float, setting("seconds that a process may live", gt=0.0)] = 86_400.0
    memory: Annotated[int, setting("MiB that a process may use", ge=1)] = 4096
    absurd: Annotated[float, setting("times an output's largest value, beyond which a run has failed", gt=1)] = 1e9
    runaway: Annotated[
        float, setting("effort of an effect over the drive's, beyond which a run is given up: it is unstable", gt=1)
    ] = 1e4


class ReadSettings(Settings, frozen=True):
    """What a record must be."""

    least_rows: Annotated[int, setting("rows that a record must have: half of them are fitted", ge=8)] = 100
    uneven: Annotated[float, share("of a sample by which a time may be off")] = 0.01
    lost: Annotated[float, share("of a sample by which a step of time shows that a row is lost or there twice")] = 0.5
    whole: Annotated[float, share("of a sample by which it may miss whole ones then: else the stamps jitter")] = 0.1


class BoxRateSettings(Settings, frozen=True):
    """The rate at which a long record is analysed."""

    rows: Annotated[int, setting("rows of a record that are looked at in any case", ge=200)] = 4000
    per_band: Annotated[float, setting("rate over the frequency below which nearly all motion lies", gt=2)] = 16.0
    shows: Annotated[float, setting("power over that of the noise from which motion shows", ge=1)] = 4.0
    most_above: Annotated[float, share("of the squared speed that may lie above the band")] = 0.01
    pane: Annotated[int, setting("samples of a spectrum's pane at most", ge=64)] = 1024
    rounding: Annotated[float, share("of a rate that time stamps may be off by")] = 0.02


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
    probe: Annotated[ProbeSettings, note("the probes of the FMU")] = ProbeSettings()
    place: Annotated[PlaceSettings, note("the effects that places offer")] = PlaceSettings()
    noise: Annotated[PortNoiseSettings, note("noise at the ports")] = PortNoiseSettings()
    guide: Annotated[GuideSettings, note("guided runs")] = GuideSettings()
    process: Annotated[ProcessSettings, note("the FMU's processes")] = ProcessSettings()
    read: Annotated[ReadSettings, note("the record")] = ReadSettings()
    rate: Annotated[BoxRateSettings, note("the rate at which it is analysed")] = BoxRateSettings()
    calibration: Annotated[CalibrationSettings, note("parameters alone")] = CalibrationSettings()


DEFAULT = BoxSettings()
