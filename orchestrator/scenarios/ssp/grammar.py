"""The grammar of SSP 2.0: structure, parameter values and mappings; see ``shared.xml_grammar`` for the notation."""

_LINES = r"""
ssd.SystemStructureDescription | ssd.System ssd.Enumerations? ssd.Units? ssd.DefaultExperiment? @ANNOTATED | version:2.0/1.0! name! @base @top
ssd.System | ssd.Connectors? ssd.ElementGeometry? ssd.ParameterBindings? @META ssd.Elements? ssd.Connections? ssd.SignalDictionaries? ssd.SystemGeometry? ssd.GraphicalElements? ssd.Annotations? | name! @base
ssd.Elements | (ssd.Component|ssd.SignalDictionaryReference|ssd.System)+ |
ssd.Component | ssd.Connectors? ssd.ElementGeometry? ssd.ParameterBindings? @META ssd.Annotations? | name! type source implementation:any/ModelExchange/CoSimulation/ScheduledExecution @base
ssd.SignalDictionaryReference | ssd.Connectors? ssd.ElementGeometry? ssd.ParameterBindings? @META ssd.Annotations? | name! dictionary! @base
ssd.SignalDictionaries | ssd.SignalDictionary+ |
ssd.SignalDictionary | ANY | name! type source @base
ssd.Connectors | ssd.Connector+ |
ssd.Connector | (@TYPE)? ssc.Dimension* ssd.Clock* ssd.ConnectorGeometry? ssd.Annotations? | name! kind:input/output/parameter/calculatedParameter/structuralParameter/constant/local/inout/unspecified! @base
ssd.Clock | | name!
ssd.ConnectorGeometry | | x:double! y:double! systemInnerX:double systemInnerY:double
ssd.ElementGeometry | | @corners rotation:double iconSource iconRotation:double iconFlip:boolean iconFixedAspectRatio:boolean
ssd.SystemGeometry | | @corners
ssd.GraphicalElements | ssd.Note+ |
ssd.Note | | @corners text!
@corners | | x1:double! y1:double! x2:double! y2:double!
ssd.Connections | ssd.Connection+ |
ssd.Connection | (@TRANSFORMATION)? ssd.ConnectionGeometry? ssd.Annotations? | startElement startConnector! startIndices:uint64* endElement endConnector! endIndices:uint64* suppressUnitConversion:boolean @base
ssd.ConnectionGeometry | | pointsX:double*! pointsY:double*!
ssd.ParameterBindings | ssd.ParameterBinding+ |
ssd.ParameterBinding | ssd.ParameterValues? ssd.ParameterMapping? @ANNOTATED | type source sourceBase:SSD/component prefix @base
ssd.ParameterValues | ssv.ParameterSet? |
ssd.ParameterMapping | ssm.ParameterMapping? @META | type source sourceBase:SSD/component @base
ssd.DefaultExperiment | ssd.Annotations? | startTime:double stopTime:double
ssv.ParameterSet | ssv.Parameters ssv.Enumerations? ssv.Units? @META ssv.Annotations? | version:2.0/1.0! name! @base @top
ssv.Parameters | ssv.Parameter* |
ssv.Parameter | (@VALUE) ssc.Dimension* ssv.Annotations? | name! @base
ssv.Real | | value:double*! unit
ssv.Float64 | | value:double*! unit
ssv.Float32 | | value:double*! unit
ssv.Integer | | value:int32*!
ssv.Int8 | | value:int8*!
ssv.UInt8 | | value:uint8*!
ssv.Int16 | | value:int16*!
ssv.UInt16 | | value:uint16*!
ssv.Int32 | | value:int32*!
ssv.UInt32 | | value:uint32*!
ssv.Int64 | | value:int64*!
ssv.UInt64 | | value:uint64*!
ssv.Boolean | | value:boolean*!
ssv.String | ssv.Value* | value
ssv.Enumeration | ssv.Value* | value name
ssv.Binary | ssv.Value:HexValue* | value:hex mime-type
ssv.Value | | value!
HexValue | | value:hex!
ssm.ParameterMapping | ssm.MappingEntry* @META ssm.Annotations? | version:2.0/1.0! @base @top
ssm.MappingEntry | (@TRANSFORMATION)? ssm.Annotations? | source! target! suppressUnitConversion:boolean @base
ssc.Real | | unit
ssc.Float64 | | unit
ssc.Float32 | | unit
ssc.Integer | |
ssc.Int8 | |
ssc.UInt8 | |
ssc.Int16 | |
ssc.UInt16 | |
ssc.Int32 | |
ssc.UInt32 | |
ssc.Int64 | |
ssc.UInt64 | |
ssc.Boolean | |
ssc.String | |
ssc.Enumeration | | name!
ssc.Binary | | mime-type
ssc.Clock | | intervalVariability:constant/fixed/tunable/changing/countdown/triggered intervalDecimal:double shiftDecimal:double supportsFraction:boolean resolution:uint64 intervalCounter:uint64 shiftCounter:uint64 priority:uint32
ssc.Dimension | | size:uint64 sizeConnector
ssc.LinearTransformation | | factor:double offset:double
ssc.BooleanMappingTransformation | ssc.MapEntry+ |
ssc.IntegerMappingTransformation | ssc.MapEntry+ |
ssc.EnumerationMappingTransformation | ssc.MapEntry+ |
ssc.MapEntry | | source! target!
ssd.Units | ssc.Unit+ |
ssv.Units | ssc.Unit+ |
ssc.Unit | ssc.BaseUnit ssc.Annotations? | name! @base
ssc.BaseUnit | | kg:int32 m:int32 s:int32 A:int32 K:int32 mol:int32 cd:int32 rad:int32 factor:double offset:double
ssd.Enumerations | ssc.Enumeration:NamedItems+ |
ssv.Enumerations | ssc.Enumeration:NamedItems+ |
NamedItems | ssc.Item+ ssc.Annotations? | name! @base
ssc.Item | | name! value:int32!
ssc.MetaData | ssc.Content? ssc.Signature* | kind:general/quality! type! source sourceBase:file/resource @base
ssc.Signature | ssc.Content? | role:authenticity/suitability! type! source sourceBase:file/resource/metaData @base
ssc.Content | ANY | *
ssd.Annotations | ssc.Annotation+ |
ssv.Annotations | ssc.Annotation+ |
ssm.Annotations | ssc.Annotation+ |
ssc.Annotations | ssc.Annotation+ |
ssc.Annotation | ANY | type!
@base | | id description
@top | | author fileversion copyright license generationTool generationDateAndTime:date
"""  # noqa: E501
_KINDS = (
    *("Real", "Float64", "Float32", "Boolean", "String", "Enumeration", "Binary", "Integer"),
    *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)),
)
_TRANSFORMATIONS = ("Linear", "BooleanMapping", "IntegerMapping", "EnumerationMapping")
SSP2 = (
    _LINES.replace("@TYPE", "|".join(f"ssc.{kind}" for kind in (*_KINDS, "Clock")))
    .replace("@VALUE", "|".join(f"ssv.{kind}" for kind in _KINDS))
    .replace("@TRANSFORMATION", "|".join(f"ssc.{kind}Transformation" for kind in _TRANSFORMATIONS))
    .replace("@ANNOTATED", "@META ssd.Annotations?")
    .replace("@META", "ssc.MetaData* ssc.Signature*")
)
