"""Every threshold of a diagnosis, in groups, each with one line of why.

``diagnose(..., settings=...)`` takes others, or the path of a TOML file of them; the result carries those used.
Log-likelihoods are natural; times are in seconds unless said otherwise.
"""

from typing import Annotated

import numpy as np

from orchestrator.diagnosis.proof.settings import InverseSettings, LearnedSettings, ProofSettings
from orchestrator.shared.settings import Settings, note, setting, share


class AdmissionSettings(Settings, frozen=True):
    """What record and model must have before they are compared."""

    least_travel: Annotated[float, setting("travel in noise deviations; a long record of noise spans eight")] = 20.0
    most_substeps: Annotated[int, setting("integration steps in a sample; more: the model is far too fast", ge=1)] = 100


class LikelihoodSettings(Settings, frozen=True):
    """The one-step predictor, its gains, and the noise of the encoders."""

    head: Annotated[int, setting("samples at the start that only settle the state", ge=1)] = 10
    settled: Annotated[int, setting("samples after which states and innovations are shown and judged", ge=1)] = 20
    finer: Annotated[
        int, setting("times more steps in a sample in which dry friction may turn round, or teeth or stops meet", ge=1)
    ] = 8
    resonance_step: Annotated[
        float, setting("radians of an added resonance per step: above it, phase is lost", gt=0)
    ] = 0.5
    resonance_margin: Annotated[float, setting("added resonances ring above their nominal frequency by this", gt=0)] = (
        1.3
    )
    noise_window: Annotated[int, setting("samples of the sliding cubic whose residual is the noise", ge=6)] = 9
    unlimited: Annotated[float, setting("torque limits from here on [N.m] are none: clipping is skipped")] = 1e11
    start_angle: Annotated[float, setting("initial angle's standard deviation, in noise deviations", gt=0)] = 10.0
    speed_span: Annotated[float, setting("span over which the record's largest speed is taken [s]", gt=0)] = 0.05


class RateSettings(Settings, frozen=True):
    """The rate at which a record is analysed: from its content, not from how often it was sampled."""

    least_rate: Annotated[float, setting("analysis rate that is kept [Hz]: friction turns in 10 ms", gt=0)] = 100.0
    least_rows: Annotated[int, setting("rows that a record keeps in any case", ge=200)] = 500
    per_band: Annotated[float, setting("rate over the frequency below which nearly all motion lies", gt=2)] = 16.0
    per_mode: Annotated[float, setting("rate over the model's fastest oscillation", gt=2)] = 30.0
    many_rows: Annotated[int, setting("rows from which on span counts for more than a fine rate", ge=500)] = 6000
    long_per_band: Annotated[
        float, setting("rate of so long a record over that frequency: filtered lines last", gt=2)
    ] = 4.0
    long_per_mode: Annotated[float, setting("and over the model's fastest oscillation", gt=2)] = 10.0
    shows: Annotated[float, setting("power over that of the noise from which motion shows", ge=1)] = 4.0
    most_above: Annotated[float, share("share of the squared speed that may lie above the band")] = 0.01
    pane: Annotated[int, setting("samples of a spectrum's pane at most", ge=64)] = 1024
    most_interpolated: Annotated[int, setting("rows per measured row that are looked for", ge=2)] = 10
    on_line: Annotated[
        float, setting("of the rms of second differences: rows so close to a line were interpolated")
    ] = 1e-3
    least_bends: Annotated[int, setting("measured rows at least that lie on no line between others", ge=10)] = 50
    most_measured: Annotated[int, setting("rows fitted at the measured rate: short steps say less", ge=500)] = 9000
    rounding: Annotated[float, share("of a rate that time stamps may be off by")] = 0.02
    cut_off: Annotated[float, share("of half the lower rate at which the filter before it cuts off")] = 0.8
    all_but: Annotated[float, share("share of the bends that must lie at measured rows")] = 0.98


