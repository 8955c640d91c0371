"""The functions of FMI 2.0 and 3.0 and their parameters, once for all that call them or look for them in a library.

A line is a function, by the name that both versions share, and behind it what follows the instance; ``=`` is before the
name that this version has for it. Functions that have no parameters, or are not called by this table, stand together. A
parameter is a kind of value, and says what a caller hands over:

    double      a value                       >double     nothing: the function writes one
    double[]    a list                        >double[]   how many values the function writes
    double[n]   a list; its length follows    >double[n]  the same; the number follows
    refs        value references              >double=    what is there before the function writes one
    texts       a list; its length precedes   new         a saved state to be taken anew, or None
    free        a saved state                 made        nothing: the function makes a state
    state       a saved state                 info        nothing: the function writes an event info
"""

from collections.abc import Mapping

from orchestrator.checking.rules import VERSIONS, Version

C_TYPES: Mapping[Version, Mapping[str, str]] = {
    "2.0": {"Real": "double", "Integer": "int", "Boolean": "int", "String": "text"},
    "3.0": {
        "Float64": "double", "Float32": "float", "Boolean": "uint8", "String": "text", "Clock": "bool",
        **{f"{sign}Int{bits}": f"{sign.lower()}int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)},
    },
}  # fmt: skip
"""The kind of a value, by what the functions are called after that read and set it."""
_TABLES: Mapping[Version, str] = {
    "2.0": """
GetTypesPlatform GetVersion Instantiate FreeInstance EnterInitializationMode ExitInitializationMode Terminate Reset
SetDebugLogging | int texts
SetupExperiment | int double double int double
GetFMUState = GetFMUstate | new
SetFMUState = SetFMUstate | state
FreeFMUState = FreeFMUstate | free
SerializedFMUStateSize = SerializedFMUstateSize | state >size
SerializeFMUState = SerializeFMUstate | state >bytes[n]
DeserializeFMUState = DeSerializeFMUstate | bytes[n] made
GetDirectionalDerivative | refs refs double[] >double[]
[CoSimulation]
CancelStep GetRealStatus GetIntegerStatus GetStringStatus
SetRealInputDerivatives | refs int[] double[]
GetOutputDerivatives = GetRealOutputDerivatives | refs int[] >double[]
DoStep | double double int
GetStatus | int >int=
GetBooleanStatus | int >int
[ModelExchange]
EnterEventMode EnterContinuousTimeMode
UpdateDiscreteStates = NewDiscreteStates | info
CompletedIntegratorStep | int >int >int
SetTime | double
SetContinuousStates | double[n]
GetContinuousStateDerivatives = GetDerivatives | >double[n]
GetEventIndicators | >double[n]
GetContinuousStates | >double[n]
GetNominalsOfContinuousStates | >double[n]
""",
    "3.0": """
GetVersion InstantiateModelExchange InstantiateCoSimulation InstantiateScheduledExecution FreeInstance Terminate Reset
ExitInitializationMode EnterEventMode EnterConfigurationMode ExitConfigurationMode EnterContinuousTimeMode EnterStepMode
EvaluateDiscreteStates GetShiftFraction SetIntervalFraction SetShiftDecimal SetShiftFraction
GetNumberOfVariableDependencies GetVariableDependencies
SetDebugLogging | bool texts
EnterInitializationMode | bool double double bool double
GetFMUState | new
SetFMUState | state
FreeFMUState | free
SerializedFMUStateSize | state >size
SerializeFMUState | state >bytes[n]
DeserializeFMUState | bytes[n] made
GetDirectionalDerivative | refs refs double[n] >double[n]
GetAdjointDerivative | refs refs double[n] >double[n]
GetIntervalDecimal | refs >double[] >int[]
GetIntervalFraction | refs >uint64[] >uint64[] >int[]
GetShiftDecimal | refs >double[]
SetIntervalDecimal | refs double[]
UpdateDiscreteStates | >bool >bool >bool >bool >bool >double
CompletedIntegratorStep | bool >bool >bool
SetTime | double
SetContinuousStates | double[n]
GetContinuousStateDerivatives | >double[n]
GetEventIndicators | >double[n]
GetContinuousStates | >double[n]
GetNominalsOfContinuousStates | >double[n]
GetNumberOfEventIndicators | >size
GetNumberOfContinuousStates | >size
GetOutputDerivatives | refs int32[] >double[n]
DoStep | double double bool >bool >bool >bool >double=
ActivateModelPartition | uint32 double
GetBinary | refs >binaries[n]
SetBinary | refs binaries[n]
""",
}


class FmiFunctions:
    """The functions of a version.

    Attributes:
        prefix: the first letters of every function.
    """

    def __init__(self, version: Version) -> None:
        self.version = version
        self.prefix = f"fmi{version[0]}"
        self._names: dict[str, str] = {}
        self._interfaces: dict[str, str] = {}
        self._parameters: dict[str, list[str]] = {}
        tail = {"2.0": "[]", "3.0": "[n]"}[version]
        for base, kind in C_TYPES[version].items():
            end = "[]" if base == "Clock" else tail
            self._parameters |= {f"Get{base}": ["refs", f">{kind}{end}"], f"Set{base}": ["refs", f"{kind}{end}"]}
        self._names |= {name: name for name in self._parameters}
        interface = ""
        for line in _TABLES[version].strip().splitlines():
            if line.startswith("["):
                interface = line.strip("[]")
                continue
            head, _, parameters = line.partition("|")
            called, _, own = head.partition("=")
            for name in called.split():
                self._names[name] = own.strip() or name
                self._interfaces[name] = interface
                self._parameters[name] = parameters.split()

    def name(self, function: str) -> str:
        return self.prefix + self._names[function]

    def export_names(self, interface: str) -> list[str]:
        """What a library must export for an interface; in FMI 3.0 everything."""
        return [self.name(f) for f in self._names if self._interfaces.get(f, "") in ("", interface)]

    def names_with(self, *words: str) -> list[str]:
        return [self.name(f) for f in self._names if f.startswith(words)]

    def parameters(self, function: str) -> list[str]:
        """Return the parameters behind the instance, of which ``checking.host`` makes arguments."""
        return self._parameters[function]


FUNCTIONS: Mapping[Version, FmiFunctions] = {version: FmiFunctions(version) for version in VERSIONS}
