"""Every rule that a finding can name: how bad it is, what is expected, and what to do.

The table of docs/check.md is this one; a test holds them together.
"""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "info"]
_SEVERITIES: dict[str, Severity] = {"E": "error", "W": "warning", "I": "info"}


@dataclass(frozen=True)
class Rule:
    """A rule: severity ("error", "warning", "info"), what must hold, and advice for who broke it."""

    severity: Severity
    expects: str
    advice: str


def _rules(text: str) -> dict[str, Rule]:
    rules = {}
    for line in text.strip().splitlines():
        name, severity, expects, advice = (part.strip() for part in line.split("|"))
        rules[name] = Rule(_SEVERITIES[severity], expects, advice)
    return rules


_STATIC = """
archive.not-a-zip | E | the FMU is a ZIP archive | export the FMU again; the file was cut or is something else
archive.corrupt | E | every entry unpacks, with the right checksum | export or download the FMU again
archive.no-model-description | E | modelDescription.xml is at the top of the archive | zip the contents of the folder, not the folder
archive.traversal | E | no path leaves the FMU | do not unpack this archive; write it with plain relative paths
archive.absolute | E | all paths are relative | do not unpack this archive; write it with plain relative paths
archive.backslash | E | folders are separated by `/` | write the archive with forward slashes
archive.odd-name | W | file names work on every platform | rename the file
archive.long-name | E | names are short enough to be unpacked | shorten the names
archive.symlink | E | there are only files and folders | store the file that the link means
archive.duplicate | E | every path occurs once | write the archive anew; tools differ in which copy they take
archive.case-clash | W | paths differ by more than upper and lower case | rename one; Windows and macOS keep only one of them
archive.encrypted | E | no entry is encrypted | store the entry without a password
archive.compression | E | entries are stored or deflated | pack with deflate
archive.bomb-ratio | E | no file unpacks to absurdly more than its packed size | if you trust the file, repack it without compression
archive.too-large | E | the files stay within the size limit | if you trust the file, raise the size limit
archive.too-many-files | E | the number of files stays within the limit | pack resources into fewer files
archive.overlap | E | entries do not share bytes | do not unpack this archive; it is built as a bomb
xml.too-large | E | an XML file stays within the size limit | split arrays or shorten descriptions
xml.doctype | E | there is no DOCTYPE and no entity | remove the DOCTYPE and write the entities out
xml.malformed | E | an XML file is well-formed | mend the XML at the place named
xml.encoding | E | XML is encoded in UTF-8 | save the file as UTF-8
schema.invalid | E | modelDescription.xml is valid against the FMI 2.0 schema | correct the element or attribute at the path
schema.fmpy | E | FMPy's validation finds nothing | correct what FMPy names
model.fmi-version | E | fmiVersion is 1.0, 2.0 or 3.x | write the version of the standard that was used
model.not-covered | W | the FMU is one of FMI 2.0 | use FMPy or the tools of that version for the rest
model.no-co-simulation | I | the FMU has a co-simulation interface | nothing; model exchange is checked by the static rules only
model.guid | E | the guid is not empty | write the same guid into the XML and the binary
model.date | E | generationDateAndTime is YYYY-MM-DDThh:mm:ssZ | write the time in UTC with a Z
model.identifier | E | modelIdentifier is a C identifier | use letters, digits and underscores
model.capability | E | capability flags fit one another | correct the flag
model.execution-tool | I | the FMU runs without its tool | nothing, if the tool is installed; else export a stand-alone FMU
model.log-category | E | log categories are unique | remove the repeated one
model.vendor-annotation | E | tool names of vendor annotations are unique | merge the annotations of one tool
model.experiment | E | DefaultExperiment makes sense | correct the times
type.name | E | type names are unique and no variable's | rename one
type.unit | E | units of types are defined | add the unit to UnitDefinitions
type.bounds | E | min is at most max | swap or correct them
type.enumeration | E | names and values of items are unique | give each item its own name and value
unit.name | E | units and their display units are unique | remove the repeated one
unit.factor | E | no factor is zero | write the factor to SI
unit.exponents | W | the base exponents are those of the unit's name | correct the exponents of BaseUnit
variable.name-duplicate | E | variable names are unique | rename one
variable.name-structured | E | structured names follow the grammar | quote odd characters with '...' or use the flat convention
variable.name-flat | E | flat names have no control characters | remove them
variable.causality-variability | E | causality and variability fit | see the table in section 2.2.7 of the standard
variable.initial | E | initial fits causality and variability | see the table in section 2.2.7 of the standard, or leave it out
variable.continuous-not-real | E | only Real variables are continuous | write variability="discrete"
variable.independent | E | there is at most one independent variable, and it is Real | keep one
variable.start-missing | E | inputs, parameters and initial exact or approx have a start | add start
variable.start-forbidden | E | calculated and independent variables have no start | remove start, or set initial to exact or approx
variable.start-range | E | start lies within min and max | correct start or the bounds
variable.bounds | E | min is at most max | swap or correct them
variable.bounds-exceed-type | E | bounds do not exceed those of the declared type | narrow the bounds, or widen those of the type
variable.nominal | E | nominal is positive | write the magnitude of the variable
variable.not-finite | E | start and nominal are finite | write a finite number
variable.declared-type | E | the declared type exists and has the variable's type | define it in TypeDefinitions
variable.unit | E | the unit is defined | add it to UnitDefinitions
variable.display-unit | E | the display unit is defined for the unit | add a DisplayUnit to the unit
variable.derivative | E | derivative points to another continuous Real variable | write the index (from 1) of the state
variable.reinit | E | reinit only for continuous states of model exchange | remove reinit
variable.multiple-set | E | canHandleMultipleSetPerTimeInstant only for model exchange | remove the attribute
variable.alias-settable | E | at most one alias can be set | give the others their own value reference or another causality
variable.alias-start | E | at most one alias has a start | remove the other starts
variable.alias-constant | E | all aliases are constant, or none | give the constant its own value reference
variable.alias-unit | E | aliases have the same unit | use one unit, or own value references
variable.alias-variability | W | aliases have the same variability | use one variability
structure.index | E | indices are those of variables, from 1 | correct the index
structure.outputs | E | Outputs lists all outputs and nothing else | add or remove the entries named
structure.derivatives | E | Derivatives lists derivatives only | set the attribute derivative, or remove the entry
structure.initial-unknowns | E | InitialUnknowns is the exact set | add or remove the entries named
structure.duplicate | E | an entry is listed once | remove the repeated one
structure.order | W | lists are sorted by index | sort them
structure.dependencies | E | dependencies are indices of possible knowns | correct the list
structure.dependencies-kind | E | dependenciesKind is as long as dependencies | give one kind per dependency
file.source-missing | W | source files named are in sources/ | add the file, or remove it from SourceFiles
file.documentation | W | documentation has its entry page | name the first page index.html
file.icon | W | model.png is a PNG image | convert it
layered.manifest | W | a layered standard's manifest is complete and in its folder | correct the attributes or the folder
layered.role | W | roles are those of FMI-LS-REF | use "result", "experiment", …
layered.missing | W | related files exist | add the file, or remove the entry
layered.result | W | a reference result is a table of variables over time | write `time` and variable names as header, numbers below
binary.none | E | there are binaries or sources | export for a platform
binary.not-here | W | there is a binary for this machine | export for this platform, or check on another one
binary.folder | W | folders of binaries have FMI 2.0 names, or FMI 3.0's where 2.0 has none (`aarch64-linux`) | rename the folder
binary.missing | E | the library is named after modelIdentifier | rename the library or the modelIdentifier
binary.format | E | the library has the platform's format | put the right file into the folder
binary.architecture | E | the library has the platform's architecture | put the right file into the folder
binary.exports | E | all fmi2 functions are exported | define the functions (they may return fmi2Error) and export them
binary.python-symbols | W | a library that uses Python names libpython as needed | link against libpython, or it loads in Python programs only
"""  # noqa: E501