class FitSettings(Settings, frozen=True):
    """Damped least squares on whitened innovations, and the repeated fits behind the intervals."""

    fitted: Annotated[float, share("of the record that is fitted: the first half", le=0.9)] = 0.5
    looked_at: Annotated[float, share("of the record that is fitted or decides; the rest is held out", le=0.95)] = 0.75
    most_fitted: Annotated[
        int, setting("rows that are fitted at most; half as many decide, the rest is held out", ge=500)
    ] = 3000
    strides: Annotated[tuple[int, ...], note("levels of noise at once, in the order in which they are tried")] = (
        4,
        2,
        1,
    )
    passed_over: Annotated[int, setting("failures that the longest stride passes over on its way down", ge=0)] = 2
    difference: Annotated[
        float, setting("step of a derivative in a parameter's scale: small beside its curvature", gt=0)
    ] = 1e-3
    iterations: Annotated[int, setting("most steps of a fit: more have not changed a verdict", ge=1)] = 8
    patience: Annotated[int, setting("dampings tried before a fit counts as converged", ge=1)] = 6
    damping: Annotated[float, setting("first damping, and least one after a failed step", gt=0)] = 1e-4
    ridge: Annotated[
        float, setting("added to the normal equations' diagonal: keeps blind directions solvable", gt=0)
    ] = 1e-9
    astray: Annotated[
        float, share("by which a step's gain may miss what was foretold; else derivatives are taken anew")
    ] = 0.3
    enough: Annotated[float, setting("gain in log-likelihood below which a fit has converged")] = 0.05
    nearly: Annotated[float, setting("and below which it nearly has: enough to choose between levels of noise")] = 0.5
    disputed: Annotated[
        float, setting("standard errors by which sizes may differ as innovations count as coloured or white")
    ] = 2.0
    less_sure: Annotated[
        float, setting("times larger errors, blocks compared, from which coloured innovations mislead", ge=1)
    ] = 2.0
    blocks: Annotated[int, setting("blocks of the record whose disagreement widens intervals", ge=2)] = 4
    surely_absent: Annotated[
        float, setting("gain in log-likelihood of a block without an effect over half of it: it comes or goes", gt=0)
    ] = 8.0
    block_iterations: Annotated[int, setting("steps of a block's fit, which starts at the whole's", ge=1)] = 5


class ScanSettings(Settings, frozen=True):
    """The scan for torques that are periodic in the motor's position."""

    peaks: Annotated[int, setting("peaks that become starts: the true line is rarely below the third", ge=1)] = 5
    separation: Annotated[int, setting("grid points within which peaks are one: a line is three wide", ge=0)] = 3
    highest: Annotated[float, setting("cycles per revolution looked for: teeth and poles lie below", gt=0)] = 60.0
    highest_per_travel: Annotated[float, setting("or cycles over the whole travel, where that is more", gt=0)] = 300.0
    lowest_per_travel: Annotated[float, setting("cycles over the travel below which a line is a trend", gt=0)] = 0.7
    points: Annotated[float, setting("grid points per line width, which is one over the travel", gt=0)] = 3.0
    sampling: Annotated[float, setting("of the sampling's angular frequency, over pi, that a line may reach", gt=0)] = (
        2.4
    )
    most_points: Annotated[int, setting("grid points at most: bounds the time of the scan", ge=10)] = 3000
    response_points: Annotated[int, setting("frequencies at which the filter's response is tabulated", ge=2)] = 400
    least_turns: Annotated[float, setting("travel in revolutions below which there is nothing to scan", gt=0)] = 1e-6


