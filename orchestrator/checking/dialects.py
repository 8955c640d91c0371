"""What the versions of FMI differ in for the rules of the description, as data."""

from collections.abc import Mapping
from dataclasses import dataclass

from orchestrator.checking.rules import Version

REAL = ("Real", "Float32", "Float64")
INTEGERS = ("Integer", "Enumeration", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
NUMERIC = (*REAL, *INTEGERS)
KINDS = (*NUMERIC, "Boolean", "String", "Binary", "Clock")
VARIABILITIES = ("constant", "fixed", "tunable", "discrete", "continuous")

InitialTable = Mapping[tuple[str, str], tuple[str | None, ...]]
"""(causality, variability): the values of `initial` that are allowed, the default first."""


@dataclass(frozen=True)
class FmiDialect:
    """One version of FMI.

    Attributes:
        version: "2.0" or "3.0".
        identity: attribute by which ModelStructure and `derivative` name a variable.
        token: attribute that is handed over at instantiation.
        outputs, derivatives, initial_unknowns, clocked_states, event_indicators: elements of ModelStructure, as paths.
        state_flags: capability flags to get and set, and to serialise the state.
        naming, combinations: sections of the text about names, and about causality and variability.
    """

    version: Version
    causalities: tuple[str, ...]
    initial: InitialTable
    identity: str
    token: str
    outputs: str
    derivatives: str
    initial_unknowns: str
    clocked_states: str
    event_indicators: str
    state_flags: tuple[str, str]
    naming: str
    combinations: str


def _table(**inputs: tuple[str | None, ...]) -> dict[tuple[str, str], tuple[str | None, ...]]:
    free = ("calculated", "exact", "approx")
    return {
        **{("parameter", v): ("exact",) for v in ("fixed", "tunable")},
        **{("calculatedParameter", v): ("calculated", "approx") for v in ("fixed", "tunable")},
        **{("input", v): inputs["input"] for v in ("discrete", "continuous")},
        **{(c, "constant"): ("exact",) for c in ("output", "local")},
        **{("local", v): ("calculated", "approx") for v in ("fixed", "tunable")},
        **{(c, v): free for c in ("output", "local") for v in ("discrete", "continuous")},
        ("independent", "continuous"): (None,),
    }


_CAUSALITIES = ("parameter", "calculatedParameter", "input", "output", "local", "independent")
FMI2 = FmiDialect(
    version="2.0",
    causalities=_CAUSALITIES,
    initial=_table(input=(None,)),
    identity="index",
    token="guid",
    outputs="Outputs/Unknown",
    derivatives="Derivatives/Unknown",
    initial_unknowns="InitialUnknowns/Unknown",
    clocked_states="",
    event_indicators="",
    state_flags=("canGetAndSetFMUstate", "canSerializeFMUstate"),
    naming="2.2.9",
    combinations="2.2.7",
)
FMI3 = FmiDialect(
    version="3.0",
    causalities=(*_CAUSALITIES, "structuralParameter"),
    initial=_table(input=("exact",)) | {("structuralParameter", v): ("exact",) for v in ("fixed", "tunable")},
    identity="valueReference",
    token="instantiationToken",
    outputs="Output",
    derivatives="ContinuousStateDerivative",
    initial_unknowns="InitialUnknown",
    clocked_states="ClockedState",
    event_indicators="EventIndicator",
    state_flags=("canGetAndSetFMUState", "canSerializeFMUState"),
    naming="2.4.7.5.1",
    combinations="2.4.7.4",
)
