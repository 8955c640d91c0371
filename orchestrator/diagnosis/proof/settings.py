"""Thresholds of the proof: free runs, prediction errors on held-out data, laws learned from what is left."""

from typing import Annotated

from orchestrator.shared.settings import Settings, note, setting, share


class FreeRunSettings(Settings, frozen=True):
    """Free runs of the exact plant: how their initial states are found."""

    iterations: Annotated[int, setting("Gauss-Newton steps of an initial state", ge=1)] = 12
    damping: Annotated[float, setting("damping of the first step: a good guess needs hardly any", gt=0)] = 1e-6
    tries: Annotated[int, setting("dampings tried in a step", ge=1)] = 6
    enough: Annotated[float, setting("relative gain below which a start has converged")] = 1e-4
    fade: Annotated[float, setting("share of the trace added to the diagonal: unseen states stay put", gt=0)] = 1e-10
    close: Annotated[float, setting("rms in noise deviations up to which a run is close", ge=1)] = 1.3
    straight: Annotated[
        float, share("by which the first step may miss what derivatives foretell: a linear run has one best start")
    ] = 0.01
    growing: Annotated[tuple[float, ...], note("shares of the run over which a start is sought again")] = (
        0.1,
        0.25,
        0.5,
        1.0,
    )
    lost: Annotated[
        float,
        setting("rms over the first, as a share of the motion there, beyond which no more is sought", gt=0),
    ] = 0.3
    least_samples: Annotated[int, setting("samples of such a share at least", ge=2)] = 10
    nudge: Annotated[float, setting("step of a derivative, as a share of a state's typical size", gt=0)] = 0.1
    relative_size: Annotated[float, setting("typical size of speeds and torques, relative to themselves", gt=0)] = 0.01
    least_speed: Annotated[float, setting("typical size of a speed at rest [rad/s]", gt=0)] = 1e-3


class HorizonSettings(Settings, frozen=True):
    """Predictions over several horizons on data that no fit has seen, and when they get worse."""

    spans: Annotated[tuple[float, ...], note("horizons [s] beside one sample, a segment and the whole part")] = (
        0.05,
        0.5,
    )
    starts: Annotated[int, setting("predictions of each horizon, spread over the part", ge=10)] = 60
    most_segments: Annotated[int, setting("free runs of a segment's length at most, spread over the part", ge=1)] = 16
    larger: Annotated[float, share("share by which chance may make an error larger")] = 0.01
    of_noise: Annotated[float, share("and share of the measurement noise")] = 0.05
    sure: Annotated[float, setting("standard deviations of chance by which predictions must get worse")] = 2.0
    draws: Annotated[int, setting("draws of the torque noise that say what chance does to long runs", ge=8)] = 24
    ruled_by_noise: Annotated[float, setting("horizons below this [s] say little of skill: noise rules them")] = 0.1


class ProofSettings(Settings, frozen=True):
    """The misfit on data that no fit has touched."""

    segment: Annotated[float, setting("length of a free run [s]; that of the thesis's tests", gt=0)] = 2.0
    least_samples: Annotated[int, setting("samples of a free run at least", ge=2)] = 40
    runs: Annotated[int, setting("free runs of a part at least: of three, torque noise makes what it likes", ge=1)] = 12
    same_input: Annotated[
        float, share("rms of two requests' difference over the request: repeats of one experiment")
    ] = 0.02
    horizons: HorizonSettings = HorizonSettings()
    free_run: FreeRunSettings = FreeRunSettings()
    first_guess: Annotated[int, setting("samples after which the filter's state is a fair first guess", ge=1)] = 20


class CycleSettings(Settings, frozen=True):
    """The search for what comes again and again in time."""

    bins: Annotated[int, setting("parts of a cycle, of two samples at least: shorter pulses still show", ge=8)] = 24
    repeats: Annotated[int, setting("cycles of the fitted part at least: fewer are a trend", ge=2)] = 4
    sure: Annotated[
        float, setting("variance of the mean cycle over that of unlike ones from which it repeats; chance: 1", gt=1)
    ] = 4.0


class LearnedSettings(Settings, frozen=True):
    """A law learned from what no effect explains."""

    fitted: Annotated[
        int, setting("arguments that are fitted in full, most promising first; 0: none is learned", ge=0)
    ] = 2
    left: Annotated[float, share("of the deciding part's misfit that a law may leave: less is not worth a curve")] = 0.7
    surely: Annotated[float, setting("times that a law shrinks a misfit which is no noise", gt=1)] = 3.0
    spread: Annotated[float, setting("prior deviation of its values, in torques of the drive", gt=0)] = 1.0
    formula: Annotated[float, setting("mean square in standard errors up to which a formula runs within the band")] = (
        1.5
    )
    starts: Annotated[
        int, setting("times at which a law may begin that are screened, and as many near the best", ge=0)
    ] = 5
    refined: Annotated[int, setting("such times among which a fitted law is moved to the likeliest", ge=2)] = 300
    cycle: CycleSettings = CycleSettings()


class InverseSettings(Settings, frozen=True):
    """The torque of the inverse model, as published for EMPS (Janot, Gautier and Brunot 2019)."""

    order: Annotated[int, setting("of the Butterworth filter", ge=1)] = 4
    cut_off: Annotated[float, setting("of half the sampling rate", gt=0, le=0.99)] = 0.2
    decimation: Annotated[int, setting("factor by which torques are decimated", ge=2)] = 10
    least_rows: Annotated[int, setting("filtered rows for each value that is fitted to them", ge=2)] = 10
    at_rest: Annotated[
        float,
        share("of the speed that 99 of 100 rows stay below; slower ones rest, held by any friction there is"),
    ] = 0.03
    untold: Annotated[
        float,
        setting("standard errors by which a value may miss what is stated, and be taken for it", gt=0),
    ] = 2.0
    closer: Annotated[float, share("of prediction errors (geometric mean) below which its values are told")] = 0.9
    border: Annotated[int, setting("samples at either end where the filters settle", ge=1)] = 50