class SearchSettings(Settings, frozen=True):
    """Which candidates are fitted, what an effect must gain, and how far process noise may go."""

    time_limit: Annotated[
        float, setting("time [s] it may use, then nothing is named: most take a tenth of it; 0: any", ge=0)
    ] = 600.0
    most_noise: Annotated[float, setting("largest process noise, as a share of the drive's torque", gt=0)] = 3.0
    least_noise: Annotated[float, setting("smallest: predictions are nearly free runs there", gt=0)] = 1e-5
    noise_levels: Annotated[int, setting("levels of process noise, spaced evenly in the logarithm", ge=2)] = 23
    first_level: Annotated[int, setting("level at which the model without effects starts: the middle", ge=0)] = 10
    twist_quantile: Annotated[float, share("of the twist's size that counts as its largest: sheds outliers")] = 0.995
    shortlist_white: Annotated[
        int, setting("and those fitted beside them that promise most when innovations count as white", ge=0)
    ] = 3
    nearly_pays: Annotated[float, setting("least gain of an effect with which long predictions get far better")] = 3.0
    least_fitted: Annotated[
        float, setting("and its gain per parameter where it is fitted: chance reaches it once in 100")
    ] = 3.5
    shown: Annotated[float, share("share of the squared long-run error that such an effect must remove")] = 0.5
    least_errors: Annotated[float, setting("standard errors between a named size and zero; parts agree within")] = 2.0
    one_way: Annotated[float, share("share of the travel that a machine may go back and still go one way")] = 1e-3
    most_friction: Annotated[float, setting("dry friction over the largest torque: with more nothing moves")] = 1.0
    most_torque: Annotated[float, setting("other torques over the largest that was asked for")] = 5.0
    least_limit: Annotated[float, share("of the largest torque: a drive that is limited to less delivers none")] = 0.02
    least_stop: Annotated[float, share("of the drive's largest torque that an end stop pushes back; softer: none")] = (
        0.1
    )
    most_delay: Annotated[float, setting("longest dead time [s]: beyond, the signals do not belong together")] = 0.25
    delay_share: Annotated[float, share("or of the record's length, where that is less")] = 0.1
    most_lag: Annotated[float, setting("slowest drive [s]: a slower one lets next to nothing of `u` through")] = 1.0
    least_damping: Annotated[
        float, share("least damping ratio of a resonance: steel that is welded rings with some thousandths")
    ] = 5e-4
    most_coefficient: Annotated[
        float, share("largest friction over the torque that is transmitted: with more no machine turns")
    ] = 0.9
    at_bound: Annotated[
        float, setting("times the fewest cycles that are looked for: a wave with fewer lies at its bound", ge=1)
    ] = 1.02
    shortlist: Annotated[int, setting("candidates fitted in full: the right one was among them so far", ge=1)] = 6
    worth: Annotated[float, share("least share of the best promise that a candidate must promise to be fitted")] = 0.03
    followed: Annotated[float, share("of the best gain, from which other levels are tried: winners had half")] = 0.2
    kept: Annotated[float, share("of a promise that a fit must keep, not to be tried from more noise too")] = 0.2
    above: Annotated[int, setting("levels of process noise from above which that is done", ge=1)] = 4
    least_promise: Annotated[float, setting("least promised gain for a fit: below, noise promises as much")] = 3.0
    penalty: Annotated[float, setting("log-likelihood that each further parameter must earn")] = 5.0
    pays: Annotated[float, setting("least gain of an effect where what is left is noise, of whatever colour")] = 10.0
    pays_above_noise: Annotated[float, setting("and where it is not, as what is left is then correlated")] = 22.0
    noise_alone: Annotated[float, setting("largest process noise at which what is left is measurement noise")] = 1e-4
    least_decided: Annotated[float, setting("least gain on the deciding part alone: it has not been fitted")] = 6.0
    least_decided_of_noise: Annotated[float, setting("and where noise is left: its odds are below exp(-gain)")] = 3.0
    least_decided_share: Annotated[float, share("of the gain on the fitted part, which is twice as long")] = 0.08
    first_hidden: Annotated[
        float, setting("process noise at which a gap without an encoder behind it starts: right models get there", gt=0)
    ] = 1e-3
    linearised: Annotated[int, setting("times that such a gap is fitted, gains taken along the fit before", ge=1)] = 2
    most_effects: Annotated[
        int, setting("laws named at most, of two end stops one: more have no room in a record", ge=0)
    ] = 4
    most_steps: Annotated[
        int, setting("forward steps at most: a step may end in a better fit, and no effect", ge=1)
    ] = 10
    most_in_a_repeat: Annotated[
        int, setting("effects in a search with exchanged parts: one part explains few", ge=0)
    ] = 2
    rescued: Annotated[float, setting("gain from which one that fails to decide is fitted to both parts")] = 60.0


