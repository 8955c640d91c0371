"""Every threshold of an estimate, in groups, each with one line of why.

``estimate(..., settings=...)`` takes others, or the path of a TOML file of them; the result carries those used.
Objectives are twice a negative log-likelihood; torque noise is white, in N.m.s^0.5.
"""

from typing import Annotated

from orchestrator.shared.settings import Settings, setting, share


class MaximisationSettings(Settings, frozen=True):
    """The maximisation of the likelihood: which fits are started, and when they end."""

    allowed_rise: Annotated[
        float, setting("rise of the objective up to which less torque noise is preferred: 5 % limit at a bound")
    ] = 2.7
    steps_per_level: Annotated[int, setting("scoring steps at each level of torque noise", ge=1)] = 10
    about_as_good: Annotated[
        float, setting("difference of the objective up to which a smaller half-gap is tried too")
    ] = 15.0
    different: Annotated[float, setting("ratio of two half-gaps above which both are fitted", ge=1)] = 1.5
    flat_information: Annotated[
        float, setting("information on the log of a noise level below which it is taken as zero")
    ] = 0.3
    calm_torque_noise: Annotated[
        float, setting("largest relative torque noise at the load of a correct fit of one encoder", gt=0)
    ] = 0.011
    settled: Annotated[
        float,
        setting("difference of the objective that decides between two readings of a torque"),
    ] = 10.0
    long_record: Annotated[int, setting("rows above which the first part of a record is fitted first", ge=200)] = 9000
    short_record: Annotated[int, setting("rows of that first part", ge=200)] = 6000
    enough_traversals: Annotated[
        int, setting("fewest traversals in the first part for its fit to be used as a start", ge=0)
    ] = 6
    worse_at_length: Annotated[
        float, setting("deviance of a row above that of the first part from which the fit of all rows is done again")
    ] = 0.2


class GapVerdictSettings(Settings, frozen=True):
    """Whether a gap is seen, and whether the model explains the record."""

    notable_torque_noise: Annotated[
        float, setting("torque noise over the drive's torque [s^0.5] above which the model is incomplete")
    ] = 1e-3
    notable_autocorrelation: Annotated[
        float, share("autocorrelation of one-step errors above which the model is incomplete")
    ] = 0.15
    chance_autocorrelation: Annotated[float, setting("the same in standard errors; the larger limit applies")] = 4.0
    least_travel_motor: Annotated[
        float, setting("travel of the motor over its encoder's noise below which the gap cannot be seen")
    ] = 100.0
    least_travel_load: Annotated[float, setting("the same for the load, which moves less by the gear ratio")] = 30.0
    open_friction: Annotated[
        float, share("share of the half-gap's variance due to friction above which a crawl is advised")
    ] = 0.5
    worth_a_record: Annotated[float, share("half the interval over the half-gap above which this advice is given")] = (
        0.01
    )
    misfit_widening: Annotated[
        float, setting("factor on the interval of an inexact model, whose errors are not white", ge=1)
    ] = 1.3
    blocks: Annotated[
        int,
        setting("blocks of the record; if they scatter more than noise, the interval is widened", ge=5),
    ] = 20


class FlankSettings(Settings, frozen=True):
    """The gap from two angles alone: a hidden state for the flank."""

    late_deviation: Annotated[
        float, setting("prior standard deviation of the delay between the channels [s]", gt=0)
    ] = 0.02
    latest: Annotated[float, setting("largest delay between the channels [s]", gt=0)] = 0.1
    late_step: Annotated[
        float, setting("change of the delay above which the motor's angle is interpolated again [s]", gt=0)
    ] = 2e-5
    most_points: Annotated[int, setting("most points that are used, evenly spaced", ge=200)] = 10000
    separate: Annotated[float, setting("half-gap over the noise above which two flanks are distinguishable")] = 2.5
    least_counts: Annotated[
        float, setting("half-gap in counts of the coarser encoder above which it is not a rounding error", ge=0)
    ] = 0.5
    least_touching: Annotated[float, share("smallest share of points on a flank for two flanks")] = 0.3
    shape: Annotated[float, share("shift of a flank by bounces and rounding, over the noise")] = 0.065
    speed_window: Annotated[float, setting("half the time over which the motor's speed is computed [s]", gt=0)] = 2e-3
    turns_for_eccentricity: Annotated[float, setting("turns of a shaft above which its eccentricity is fitted")] = 1.0
    least_noise: Annotated[float, share("smallest noise of an edge between two counts that is fitted [counts]")] = 0.05
    prior_steps: Annotated[float, setting("prior number of transitions of each state", gt=0)] = 1.0
    rounds: Annotated[int, setting("most iterations of expectation and maximisation", ge=1)] = 60
    first_rounds: Annotated[int, setting("iterations of each start", ge=1)] = 10
    tolerance: Annotated[
        float, setting("change of the log-likelihood below which the iteration has converged", gt=0)
    ] = 1e-3
    blocks: Annotated[int, setting("blocks of the record, left out in turn for the standard error", ge=5)] = 20
    block_rounds: Annotated[int, setting("iterations of a fit without one block", ge=1)] = 8


class StageSettings(Settings, frozen=True):
    """In which stage of a train the gap is."""

    decisive: Annotated[
        float, setting("difference of the log-likelihood from the best fit above which an answer is excluded", gt=0)
    ] = 8.0
    shared: Annotated[float, share("smallest share of the gap in each stage for the answer *both*", le=0.5)] = 0.2
    negligible: Annotated[float, share("share of the gap below which a stage counts as free of a gap", le=0.5)] = 0.03
    unexplained: Annotated[
        float, setting("torque noise over the drive's [s^0.5] above which no stage is named", gt=0)
    ] = 8e-3
    hopeless: Annotated[float, setting("difference of the log-likelihood above which a fit is not restarted", gt=0)] = (
        40.0
    )
    starts: Annotated[int, setting("further starts of a fit of both gaps that is not an optimum", ge=0)] = 4
    restless: Annotated[
        float, setting("variance of the share among blocks over that of noise above which a fit is no optimum", ge=1)
    ] = 4.0
    misfit_widening: Annotated[
        float, setting("factor on the intervals of a gap in one stage: the model's errors are not white", ge=1)
    ] = 1.2
    most_scatter: Annotated[
        float,
        setting("largest variance among blocks over that of noise that widens the interval"),
    ] = 25.0
    widening_of_both: Annotated[
        float, setting("factor on the intervals of gaps in both stages: other shares fit almost as well", ge=1)
    ] = 1.8


class TrustSettings(Settings, frozen=True):
    """Where green ends."""

    beyond: Annotated[float, setting("standard errors by which a value may exceed its stated range")] = 2.0
    far_beyond: Annotated[float, setting("deviation in stated uncertainties above which a value is red", ge=1)] = 2.0
    least_traversals: Annotated[int, setting("fewest traversals for green: with fewer, one contact decides", ge=0)] = 3
    widest: Annotated[float, setting("largest standard error over half-gap for green", gt=0)] = 0.2


class EstimationSettings(Settings, frozen=True):
    """All thresholds of an estimate."""

    fit: MaximisationSettings = MaximisationSettings()
    verdict: GapVerdictSettings = GapVerdictSettings()
    flanks: FlankSettings = FlankSettings()
    stages: StageSettings = StageSettings()
    trust: TrustSettings = TrustSettings()


DEFAULT_SETTINGS = EstimationSettings()
