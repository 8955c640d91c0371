"""The grammars of FMI 3.0: modelDescription, buildDescription, terminalsAndIcons; see ``shared.xml_grammar``."""

FMI3 = r"""
fmiModelDescription | ModelExchange? CoSimulation? ScheduledExecution? UnitDefinitions? TypeDefinitions? LogCategories? DefaultExperiment? ModelVariables ModelStructure Annotations? | fmiVersion:version3! modelName! instantiationToken! description author version copyright license generationTool generationDateAndTime:date variableNamingConvention:flat/structured
ModelExchange | Annotations? | @interface needsCompletedIntegratorStep:boolean providesEvaluateDiscreteStates:boolean *
CoSimulation | Annotations? | @interface canHandleVariableCommunicationStepSize:boolean fixedInternalStepSize:double maxOutputDerivativeOrder:uint32 recommendedIntermediateInputSmoothness:int32 providesIntermediateUpdate:boolean mightReturnEarlyFromDoStep:boolean canReturnEarlyAfterIntermediateUpdate:boolean hasEventMode:boolean providesEvaluateDiscreteStates:boolean *
ScheduledExecution | Annotations? | @interface *
@interface | | modelIdentifier! needsExecutionTool:boolean canBeInstantiatedOnlyOncePerProcess:boolean canGetAndSetFMUState:boolean canSerializeFMUState:boolean providesDirectionalDerivatives:boolean providesAdjointDerivatives:boolean providesPerElementDependencies:boolean
UnitDefinitions | Unit+ |
Unit | BaseUnit? DisplayUnit* Annotations? | name!
BaseUnit | | kg:int32 m:int32 s:int32 A:int32 K:int32 mol:int32 cd:int32 rad:int32 factor:double offset:double
DisplayUnit | Annotations? | name! factor:double offset:double inverse:boolean
TypeDefinitions | (Float32Type|Float64Type|Int8Type|UInt8Type|Int16Type|UInt16Type|Int32Type|UInt32Type|Int64Type|UInt64Type|BooleanType|StringType|BinaryType|EnumerationType|ClockType)+ |
@type | | name! description
@real | | quantity unit displayUnit relativeQuantity:boolean unbounded:boolean
Float32Type | Annotations? | @type @real min:double max:double nominal:double
Float64Type | Annotations? | @type @real min:double max:double nominal:double
Int8Type | Annotations? | @type quantity min:int8 max:int8
UInt8Type | Annotations? | @type quantity min:uint8 max:uint8
Int16Type | Annotations? | @type quantity min:int16 max:int16
UInt16Type | Annotations? | @type quantity min:uint16 max:uint16
Int32Type | Annotations? | @type quantity min:int32 max:int32
UInt32Type | Annotations? | @type quantity min:uint32 max:uint32
Int64Type | Annotations? | @type quantity min:int64 max:int64
UInt64Type | Annotations? | @type quantity min:uint64 max:uint64
BooleanType | Annotations? | @type
StringType | Annotations? | @type
BinaryType | Annotations? | @type mimeType maxSize:natural
EnumerationType | Annotations? Item+ | @type quantity min:int64 max:int64
Item | Annotations? | name! value:int64! description
ClockType | Annotations? | @type @clock
@clock | | canBeDeactivated:boolean priority:uint32 intervalVariability:constant/fixed/tunable/changing/countdown/triggered! intervalDecimal:double shiftDecimal:double supportsFraction:boolean resolution:uint64 intervalCounter:uint64 shiftCounter:uint64
LogCategories | Category+ |
Category | Annotations? | name! description
DefaultExperiment | Annotations? | startTime:double stopTime:double tolerance:double stepSize:double
ModelVariables | (Float32|Float64|Int8|UInt8|Int16|UInt16|Int32|UInt32|Int64|UInt64|Boolean|String|Binary|Enumeration|Clock)+ |
@any | | name! valueReference:uint32! description causality:parameter/calculatedParameter/input/output/local/independent/structuralParameter variability:constant/fixed/tunable/discrete/continuous canHandleMultipleSetPerTimeInstant:boolean clocks:uint32*
@variable | | @any intermediateUpdate:boolean previous:uint32 initial:exact/approx/calculated
Float32 | Annotations? Dimension* Alias:FloatAlias* | @variable declaredType @real min:double max:double nominal:double start:double* derivative:uint32 reinit:boolean
Float64 | Annotations? Dimension* Alias:FloatAlias* | @variable declaredType @real min:double max:double nominal:double start:double* derivative:uint32 reinit:boolean
Int8 | Annotations? Dimension* Alias* | @variable declaredType quantity min:int8 max:int8 start:int8*
UInt8 | Annotations? Dimension* Alias* | @variable declaredType quantity min:uint8 max:uint8 start:uint8*
Int16 | Annotations? Dimension* Alias* | @variable declaredType quantity min:int16 max:int16 start:int16*
UInt16 | Annotations? Dimension* Alias* | @variable declaredType quantity min:uint16 max:uint16 start:uint16*
Int32 | Annotations? Dimension* Alias* | @variable declaredType quantity min:int32 max:int32 start:int32*
UInt32 | Annotations? Dimension* Alias* | @variable declaredType quantity min:uint32 max:uint32 start:uint32*
Int64 | Annotations? Dimension* Alias* | @variable declaredType quantity min:int64 max:int64 start:int64*
UInt64 | Annotations? Dimension* Alias* | @variable declaredType quantity min:uint64 max:uint64 start:uint64*
Boolean | Annotations? Dimension* Alias* | @variable declaredType start:boolean*
String | Annotations? Dimension* Start* Alias* | @variable declaredType
Binary | Annotations? Dimension* Start:HexStart* Alias* | @variable declaredType mimeType maxSize:natural
Enumeration | Annotations? Dimension* Alias* | @variable declaredType! quantity min:int64 max:int64 start:int64*
Clock | Annotations? Alias* | @any declaredType @clock
Dimension | | start:uint64 valueReference:uint32
Start | | value
HexStart | | value:hex
Alias | | name! description
FloatAlias | | name! description displayUnit
ModelStructure | Output:Unknown* ContinuousStateDerivative:Unknown* ClockedState:Unknown* InitialUnknown:Unknown* EventIndicator:Unknown* |
Unknown | Annotations? | valueReference:uint32! dependencies:uint32* dependenciesKind:dependent/constant/fixed/tunable/discrete*
Annotations | Annotation* |
Annotation | ANY | type!
fmiBuildDescription | BuildConfiguration+ Annotations? | fmiVersion:version3!
BuildConfiguration | SourceFileSet* Library* Annotations? | modelIdentifier! platform description
SourceFileSet | SourceFile+ PreprocessorDefinition* IncludeDirectory* Annotations? | name language compiler compilerOptions
SourceFile | Annotations? | name!
PreprocessorDefinition | Option* Annotations? | name! optional:boolean value description
Option | | value description
IncludeDirectory | Annotations? | name!
Library | Annotations? | name! version external:boolean description
fmiTerminalsAndIcons | GraphicalRepresentation? Terminals? Annotations? | fmiVersion:version3!
GraphicalRepresentation | CoordinateSystem? Icon? Annotations? |
CoordinateSystem | | x1:double! y1:double! x2:double! y2:double! suggestedScalingFactorTo_mm:double!
Icon | | x1:double! y1:double! x2:double! y2:double!
Terminals | Terminal+ |
Terminal | TerminalMemberVariable* TerminalStreamMemberVariable* Terminal* TerminalGraphicalRepresentation? Annotations? | name! matchingRule! terminalKind description
TerminalMemberVariable | Annotations? | variableName! memberName variableKind!
TerminalStreamMemberVariable | Annotations? | inStreamMemberName! outStreamMemberName! inStreamVariableName! outStreamVariableName!
TerminalGraphicalRepresentation | Annotations? | defaultConnectionColor:uint8* defaultConnectionStrokeSize:double x1:double! y1:double! x2:double! y2:double! iconBaseName!
"""  # noqa: E501