class RemainderSettings(Settings, frozen=True):
    """Generic bases that may predict what the best model leaves."""

    harmonics: Annotated[int, setting("harmonics of an angle", ge=1)] = 3
    blocks: Annotated[int, setting("blocks whose scatter says how sure a gain is", ge=4)] = 12
    ridge: Annotated[float, setting("share of the mean diagonal added to the normal equations", gt=0)] = 1e-6
    hats: Annotated[int, setting("hat functions of a speed or twist", ge=2)] = 9
    hat_edge: Annotated[float, share("quantile of the outermost hats: outliers get none of their own", le=0.4)] = 0.002
    plays: Annotated[int, setting("play operators: a basis for anything that remembers", ge=1)] = 5
    play_reach: Annotated[float, share("quantile of the size that plays are measured by")] = 0.99
    least_play: Annotated[float, setting("narrowest play, as a share of that reach", gt=0)] = 0.05
    largest_play: Annotated[float, setting("widest play, as a share of that reach", gt=0)] = 0.9


class VerdictSettings(Settings, frozen=True):
    """When nothing is missing, when it is unknown, and which effects a record cannot tell apart."""

    least_explained: Annotated[
        float, share("of the missing log-likelihood; right models recover over 0.75, wrong under 0.2")
    ] = 0.4
    least_missing: Annotated[float, setting("missing log-likelihood per sample below which nothing is left")] = 0.05
    overrated: Annotated[
        float, setting("surplus per sample from which the noise was rated too large by half", gt=0)
    ] = 0.5
    grown: Annotated[float, setting("times larger innovations on later parts that tell of a change with time")] = 3.0
    structured: Annotated[
        float, setting("out-of-sample gain from which what is left is no noise (four standard errors)")
    ] = 8.0
    large_share: Annotated[float, share("or share of the energy that a basis predicts, out of sample")] = 0.2
    likely: Annotated[float, setting("with at least this gain: chance reaches it once in 70")] = 3.0
    heavy: Annotated[float, setting("excess kurtosis from which it is none either: pulses, knocks")] = 1.5
    pulses: Annotated[
        float, setting("excess kurtosis that only skill at every horizon outweighs: rare, large torques")
    ] = 4.0
    hardly: Annotated[
        float,
        share(
            "of the missing log-likelihood: with less explained skill counts as beside pulses, and without skill "
            "nothing is named where a signal predicts as much of what is left"
        ),
    ] = 0.1
    proven: Annotated[
        float, share("share of the squared held-out error that effects remove to stand by themselves")
    ] = 0.75
    hopeless: Annotated[
        float, share("error over that of a motion at constant speed, and R2, beyond which nothing is predicted")
    ] = 0.5
    good: Annotated[
        float,
        share("R2 of the free run over the held-out part below which trust is amber, and beside a rest nothing named"),
    ] = 0.9
    notable_misfit: Annotated[
        float, setting("times the noise: laws of friction and contact that are nearly right leave up to two", ge=1)
    ] = 3.0
    larger_of_one: Annotated[
        float, share("and that of one of several records, of which few runs tell: beyond, they are withdrawn")
    ] = 0.1
    larger: Annotated[float, share("by which effects may make the held-out misfit larger: beyond, trust is amber")] = (
        0.01
    )
    far_off: Annotated[
        float, setting("stated uncertainties by which a re-fitted value is implausible: upwards they are factors", gt=1)
    ] = 2.0
    likely_gain: Annotated[
        float, setting("standard deviation of a drive's gain before a record is seen: data sheets say 10 %", gt=0)
    ] = 0.06
    sure_gain: Annotated[float, setting("log-likelihood that one gain must save of many values that are off")] = 8.0
    least_carriers: Annotated[int, setting("values that must agree on a gain: fewer are no evidence", ge=2)] = 3
    explained_by_nominal: Annotated[
        float, setting("gain of re-fitting, per parameter, up to which nominal values hold")
    ] = 3.0
    alike: Annotated[float, share("share of the gain within which effects of a family look alike")] = 0.05
    alike_gain: Annotated[float, setting("or this gain, where that is more: what chance may add to one of two")] = 8.0
    undecided: Annotated[float, setting("and within which any two do: odds of twenty to one")] = 3.0
    mostly_explained: Annotated[float, share("share explained below which a note speaks of the rest")] = 0.8
    follows: Annotated[float, setting("gain from which the rest is said to follow something: chance stays below")] = 8.0
    remainder: RemainderSettings = RemainderSettings()


