"""The grammar of FMI 2.0's modelDescription.xml; see ``shared.xml_grammar`` for the notation."""

FMI2 = r"""
fmiModelDescription | ModelExchange? CoSimulation? UnitDefinitions? TypeDefinitions? LogCategories? DefaultExperiment? VendorAnnotations:Annotations2? ModelVariables ModelStructure | fmiVersion! modelName! guid! description author version copyright license generationTool generationDateAndTime:date variableNamingConvention:flat/structured numberOfEventIndicators:uint32
ModelExchange | SourceFiles? | @interface completedIntegratorStepNotNeeded:boolean
CoSimulation | SourceFiles? | @interface canHandleVariableCommunicationStepSize:boolean canInterpolateInputs:boolean maxOutputDerivativeOrder:uint32 canRunAsynchronuously:boolean
@interface | | modelIdentifier! needsExecutionTool:boolean canBeInstantiatedOnlyOncePerProcess:boolean canNotUseMemoryManagementFunctions:boolean canGetAndSetFMUstate:boolean canSerializeFMUstate:boolean providesDirectionalDerivative:boolean
SourceFiles | File+ |
File | | name!
UnitDefinitions | Unit+ |
Unit | BaseUnit? DisplayUnit* | name!
BaseUnit | | kg:int32 m:int32 s:int32 A:int32 K:int32 mol:int32 cd:int32 rad:int32 factor:double offset:double
DisplayUnit | | name! factor:double offset:double
TypeDefinitions | SimpleType+ |
SimpleType | (Real:RealType|Integer:IntegerType|Boolean:Empty|String:Empty|Enumeration:EnumerationType) | name! description
RealType | | @real
@real | | quantity unit displayUnit relativeQuantity:boolean min:double max:double nominal:double unbounded:boolean
IntegerType | | quantity min:int32 max:int32
Empty | |
EnumerationType | Item+ | quantity
Item | | name! value:int32! description
LogCategories | Category+ |
Category | | name! description
DefaultExperiment | | startTime:double stopTime:double tolerance:double stepSize:double
Annotations2 | Tool+ |
Tool | ANY | name!
ModelVariables | ScalarVariable+ |
ScalarVariable | (Real|Integer|Boolean|String|Enumeration) Annotations:Annotations2? | name! valueReference:uint32! description causality:parameter/calculatedParameter/input/output/local/independent variability:constant/fixed/tunable/discrete/continuous initial:exact/approx/calculated canHandleMultipleSetPerTimeInstant:boolean
Real | | @real declaredType start:double derivative:uint32 reinit:boolean
Integer | | quantity min:int32 max:int32 declaredType start:int32
Boolean | | declaredType start:boolean
String | | declaredType start
Enumeration | | declaredType! quantity min:int32 max:int32 start:int32
ModelStructure | Outputs:Unknowns? Derivatives:Unknowns? InitialUnknowns? |
Unknowns | Unknown+ |
Unknown | | index:uint32! dependencies:uint32* dependenciesKind:dependent/constant/fixed/tunable/discrete*
InitialUnknowns | Unknown:InitialUnknown+ |
InitialUnknown | | index:uint32! dependencies:uint32* dependenciesKind:dependent/constant/fixed/tunable/discrete*
"""  # noqa: E501
