"""Every threshold of a diagnosis, in groups, each with one line of why.

``diagnose(..., settings=...)`` takes others, or the path of a TOML file of them; the result carries those used.
"""

from typing import Annotated

from orchestrator.shared.settings import Settings, setting, share


class BandSettings(Settings, frozen=True):
    """The rate and the band at which a record is analysed."""

    speed_share: Annotated[float, share("of the squared speed that lies below the frequency of the motion")] = 0.98
    band_factor: Annotated[
        float, setting("times that frequency: the band holds harmonics of friction and gaps", ge=1)
    ] = 6.0
    signal_to_noise: Annotated[
        float, setting("power of the motion over the encoder's noise down to which it goes", ge=1)
    ] = 10.0
    torque_excess: Annotated[
        float, setting("power that an inertia may ask for over what is there: more is noise", ge=1)
    ] = 4.0
    samples_per_period: Annotated[float, setting("of the highest frequency: averages lose nothing there", ge=3)] = 20.0
    most_rows: Annotated[int, setting("rows of the analysis: more say nothing and cost time", ge=500)] = 12000


class BalanceSettings(Settings, frozen=True):
    """The torque balances of our plants."""

    at_rest: Annotated[
        float, share("of the rms speed below which a body is at rest, where friction takes any torque")
    ] = 0.03
    fade: Annotated[float, share("of the rows over which a record fades in and out: long filters must see no step")] = (
        0.03
    )
    torque_floor: Annotated[float, share("of the torque's power that no law is better than (0.01 % of the torque)")] = (
        1e-8
    )


class FitSettings(Settings, frozen=True):
    """Whitening, fits and blocks."""

    blocks: Annotated[
        int, setting("of the record, each left out in turn; fewer say too little of their mean", ge=4)
    ] = 20
    rows_per_block: Annotated[int, setting("independent rows that a block has at least", ge=2)] = 12
    edge: Annotated[float, setting("of the record that is left out at either end, in periods of the cutoff", ge=0)] = (
        0.6
    )
    iterations: Annotated[
        int, setting("of a fit at most: Gauss and Newton's steps converge at once or not at all", ge=1)
    ] = 4
    most_overdispersion: Annotated[float, setting("by which blocks may widen the variance of errors", ge=1)] = 300.0


class SelectionSettings(Settings, frozen=True):
    """The search for effects by one score: the log posterior of a subset, by the errors of blocks left out."""

    least_gain: Annotated[float, share("of the squared error that an effect must take: no model is known better")] = (
        0.01
    )
    effect_probability: Annotated[
        float, share("of an effect before the record is seen: of two subsets that do about as well, the smaller one")
    ] = 0.001
    most_effects: Annotated[int, setting("of a model", ge=0)] = 6
    prior_deviations: Annotated[
        float, setting("of the model file that an effect may push a parameter to: beyond it is another machine")
    ] = 2.5


class GradeSettings(Settings, frozen=True):
    """What makes a name certain, likely or possible."""

    certain_t: Annotated[float, setting("paired errors of a certain effect")] = 5.0
    likely_t: Annotated[float, setting("paired errors of a likely one, and its sizes over theirs")] = 3.0
    certain_share: Annotated[
        float,
        share(
            "of the missing torque that a certain effect or a likely wave explains; most that a curve still takes of it"
        ),
    ] = 0.08
    likely_share: Annotated[float, share("of the missing torque that a likely one explains")] = 0.03
    likely_gain: Annotated[
        float,
        share("or of what is left without it; a learned law takes as much, and what follows others of the torque"),
    ] = 0.2
    certain_size_t: Annotated[float, setting("sizes over their errors of a certain effect")] = 4.0
    most_gain: Annotated[
        float,
        share(
            "of what is left without it: likely_gain of what follows others, and enough for certainty of what does not"
        ),
    ] = 0.5
    sure_size_t: Annotated[float, setting("sizes over their errors that count as much as likely_t")] = 6.0
    most_left: Annotated[
        float, share("of the torque's power that may be left beside a name; for a limit of its torque where it acts")
    ] = 0.2
    confirmed_share: Annotated[
        float, share("of the misfit on test data that goes with a certain effect, or may come: 5 % in rms are chance")
    ] = 0.1
    test_t: Annotated[
        float, setting("paired errors by which the torque of test data speaks for an effect or against it: asked once")
    ] = 2.0
    inertia_error: Annotated[
        float, share("relative error of the inertia that the record must reach for a certain name")
    ] = 0.35


class ReportSettings(Settings, frozen=True):
    """What is reported: free runs over the test part, what is left, laws learned from it."""

    runs: Annotated[int, setting("free runs that the test part is divided into", ge=1)] = 2
    longest_run: Annotated[
        float, share("of the record that a free run covers: of longer ones impacts leave no best start", le=1.0)
    ] = 0.075
    least_rows: Annotated[int, setting("rows of a free run at least", ge=10)] = 40
    worse: Annotated[float, share("by which chance may make the misfit of test data larger")] = 0.05
    of_noise: Annotated[float, share("and share of the encoder's noise")] = 0.1
    level: Annotated[float, share("of reported intervals")] = 0.95


class FmuSettings(Settings, frozen=True):
    """Any FMU beside a record: its processes, the rate of the analysis, pulse responses."""

    loading: Annotated[float, setting("seconds that loading may take: some FMUs unpack a whole tool", gt=0.0)] = 60.0
    patience: Annotated[float, setting("seconds that the first runs may take beyond loading")] = 20.0
    most_lost: Annotated[
        int, setting("processes that an FMU may cost: one effect that it cannot stand costs a few", ge=0)
    ] = 25
    process_memory: Annotated[int, setting("MiB that a process may use", ge=1)] = 4096
    repeats: Annotated[float, share("of the noise by which two runs of one model may differ")] = 1e-3
    uneven: Annotated[float, share("of a sample by which a time may be off")] = 0.01
    rows: Annotated[int, setting("rows of a record that are looked at in any case", ge=200)] = 4000
    per_band: Annotated[float, setting("rate over the frequency below which nearly all motion lies", gt=2)] = 16.0
    most_above: Annotated[float, share("of the squared speed that may lie above the band")] = 0.01
    pulses: Annotated[int, setting("rows of the record at which a pulse is given: an FMU need not be linear", ge=1)] = 6
    noise_memory: Annotated[
        float, share("of the record after which noise at a port is forgotten: integrators have no spectrum")
    ] = 0.2
    linear: Annotated[float, share("by which responses along the record may differ, to tell what effects change")] = 0.1
    start_spread: Annotated[float, setting("how far the start may be off, in noise deviations of the outputs")] = 10.0


class DiagnosisSettings(Settings, frozen=True):
    """All settings of a diagnosis."""

    test_share: Annotated[float, share("last part of the record that only the report sees", le=0.5)] = 0.15
    band: BandSettings = BandSettings()
    balance: BalanceSettings = BalanceSettings()
    fit: FitSettings = FitSettings()
    selection: SelectionSettings = SelectionSettings()
    grades: GradeSettings = GradeSettings()
    report: ReportSettings = ReportSettings()
    fmu: FmuSettings = FmuSettings()