class PlacesSettings(Settings, frozen=True):
    """Where record and model disagree: intervals with more missing torque than their share of the samples."""

    bins: Annotated[int, setting("quantiles between which intervals may end", ge=3)] = 24
    concentrated: Annotated[float, setting("energy share over sample share from which an interval counts", ge=1)] = 1.25
    narrow: Annotated[float, share("share of the frequency axis below which a band says something")] = 0.06
    band: Annotated[float, share("energy that a band must hold: most of it")] = 0.5
    small: Annotated[float, share("share of the misfit below which a place is not worth a line")] = 0.02
    most: Annotated[int, setting("places reported at most", ge=1)] = 12
    pane: Annotated[int, setting("samples of a spectrum's pane", ge=16)] = 1024
    impulse: Annotated[
        int, setting("samples over which a torque's response is summed: it has faded by then", ge=10)
    ] = 400


class EvidenceSettings(Settings, frozen=True):
    """What else follows position or direction, and from where on chance does not explain it."""

    lines: Annotated[int, setting("strongest lines looked at", ge=1)] = 3
    sure: Annotated[float, setting("levels beyond what the best of all periods gains by chance")] = 7.0
    harmonic_sure: Annotated[float, setting("levels that a second harmonic, of which there is one, must gain")] = 7.0
    term_sure: Annotated[float, setting("levels that a trend or an asymmetry must gain")] = 7.0
    own: Annotated[float, share("share of its response that a term keeps beside the free parameters'")] = 0.03
    least_repeats: Annotated[float, setting("times that a line must repeat within the travel; else it is a trend")] = (
        2.0
    )
    separation: Annotated[int, setting("grid points within which lines are one", ge=0)] = 4
    harmonic_search: Annotated[float, setting("half-width of the search for a second harmonic, relative")] = 0.002
    same_period: Annotated[float, setting("relative difference within which periods are the same")] = 0.01


class DiagnosisSettings(Settings, frozen=True):
    """All settings of a diagnosis."""

    admission: AdmissionSettings = AdmissionSettings()
    rate: RateSettings = RateSettings()
    likelihood: LikelihoodSettings = LikelihoodSettings()
    fit: FitSettings = FitSettings()
    scan: ScanSettings = ScanSettings()
    search: SearchSettings = SearchSettings()
    verdict: VerdictSettings = VerdictSettings()
    places: PlacesSettings = PlacesSettings()
    evidence: EvidenceSettings = EvidenceSettings()
    proof: ProofSettings = ProofSettings()
    learned: LearnedSettings = LearnedSettings()
    inverse: InverseSettings = InverseSettings()

    def __post_init__(self) -> None:
        """Refuse settings that contradict each other."""
        if not 0.05 <= self.fit.fitted < self.fit.looked_at:
            raise ValueError("`fit.fitted` must be at least 0.05 and less than `fit.looked_at`, but is not")
        if not self.search.first_level < self.search.noise_levels:
            raise ValueError("`search.first_level` must be less than `search.noise_levels`, but is not")
        if not self.search.least_noise < self.search.most_noise:
            raise ValueError("`search.least_noise` must be less than `search.most_noise`, but is not")

    @property
    def levels(self) -> tuple[float, ...]:
        """Return the ladder of process noise, falling, as shares of the drive's torque."""
        search = self.search
        return tuple(float(f) for f in np.geomspace(search.most_noise, search.least_noise, search.noise_levels))
