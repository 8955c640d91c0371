"""What an FMU and its record are asked before they are believed."""

from typing import Annotated

from orchestrator.shared.settings import Settings, setting, share


class ProbeSettings(Settings, frozen=True):
    """What an FMU is asked before it is believed."""

    stuck: Annotated[float, share("of steps in which nothing moves, from which an FMU has a coarser grid")] = 0.15
    repeats: Annotated[float, share("of the noise by which two runs of one model may differ")] = 1e-3
    louder: Annotated[
        float, setting("standard deviations of chance by which a record's noise must exceed that of its map to count")
    ] = 3.0
    loudest: Annotated[float, setting("times that noise, from which it is none: something moves", ge=1)] = 10.0
    quieter: Annotated[float, setting("times a record's noise from which that of its map is told to be more", ge=1)] = (
        2.0
    )
    first_rows: Annotated[int, setting("rows in which a record shows where it begins, at rest or in motion", ge=1)] = 3
    away: Annotated[
        float, setting("times its noise that an output is off in the first rows, from which the start is another", ge=1)
    ] = 30.0
    alone: Annotated[float, setting("times its noise by which a row leaves its neighbours, to be an outlier", ge=1)] = (
        20.0
    )
    few: Annotated[float, share("of the rows that are outliers at most: more are the motion's own")] = 0.01
    fewest: Annotated[int, setting("runs that the probes and the first fit take", ge=1)] = 20
    fewest_each: Annotated[int, setting("further runs for each uncertain value", ge=0)] = 6
    slow: Annotated[float, setting("seconds of a run from which the user is told")] = 0.5
    sliver: Annotated[
        float, share("of a communication step by which it is cut short: above rounding, below all that an output shows")
    ] = 1e-9
    finely: Annotated[
        int, setting("communication steps in a sample that show an FMU's own: many whole numbers divide it", ge=10)
    ] = 60
    before_push: Annotated[int, setting("steps of its own before an input is pushed, to see when it answers", ge=1)] = 3
    after_push: Annotated[int, setting("and after that: a polynomial of degree 5 follows them", ge=8)] = 8
    smooth: Annotated[
        float, share("of a response, or of a step of an FMU's own, by which it may leave a smooth curve")
    ] = 1e-4
    moves: Annotated[float, share("of a variable's size by which a parameter or a port must change it")] = 1e-9
    impulse: Annotated[float, share("of the drive: the pulse that measures a response")] = 0.5
    pushed: Annotated[float, setting("by how much what is handed from FMU to FMU is moved, to see what follows")] = 1e-3
    shorter: Annotated[float, setting("how many times shorter the second such step is", gt=1.0)] = 4.0
    at_once: Annotated[float, share("of a response that the shorter step must leave, to depend at once")] = 0.5
