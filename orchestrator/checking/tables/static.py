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
archive.duplicate | E | * | * | every path is that of one file or folder | write the archive anew; tools differ in which copy they take
archive.repeated | W | * | * | no file is stored twice | write the archive anew, each file once
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
schema.invalid | E | 2.2 | 2.4 | XML files have the elements and attributes of the schemas of FMI | correct the element or attribute

[description]
model.fmi-version | E | 2.2.1 | 2.4.1 | fmiVersion is 2.0 or 3.0 | write the version of the standard that was used
model.not-covered | W | - | * | the FMU is one of FMI 2.0 or 3.0 | use the tools of that version for the rest
model.guid | E | 2.2.1 | 2.4.1 | the guid (FMI 3.0: instantiationToken) is not empty | write the same into the XML and the binary
model.date | W | 2.2.1 | 2.4.1 | generationDateAndTime is YYYY-MM-DDThh:mm:ssZ | write the time in UTC with a Z
model.identifier | E | 4.3.1 | 2.4.2 | modelIdentifier is a C identifier | use letters, digits and underscores
model.interface | E | 2.2.1 | 2.4.1 | there is at least one interface | add CoSimulation, ModelExchange or ScheduledExecution
model.capability | E | 4.3.1 | 2.4.2 | capability flags fit one another | correct the flag
model.unknown-flag | W | - | 2.4.2 | flags that the standard does not have are in a namespace | put the flag into a namespace of your own
model.execution-tool | I | 4.3.1 | 2.5.3 | the FMU runs without its tool | nothing, if the tool is installed; else export a stand-alone FMU
model.log-category | E | 2.2.4 | 2.4.5 | log categories are unique | remove the repeated one
model.vendor-annotation | E | 2.2.6 | - | tool names of vendor annotations are unique | merge the annotations of one tool
model.experiment | E | 2.2.5 | 2.4.6 | DefaultExperiment makes sense | correct the times
type.name | E | 2.2.3 | 2.4.4 | type names are unique and no variable's | rename one
type.unit | E | 2.2.3 | 2.4.4 | units of types are defined | add the unit to UnitDefinitions
type.bounds | E | 2.2.3 | 2.4.4 | min is at most max | swap or correct them
type.enumeration | E | 2.2.3 | 2.4.4 | names and values of items are unique | give each item its own name and value
unit.name | E | 2.2.2 | 2.4.3 | units and their display units are unique | remove the repeated one
unit.factor | E | 2.2.2 | 2.4.3 | no factor is zero | write the factor to SI
unit.conversion | W | 2.2.2 | 2.4.3 | factors and offsets of units are those of their names | correct them: BaseUnit = factor * value + offset, DisplayUnit likewise from the value
unit.exponents | W | 2.2.2 | * | the base exponents are those of the unit's name | correct the exponents of BaseUnit
variable.name-duplicate | E | 2.2.7 | 2.4.7.5.1 | variable names are unique | rename one
variable.name-structured | E | 2.2.9 | 2.4.7.5.1 | structured names follow the grammar | quote odd characters with '...' or use the flat convention
variable.name-flat | E | 2.2.9 | 2.4.7.5.1 | flat names have no control characters | remove them
variable.causality-variability | E | 2.2.7 | 2.4.7.4 | causality and variability fit | see the table of the standard
variable.initial | E | 2.2.7 | 2.4.7.5 | initial fits causality and variability | see the table of the standard, or leave it out
variable.continuous-not-real | E | 2.2.7 | 2.4.7.4 | only floating point variables are continuous | write variability="discrete"
variable.independent | E | 2.2.7 | 2.4.7.4 | there is one independent variable (FMI 2.0: at most one) of a floating point type | keep one
variable.start-missing | E | 2.2.7 | 2.4.7.5 | inputs, parameters and initial exact or approx have a start | add start
variable.start-forbidden | E | 2.2.7 | 2.4.7.5 | calculated and independent variables have no start | remove start, or set initial to exact or approx
variable.start-range | E | 2.2.7 | 2.4.7.5 | start lies within min and max | correct start or the bounds
variable.bounds | E | 2.2.7 | 2.4.7.5 | min is at most max | swap or correct them
variable.bounds-exceed-type | E | 2.2.7 | - | bounds do not exceed those of the declared type | narrow the bounds, or widen those of the type
variable.nominal | E | 2.2.7 | 2.4.7.5 | nominal is positive | write the magnitude of the variable
variable.not-finite | E | 2.2.7 | 2.4.7.5 | start and nominal are finite | write a finite number
variable.declared-type | E | 2.2.7 | 2.4.7.5 | the declared type exists and has the variable's type | define it in TypeDefinitions
variable.unit | E | 2.2.7 | 2.4.7.5 | the unit is defined | add it to UnitDefinitions
variable.display-unit | E | 2.2.7 | 2.4.7.5 | the display unit is defined for the unit | add a DisplayUnit to the unit
variable.derivative | E | 2.2.7 | 2.4.7.5 | a derivative names another continuous floating point variable of its size | write the index (from 1; FMI 3.0: the value reference) of the state
variable.reinit | E | 2.2.7 | 2.4.7.5 | only continuous states have reinit | remove reinit
variable.multiple-set | E | 2.2.7 | 2.4.7.4 | only FMUs for model exchange (FMI 3.0: inputs) have canHandleMultipleSetPerTimeInstant | remove the attribute
variable.reference-duplicate | E | - | 2.4.7.4 | value references are unique | give each variable its own, or write an Alias element
variable.dimension | E | - | 2.4.7.2 | a dimension has a positive start, or the value reference of a structural parameter or constant of type UInt64 | correct the dimension
variable.structural | E | - | 2.4.7.2 | a structural parameter is a scalar | use one structural parameter per dimension
variable.start-count | E | - | 2.4.7.5 | an array has one start value, or one for each element | correct the list of start values
variable.max-size | E | - | 2.4.7.5 | start values of Binary variables have at most maxSize bytes | correct maxSize
variable.intermediate-update | E | - | 2.4.7.4 | only continuous variables have intermediateUpdate | remove the attribute
variable.clocks | E | - | 2.4.7.4 | clocked variables are discrete or tunable and name clocks | correct clocks or variability
variable.previous | E | - | 2.4.7.4 | previous names a discrete variable of the same type, for one clocked variable | correct the attribute
clock.causality | E | - | 2.2.8.2 | clocks are inputs, or triggered ones that are outputs or local | correct causality or intervalVariability
clock.variability | E | - | 2.4.7.4 | clocks are discrete | write variability="discrete", or leave it out
clock.interval | E | - | 2.4.4 | constant clocks have a positive interval; changing, countdown and triggered ones have none | correct intervalDecimal
clock.shift | E | - | 2.4.4 | shifts are not negative and go with an interval | correct shiftDecimal
clock.fraction | E | - | 2.4.4 | intervalCounter goes with supportsFraction and resolution, and means the same as intervalDecimal | correct the attributes
clock.priority | E | - | 2.4.4 | input clocks of scheduled execution have a priority, output clocks have none | correct priority
clock.event-mode | E | - | 4.4 | an FMU for co-simulation with clocks has event mode | set hasEventMode and implement it
variable.alias-settable | E | 2.2.7 | - | at most one alias can be set | give the others their own value reference or another causality
variable.alias-start | E | 2.2.7 | - | at most one alias has a start | remove the other starts
variable.alias-constant | E | 2.2.7 | - | all aliases are constant, or none | give the constant its own value reference
variable.alias-unit | E | 2.2.7 | - | aliases have the same unit | use one unit, or own value references
variable.alias-variability | W | 2.2.7 | - | aliases have the same variability | use one variability
structure.index | E | 2.2.8 | 2.4.8 | entries name variables | correct the index (FMI 3.0: value reference)
structure.outputs | E | 2.2.8 | 2.4.8 | the list of outputs has all outputs and nothing else | add or remove the entries named
structure.derivatives | E | 2.2.8 | 2.4.8 | the list of derivatives has derivatives only | set the attribute derivative, or remove the entry
structure.initial-unknowns | E | 2.2.8 | 2.4.8 | the list of initial unknowns is the exact set | add or remove the entries named
structure.clocked-states | E | - | 2.4.8 | ClockedState lists the clocked variables that have a previous value | add or remove the entries named
structure.event-indicators | E | - | 2.4.8 | event indicators are continuous floating point variables | correct the entry
structure.duplicate | E | 2.2.8 | 2.4.8 | an entry is listed once | remove the repeated one
structure.order | W | 2.2.8 | - | lists are sorted by index | sort them
structure.dependencies | E | 2.2.8 | 2.4.8 | dependencies are possible knowns | correct the list
structure.dependencies-kind | E | 2.2.8 | 2.4.8 | dependenciesKind is as long as dependencies, and of kinds that an initial unknown can have | give one kind per dependency
structure.dependencies-kind-type | W | - | 2.4.8 | unknowns that are no floating point variables have dependencies of the kind dependent only | write dependent