_DYNAMIC = """
limits.time | E | no call takes longer than the time limit | look for an endless loop; raise the limit for a slow model
limits.memory | E | memory stays below the memory limit | look for a leak; raise the limit for a large model
limits.output | E | printed text and files stay small | print only when logging is on
run.crash | E | no call ends the process | run the call named under a debugger
run.failed | E | the checks can be carried out | report this with the FMU
run.skipped | I | all checks can be carried out | mend the other findings first
load.library | E | the library loads | see the loader's message; link what is missing
load.version | E | fmi2GetVersion returns 2.0 | return fmi2Version
load.platform | E | fmi2GetTypesPlatform returns default | return fmi2TypesPlatform
run.instantiate | E | fmi2Instantiate succeeds | see the messages of the FMU
run.status | E | every call of a normal life cycle returns fmi2OK or fmi2Warning | see the messages of the FMU
run.pending | E | fmi2Pending only with canRunAsynchronuously | return when the step is done, or set the flag
run.input-refused | W | inputs within their bounds are accepted | state the bounds in min and max
value.not-finite | E | outputs are finite | look for a division by zero or a missing initialisation
value.out-of-range | W | outputs stay within min and max | correct the bounds or the model
value.start | W | start values of the XML are those of the binary | generate both from one source
value.set | E | start values can be set before initialisation, and change nothing | accept what the XML says can be set
value.set-initial | W | variables with initial exact accept their start value before initialisation | accept it, or write initial="calculated"
value.string | E | strings are not null | return "" instead
instances.second | E | a second instance can be made | set canBeInstantiatedOnlyOncePerProcess, or remove global state
instances.interference | E | instances do not influence one another | move global variables into the instance
run.reset | E | fmi2Reset returns the instance to its first state | restore every variable, hidden ones too
run.inexact | W | runs that must be equal are so bit for bit, not only to a thousandth of the range | save and reset the memory of the solver too
run.determinism | W | two equal runs are equal | seed random numbers, initialise memory
state.status | E | the state functions work as the flags promise | implement them, or clear the flag
state.restore | E | a restored state continues as before | save every variable, hidden ones too, by value
state.serialise | E | a serialised state continues as before, also in a new instance | serialise every variable, no pointers
state.free | W | fmi2FreeFMUstate sets the state to null | set the pointer to NULL
steps.variable | W | results hardly depend on the communication step | integrate over the step given, or clear canHandleVariableCommunicationStepSize
reference.result | E | the reference result is reproduced | correct the model, or write the reference again
reference.not-run | I | the reference result can be reproduced in reasonable time | shorten the result
misuse.guid | W | a wrong guid is refused | compare the guid in fmi2Instantiate
misuse.crash | W | misuse does not end the process | check the arguments and the state of the instance
misuse.step-before-init | W | fmi2DoStep before initialisation is refused | return fmi2Error
misuse.negative-step | W | a negative step is refused | return fmi2Error or fmi2Discard
misuse.value-reference | W | unknown value references are refused | return fmi2Error
resources.instance-leak | W | memory does not grow with instances made and freed | free what is allocated in fmi2Instantiate
resources.step-leak | W | memory does not grow with steps | free what is allocated in fmi2DoStep
files.written | W | the FMU writes no files of its own | write only where a parameter says so
files.changed | W | the FMU leaves its own files alone | write to a temporary folder
process.left | W | no process outlives the FMU | end child processes in fmi2FreeInstance
"""  # noqa: E501

RULES: dict[str, Rule] = _rules(_STATIC) | _rules(_DYNAMIC)
