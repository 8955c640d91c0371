"""Every threshold of what runs any FMU beside a record, in groups, each with one line of why."""

from typing import Annotated

from orchestrator.diagnosis.fmu_probe_settings import ProbeSettings
from orchestrator.shared.settings import Settings, note, setting, share


class PlaceSettings(Settings, frozen=True):
    """Which effects a place offers."""

    starts_off: Annotated[float, share("of its rms by which an input starts away from zero to be tried from both")] = (
        1e-3
    )
    least_phase: Annotated[float, setting("radians of a ripple within the motion, from which it is no spring")] = 4.0
    most_cycles: Annotated[int, setting("wavenumbers that are looked through", ge=1)] = 500
    once: Annotated[float, share("of a turn by which a ripple must differ from gravity, which comes once a turn")] = (
        0.03
    )
    long: Annotated[float, share("of the motion over which hysteresis builds up at least: below, it is friction")] = (
        0.04
    )


class ResponseSettings(Settings, frozen=True):
    """Pulse responses at inputs and ports: how noise there reaches the outputs, and what effects there change."""

    pulses: Annotated[int, setting("rows of the record at which a pulse is given: an FMU need not be linear", ge=1)] = 6
    memory: Annotated[
        float, share("of the record after which noise at a port is forgotten: integrators have no spectrum")
    ] = 0.2
    linear: Annotated[float, share("by which responses along the record may differ, to tell what effects change")] = 0.1
    start_states: Annotated[
        int, setting("states at the start that may be off, where the FMU does not let them be set")
    ] = 4
    start_spread: Annotated[float, setting("how far the start may be off, in noise deviations of the outputs")] = 10.0
    start_least: Annotated[float, share("of the largest, that a state's response must have: less is rounding")] = 1e-3
    start_lags: Annotated[
        int, setting("rows before the record at which what was pushed has led to its start", ge=1)
    ] = 24
    window: Annotated[
        int, setting("samples of the sliding cubic that gives speed and acceleration of a measured motion", ge=5)
    ] = 7
    fade: Annotated[float, share("of the rows over which a record fades in and out: filters must see no step")] = 0.005


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


class RateSettings(Settings, frozen=True):
    """The rate at which a long record is analysed."""

    rows: Annotated[int, setting("rows of a record that are looked at in any case", ge=200)] = 4000
    per_band: Annotated[float, setting("rate over the frequency below which nearly all motion lies", gt=2)] = 16.0
    shows: Annotated[float, setting("power over that of the noise from which motion shows", ge=1)] = 4.0
    most_above: Annotated[float, share("of the squared speed that may lie above the band")] = 0.01
    pane: Annotated[int, setting("samples of a spectrum's pane at most", ge=64)] = 1024
    rounding: Annotated[float, share("of a rate that time stamps may be off by")] = 0.02


class FmuSettings(Settings, frozen=True):
    """All thresholds of what runs any FMU beside a record."""

    probe: Annotated[ProbeSettings, note("the probes of the FMU")] = ProbeSettings()
    place: Annotated[PlaceSettings, note("the effects that places offer")] = PlaceSettings()
    response: Annotated[ResponseSettings, note("pulse responses")] = ResponseSettings()
    process: Annotated[ProcessSettings, note("the FMU's processes")] = ProcessSettings()
    read: Annotated[ReadSettings, note("the record")] = ReadSettings()
    rate: Annotated[RateSettings, note("the rate at which it is analysed")] = RateSettings()


DEFAULT = FmuSettings()
