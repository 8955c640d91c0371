"""Every threshold of a diagnosis, in groups, each with one line of why.

``diagnose(..., settings=...)`` takes others, or the path of a TOML file of them; the result carries those used.
"""

from typing import Annotated

from orchestrator.shared.settings import Settings, setting, share


class BandSettings(Settings, frozen=True):
    """The rate and the band at which a record is analysed."""

    speed_share: Annotated[float, share("share of the squared speed that lies below the frequency of the motion")] = (
        0.98
    )
    band_factor: Annotated[
        float, setting("end of the band over that frequency: it includes harmonics of friction and gaps", ge=1)
    ] = 6.0
    signal_to_noise: Annotated[float, setting("ratio of power to encoder noise at which the band ends", ge=1)] = 10.0
    torque_excess: Annotated[
        float, setting("power that the inertia needs over the measured power at which the band ends", ge=1)
    ] = 4.0
    samples_per_period: Annotated[float, setting("rows per period of the highest frequency", ge=3)] = 20.0
    most_rows: Annotated[int, setting("most rows of the analysis: more add time only", ge=500)] = 12000


class BalanceSettings(Settings, frozen=True):
    """The torque balances of our plants."""

    at_rest: Annotated[float, share("speed over the rms speed below which a body is at rest")] = 0.03
    fade: Annotated[float, share("share of the rows over which a record fades in and out")] = 0.03
    torque_floor: Annotated[float, share("share of the torque's power that every model leaves (0.01 % in rms)")] = 1e-8


class FitSettings(Settings, frozen=True):
    """Whitening, fits and blocks."""

    blocks: Annotated[int, setting("blocks of the record, left out in turn: fewer give no reliable error", ge=4)] = 20
    rows_per_block: Annotated[int, setting("fewest independent rows of a block", ge=2)] = 12
    edge: Annotated[float, setting("periods of the cutoff that are left out at both ends of a record", ge=0)] = 0.6
    iterations: Annotated[
        int, setting("most iterations of a fit: Gauss-Newton steps converge quickly or not at all", ge=1)
    ] = 4


class SelectionSettings(Settings, frozen=True):
    """The search for effects by one score: the log posterior of a subset, by the errors of blocks left out."""

    least_gain: Annotated[float, share("share of the squared error that an effect must remove")] = 0.01
    effect_probability: Annotated[float, share("prior probability of an effect: a larger subset must fit better")] = (
        0.001
    )
    most_effects: Annotated[int, setting("most effects of a model", ge=0)] = 6
    prior_deviations: Annotated[
        float, setting("largest change of a parameter by an effect, in uncertainties of the model file")
    ] = 2.5


class GradeSettings(Settings, frozen=True):
    """What makes a name certain, likely or possible."""

    certain_t: Annotated[float, setting("paired gain over its error for *certain*")] = 5.0
    likely_t: Annotated[float, setting("paired gain over its error, and size over its error, for *likely*")] = 3.0
    certain_share: Annotated[
        float,
        share("share of the missing torque for *certain* (a wave: *likely*); limit of what a curve still explains"),
    ] = 0.08
    likely_share: Annotated[float, share("share of the missing torque that an effect explains for *likely*")] = 0.03
    likely_gain: Annotated[
        float,
        share("or share of the torque left without it; also for learned laws and laws that follow a signal"),
    ] = 0.2
    certain_size_t: Annotated[float, setting("size over its error for *certain*")] = 4.0
    most_gain: Annotated[
        float,
        share("`likely_gain` of laws that follow a signal; enough for *certain* of all others"),
    ] = 0.5
    sure_size_t: Annotated[float, setting("size over its error that replaces `likely_t`")] = 6.0
    most_left: Annotated[
        float, share("share of the torque's power that may remain unexplained; for a limit, where it acts")
    ] = 0.2
    confirmed_share: Annotated[
        float, share("change of the misfit on test data that confirms or refutes an effect: 5 % in rms are chance")
    ] = 0.1
    test_t: Annotated[float, setting("paired gain over its error on test data that confirms or refutes an effect")] = (
        2.0
    )
    most_missed: Annotated[
        float,
        setting("misfit of free runs, over what noise and the values' errors account for, from which a law is missing"),
    ] = 10.0
    inertia_error: Annotated[float, share("largest relative error of the record's inertia for *certain*")] = 0.35


class ReportSettings(Settings, frozen=True):
    """What is reported: free runs over the test part, what is left, laws learned from it."""

    longest_run: Annotated[
        float, share("length of a free run over the record: impacts hide the initial state of longer runs", le=1.0)
    ] = 0.075
    least_rows: Annotated[int, setting("fewest rows of a free run", ge=10)] = 40
    of_noise: Annotated[
        float, share("increase of the misfit on test data over the encoder's noise that may be chance")
    ] = 0.1
    level: Annotated[float, share("probability of the reported intervals")] = 0.95
    possible_share: Annotated[
        float, share("probability of an effect that is only possible: the share that was right of 170 such names")
    ] = 0.2


class FmuSettings(Settings, frozen=True):
    """Any FMU beside a record: its processes, the rate of the analysis, pulse responses."""

    loading: Annotated[float, setting("longest loading [s]: some FMUs unpack a tool", gt=0.0)] = 60.0
    patience: Annotated[float, setting("longest duration of the first runs, without loading [s]")] = 20.0
    most_lost: Annotated[int, setting("most processes that an FMU may crash or block", ge=0)] = 25
    process_memory: Annotated[int, setting("memory limit of a process [MiB]", ge=1)] = 4096
    repeats: Annotated[float, share("largest difference of two runs of one model, relative to the noise")] = 1e-3
    uneven: Annotated[float, share("largest error of a time stamp, relative to the sample time")] = 0.01
    rows: Annotated[int, setting("rows that decimation keeps at least", ge=200)] = 4000
    per_band: Annotated[float, setting("sample rate over the highest frequency of the motion", gt=2)] = 16.0
    most_above: Annotated[float, share("share of the squared speed above that frequency")] = 0.01
    pulses: Annotated[int, setting("rows at which pulse responses are computed: an FMU may be nonlinear", ge=1)] = 6
    noise_memory: Annotated[float, share("decay time of noise at a port over the length of the record")] = 0.2
    linear: Annotated[float, share("largest relative difference of the pulse responses of a linear FMU")] = 0.1
    start_spread: Annotated[float, setting("uncertainty of the initial state, in deviations of the noise")] = 10.0


class DiagnosisSettings(Settings, frozen=True):
    """All settings of a diagnosis."""

    test_share: Annotated[float, share("share of the record, at its end, that only the report uses", le=0.5)] = 0.15
    band: BandSettings = BandSettings()
    balance: BalanceSettings = BalanceSettings()
    fit: FitSettings = FitSettings()
    selection: SelectionSettings = SelectionSettings()
    grades: GradeSettings = GradeSettings()
    report: ReportSettings = ReportSettings()
    fmu: FmuSettings = FmuSettings()
