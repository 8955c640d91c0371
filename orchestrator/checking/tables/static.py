"""The rules of what is read: archive, XML, description, files, binaries.

See ``rules`` for the columns.
"""

STATIC = """
[archive]
archive.not-a-zip | E | * | * | the FMU is a ZIP archive | export the FMU again; the file was cut or is something else
archive.corrupt | E | * | * | every entry unpacks, with the right checksum | export or download the FMU again
archive.no-model-description | E | 2.3 | 2.5.1 | modelDescription.xml is at the top of the archive | zip the contents of the folder, not the folder
archive.traversal | E | * | * | no path leaves the FMU | do not unpack this archive; write it with plain relative paths
archive.absolute | E | * | * | all paths are relative | do not unpack this archive; write it with plain relative paths
archive.backslash | E | 2.3 | 2.5.1 | folders are separated by `/` | write the archive with forward slashes
archive.odd-name | W | * | * | file names work on every platform | rename the file
archive.long-name | E | * | * | names are short enough to be unpacked | shorten the names
archive.symlink | E | * | * | there are only files and folders | store the file that the link means
archive.duplicate | E | * | * | every path occurs once | write the archive anew; tools differ in which copy they take
archive.case-clash | W | * | * | paths differ by more than upper and lower case | rename one; Windows and macOS keep only one of them
archive.encrypted | E | 2.3 | 2.5.1 | no entry is encrypted | store the entry without a password
archive.compression | E | 2.3 | 2.5.1 | entries are stored or deflated | pack with deflate
archive.bomb-ratio | E | * | * | no file unpacks to absurdly more than its packed size | if you trust the file, repack it without compression
archive.too-large | E | * | * | the files stay within the size limit | if you trust the file, raise the size limit
archive.too-many-files | E | * | * | the number of files stays within the limit | pack resources into fewer files
archive.overlap | E | * | * | entries do not share bytes | do not unpack this archive; it is built as a bomb

[xml]
xml.too-large | E | * | * | an XML file stays within the size limit | split arrays or shorten descriptions
xml.doctype | E | * | * | there is no DOCTYPE and no entity | remove the DOCTYPE and write the entities out
xml.malformed | E | 2.2 | 2.4 | an XML file is well-formed | mend the XML at the place named
xml.encoding | E | 2.2 | 2.4 | XML is encoded in UTF-8 | save the file as UTF-8

[schema]
schema.invalid | E | 2.2 | - | modelDescription.xml is valid against the FMI 2.0 schema | correct the element or attribute at the path
schema.fmpy | E | * | * | FMPy's validation finds nothing | correct what FMPy names

[description]
model.fmi-version | E | 2.2.1 | 2.4.1 | fmiVersion is 1.0, 2.0 or 3.x | write the version of the standard that was used
model.not-covered | W | - | * | the FMU is one of FMI 2.0 | use FMPy or the tools of that version for the rest
model.no-co-simulation | I | * | - | the FMU has a co-simulation interface | nothing; model exchange is checked by the static rules only
model.guid | E | 2.2.1 | - | the guid is not empty | write the same guid into the XML and the binary
model.date | W | 2.2.1 | - | generationDateAndTime is YYYY-MM-DDThh:mm:ssZ | write the time in UTC with a Z
model.identifier | E | 4.3.1 | - | modelIdentifier is a C identifier | use letters, digits and underscores
model.capability | E | 4.3.1 | - | capability flags fit one another | correct the flag
model.execution-tool | I | 4.3.1 | - | the FMU runs without its tool | nothing, if the tool is installed; else export a stand-alone FMU
model.log-category | E | 2.2.4 | - | log categories are unique | remove the repeated one
model.vendor-annotation | E | 2.2.6 | - | tool names of vendor annotations are unique | merge the annotations of one tool
model.experiment | E | 2.2.5 | - | DefaultExperiment makes sense | correct the times
type.name | E | 2.2.3 | - | type names are unique and no variable's | rename one
type.unit | E | 2.2.3 | - | units of types are defined | add the unit to UnitDefinitions
type.bounds | E | 2.2.3 | - | min is at most max | swap or correct them
type.enumeration | E | 2.2.3 | - | names and values of items are unique | give each item its own name and value
unit.name | E | 2.2.2 | - | units and their display units are unique | remove the repeated one
unit.factor | E | 2.2.2 | - | no factor is zero | write the factor to SI
unit.exponents | W | 2.2.2 | - | the base exponents are those of the unit's name | correct the exponents of BaseUnit
variable.name-duplicate | E | 2.2.7 | - | variable names are unique | rename one
variable.name-structured | E | 2.2.9 | - | structured names follow the grammar | quote odd characters with '...' or use the flat convention
variable.name-flat | E | 2.2.9 | - | flat names have no control characters | remove them
variable.causality-variability | E | 2.2.7 | - | causality and variability fit | see the table in section 2.2.7 of the standard
variable.initial | E | 2.2.7 | - | initial fits causality and variability | see the table in section 2.2.7 of the standard, or leave it out
variable.continuous-not-real | E | 2.2.7 | - | only Real variables are continuous | write variability="discrete"
variable.independent | E | 2.2.7 | - | there is at most one independent variable, and it is Real | keep one
variable.start-missing | E | 2.2.7 | - | inputs, parameters and initial exact or approx have a start | add start
variable.start-forbidden | E | 2.2.7 | - | calculated and independent variables have no start | remove start, or set initial to exact or approx
variable.start-range | E | 2.2.7 | - | start lies within min and max | correct start or the bounds
variable.bounds | E | 2.2.7 | - | min is at most max | swap or correct them
variable.bounds-exceed-type | E | 2.2.7 | - | bounds do not exceed those of the declared type | narrow the bounds, or widen those of the type
variable.nominal | E | 2.2.7 | - | nominal is positive | write the magnitude of the variable
variable.not-finite | E | 2.2.7 | - | start and nominal are finite | write a finite number
variable.declared-type | E | 2.2.7 | - | the declared type exists and has the variable's type | define it in TypeDefinitions
variable.unit | E | 2.2.7 | - | the unit is defined | add it to UnitDefinitions
variable.display-unit | E | 2.2.7 | - | the display unit is defined for the unit | add a DisplayUnit to the unit
variable.derivative | E | 2.2.7 | - | derivative points to another continuous Real variable | write the index (from 1) of the state
variable.reinit | E | 2.2.7 | - | reinit only for continuous states of model exchange | remove reinit
variable.multiple-set | E | 2.2.7 | - | canHandleMultipleSetPerTimeInstant only for model exchange | remove the attribute
variable.alias-settable | E | 2.2.7 | - | at most one alias can be set | give the others their own value reference or another causality
variable.alias-start | E | 2.2.7 | - | at most one alias has a start | remove the other starts
variable.alias-constant | E | 2.2.7 | - | all aliases are constant, or none | give the constant its own value reference
variable.alias-unit | E | 2.2.7 | - | aliases have the same unit | use one unit, or own value references
variable.alias-variability | W | 2.2.7 | - | aliases have the same variability | use one variability
structure.index | E | 2.2.8 | - | indices are those of variables, from 1 | correct the index
structure.outputs | E | 2.2.8 | - | Outputs lists all outputs and nothing else | add or remove the entries named
structure.derivatives | E | 2.2.8 | - | Derivatives lists derivatives only | set the attribute derivative, or remove the entry
structure.initial-unknowns | E | 2.2.8 | - | InitialUnknowns is the exact set | add or remove the entries named
structure.duplicate | E | 2.2.8 | - | an entry is listed once | remove the repeated one
structure.order | W | 2.2.8 | - | lists are sorted by index | sort them
structure.dependencies | E | 2.2.8 | - | dependencies are indices of possible knowns | correct the list
structure.dependencies-kind | E | 2.2.8 | - | dependenciesKind is as long as dependencies | give one kind per dependency

[files]
file.source-missing | W | 2.3 | - | source files named are in sources/ | add the file, or remove it from SourceFiles
file.documentation | W | 2.3 | - | documentation has its entry page | name the first page index.html
file.icon | W | 2.3 | - | model.png is a PNG image | convert it
layered.manifest | W | 2.3 | - | a layered standard's manifest is complete and in its folder | correct the attributes or the folder
layered.role | W | 2.3 | - | roles are those of FMI-LS-REF | use "result", "experiment", …
layered.missing | W | 2.3 | - | related files exist | add the file, or remove the entry
layered.result | W | 2.3 | - | a reference result is a table of variables over time | write `time` and variable names as header, numbers below

[binaries]
binary.none | E | 2.3 | - | there are binaries or sources | export for a platform
binary.not-here | W | * | - | there is a binary for this machine | export for this platform, or check on another one
binary.folder | W | 2.3 | - | folders of binaries have FMI 2.0 names, or FMI 3.0's where 2.0 has none (`aarch64-linux`) | rename the folder
binary.missing | E | 2.3 | - | the library is named after modelIdentifier | rename the library or the modelIdentifier
binary.format | E | 2.3 | - | the library has the platform's format | put the right file into the folder
binary.architecture | E | 2.3 | - | the library has the platform's architecture | put the right file into the folder
binary.exports | E | 2.1.1 | - | all fmi2 functions are exported | define the functions (they may return fmi2Error) and export them
binary.python-symbols | W | * | - | a library that uses Python names libpython as needed | link against libpython, or it loads in Python programs only
"""  # noqa: E501
