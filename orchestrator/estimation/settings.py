"""Every threshold of an estimate, in groups, each with one line of why.

``estimate(..., settings=...)`` takes others, or the path of a TOML file of them; the result carries those used.
Objectives are twice a negative log-likelihood; torque noise is white, in N.m.s^0.5.
"""

from typing import Annotated

from orchestrator.shared.settings import Settings, setting, share


class MaximisationSettings(Settings, frozen=True):
    """The maximisation of the likelihood: which fits are started, and when they end."""

    allowed_rise: Annotated[
        float, setting("rise of the objective for which less torque noise is preferred: 5 % limit at a bound of zero")
    ] = 2.7
    steps_per_level: Annotated[int, setting("scoring steps at one level of torque noise", ge=1)] = 10
    about_as_good: Annotated[
        float, setting("objective within which a smaller size is tried too: much noise hides that others are too large")
    ] = 15.0
    different: Annotated[float, setting("ratio from which two sizes are fitted apart", ge=1)] = 1.5
    flat_information: Annotated[
        float, setting("information on a log noise level below which the record cannot tell it from none")
    ] = 0.3
    calm_torque_noise: Annotated[
        float, setting("torque noise at the load to which a fit of one encoder must get down", gt=0)
    ] = 0.011
    clear_impulse: Annotated[
        float, setting("standard errors from which the machine's contact law is another than the model's")
    ] = 3.0
    settled: Annotated[
        float,
        setting("difference of the objective from which one reading of a torque with rows of its own is right"),
    ] = 10.0
    long_record: Annotated[int, setting("rows above which a record is first fitted to its beginning", ge=200)] = 9000
    short_record: Annotated[int, setting("rows of that beginning", ge=200)] = 6000
    enough_traversals: Annotated[int, setting("traversals that the beginning must hold to start from it", ge=0)] = 6


class GapVerdictSettings(Settings, frozen=True):
    """Whether a gap is seen, and whether the model explains the record."""

    notable_torque_noise: Annotated[
        float, setting("torque noise over the drive's torque [s^0.5] that a right model never reaches")
    ] = 1e-3
    notable_autocorrelation: Annotated[
        float, share("autocorrelation of one-step errors that such a model never reaches")
    ] = 0.15
    chance_autocorrelation: Annotated[
        float, setting("or this many standard errors of it, where that is more: chance in a short record")
    ] = 4.0
    least_travel_motor: Annotated[
        float, setting("travel of the motor in standard deviations of its encoder's noise, below which nothing is seen")
    ] = 100.0
    least_travel_load: Annotated[float, setting("the same of the load, which moves by the gear ratio less")] = 30.0
    open_friction: Annotated[
        float, share("share of the half-gap's variance that is friction's, from which a crawl would tell them apart")
    ] = 0.5
    worth_a_record: Annotated[
        float, share("half of the interval over the half-gap, from which that is worth another record")
    ] = 0.01
    misfit_widening: Annotated[
        float, setting("factor on the interval where the model is not exact: what it lacks is not white", ge=1)
    ] = 1.3
    blocks: Annotated[
        int,
        setting(
            "blocks of the record whose scatter the interval allows for, where it is more than that of noise", ge=5
        ),
    ] = 20


class FlankSettings(Settings, frozen=True):
    """The gap from two angles alone: a hidden state for the flank."""

    late_deviation: Annotated[
        float, setting("standard deviation of the lateness of one channel before anything is known [s]", gt=0)
    ] = 0.02
    latest: Annotated[float, setting("lateness that is looked for at most [s]", gt=0)] = 0.1
    late_step: Annotated[
        float, setting("change of the lateness from which the motor's angle is taken anew [s]", gt=0)
    ] = 2e-5
    most_points: Annotated[int, setting("points that are used; of more, evenly so many", ge=200)] = 10000
    separate: Annotated[
        float, setting("half-gap in standard deviations of the noise from which on two flanks are told apart")
    ] = 2.5
    least_counts: Annotated[
        float, setting("half-gap in counts of the coarser encoder from which on it is not rounding to two values", ge=0)
    ] = 0.5
    least_touching: Annotated[
        float, share("points at which teeth touch; with fewer, the flanks are the rims of a single cloud")
    ] = 0.3
    shape: Annotated[
        float, share("of the noise, by which bounces and rounding shift the middle of a flank: standard deviation")
    ] = 0.065
    speed_window: Annotated[float, setting("half of the time over which the motor's speed is taken [s]", gt=0)] = 2e-3
    turns_for_eccentricity: Annotated[float, setting("turns of a shaft from which its eccentricity is fitted")] = 1.0
    least_noise: Annotated[float, share("noise of an edge between counts, in counts, below which none is fitted")] = (
        0.05
    )
    prior_steps: Annotated[float, setting("steps between states that each has beforehand", gt=0)] = 1.0
    rounds: Annotated[int, setting("rounds of expectation and maximisation at most", ge=1)] = 60
    first_rounds: Annotated[int, setting("rounds that each start has", ge=1)] = 10
    tolerance: Annotated[float, setting("change of the log likelihood at which it rests", gt=0)] = 1e-3
    blocks: Annotated[int, setting("blocks of the record, each left out once for the standard error", ge=5)] = 20
    block_rounds: Annotated[int, setting("rounds that a record without a block has", ge=1)] = 8


class StageSettings(Settings, frozen=True):
    """In which stage of a train the gap is."""

    decisive: Annotated[
        float, setting("log-likelihood by which an answer must fall behind the best to be excluded", gt=0)
    ] = 8.0
    shared: Annotated[float, share("least share of the gap that each stage has where both have one", le=0.5)] = 0.2
    negligible: Annotated[
        float, share("share of the gap below which a stage has none: contacts differ from the model's", le=0.5)
    ] = 0.03
    unexplained: Annotated[
        float, setting("torque noise over the drive's torque [s^0.5] from which the fits say nothing", gt=0)
    ] = 8e-3
    hopeless: Annotated[
        float, setting("log-likelihood behind that of one gap, from which a fit of both is not begun anew", gt=0)
    ] = 40.0
    starts: Annotated[int, setting("further starts of a fit of both that is no optimum", ge=0)] = 4
    restless: Annotated[
        float, setting("variance of the share among blocks over that of noise, from which a fit is no optimum", ge=1)
    ] = 4.0
    misfit_widening: Annotated[
        float, setting("factor on the intervals of a gap in one stage: what the model lacks is not white", ge=1)
    ] = 1.2
    most_scatter: Annotated[
        float,
        setting("variance among blocks over that of noise that widens at most: more is a contact that comes"),
    ] = 25.0
    widening_of_both: Annotated[
        float, setting("factor on those of gaps in both: beside the best share there are others about as good", ge=1)
    ] = 1.8


class TrustSettings(Settings, frozen=True):
    """Where green ends."""

    beyond: Annotated[float, setting("standard errors by which a value may lie outside its stated range")] = 2.0
    far_beyond: Annotated[float, setting("times its stated range at which a fitted value cannot be right", ge=1)] = 2.0
    least_traversals: Annotated[int, setting("traversals below which one odd contact decides the size", ge=0)] = 3
    widest: Annotated[float, setting("standard error over half-gap above which the size is a guess", gt=0)] = 0.2


class EstimationSettings(Settings, frozen=True):
    """All thresholds of an estimate."""

    fit: MaximisationSettings = MaximisationSettings()
    verdict: GapVerdictSettings = GapVerdictSettings()
    flanks: FlankSettings = FlankSettings()
    stages: StageSettings = StageSettings()
    trust: TrustSettings = TrustSettings()


DEFAULT_SETTINGS = EstimationSettings()