[files]
file.source-missing | W | 2.3 | - | source files named are in sources/ | add the file, or remove it from SourceFiles
file.documentation | W | 2.3 | 2.5.1.1 | documentation has its entry page | name the first page index.html
file.icon | W | 2.3 | 2.4.9.1 | model.png is a PNG image | convert it
file.license | W | - | 2.5.1.1 | a folder of licenses has its entry | name it license.txt, license.html or license.spdx
file.external | W | - | 2.5.3 | a tool that is needed is documented | add documentation/externalDependencies.txt
file.version | E | - | 2.4.9 | files beside modelDescription.xml are of its version of FMI | write the same fmiVersion
terminals.name | E | - | 2.4.9.2 | names of terminals are unique | rename one
terminals.variable | E | - | 2.4.9.2 | members of terminals are variables of the FMU | write the name of a variable
terminals.member | E | - | 2.4.9.2 | members of plugs and buses have a memberName of their own | add memberName
terminals.stream | E | - | 2.4.9.2 | a terminal with a stream has one inflow or outflow | correct the kinds of its variables
terminals.icon | W | - | 2.4.9.1 | icons that are named exist, as PNG | add the image
terminals.coordinates | W | - | 2.4.9.1 | the coordinate system is one of the first quadrant | exchange the corners
build.missing | E | - | 2.5.1.3 | sources come with a build description | add sources/buildDescription.xml
build.identifier | W | - | 2.4.10 | build configurations are those of an interface | write its modelIdentifier
build.file | E | - | 2.4.10 | source files that are named are in sources/ | add the file, or remove the entry
build.include | W | - | 2.4.10 | folders of headers that are named are in sources/ | add the folder, or remove the entry
layered.manifest | W | 2.3 | 2.6 | a layered standard's manifest is complete and in its folder | correct the attributes or the folder
layered.role | W | 2.3 | * | roles are those of FMI-LS-REF | use "result", "experiment", …
layered.missing | W | 2.3 | * | related files exist | add the file, or remove the entry
layered.result | W | 2.3 | * | a reference result is a table of variables over time | write `time` and variable names as header, numbers below

[binaries]
binary.none | E | 2.3 | 2.5.1 | there are binaries or sources | export for a platform
binary.not-here | W | * | * | there is a binary for this machine | export for this platform, or check on another one
binary.folder | W | 2.3 | 2.5.1.4.1 | folders of binaries have the names of the standard | rename the folder
binary.missing | E | 2.3 | 2.5.1.4 | the library is named after modelIdentifier | rename the library or the modelIdentifier
binary.format | E | 2.3 | 2.5.1.4 | the library has the platform's format | put the right file into the folder
binary.architecture | E | 2.3 | 2.5.1.4 | the library has the platform's architecture | put the right file into the folder
binary.exports | E | 2.1.1 | 2.2.1 | all functions are exported | define the functions (they may return an error) and export them
binary.python-symbols | W | * | * | a library that uses Python names libpython as needed | link against libpython, or it loads in Python programs only
"""  # noqa: E501
