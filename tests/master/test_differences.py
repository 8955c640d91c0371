"""Differences, such as 5 degC between two temperatures: their units have no offset."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.simulate import simulate
from orchestrator.diagnosis.fmu.mapping import read_map
from orchestrator.diagnosis.fmu.record import read_fmu_record
from orchestrator.diagnosis.fmu.system import read_system
from orchestrator.errors import ConnectionMismatchError
from orchestrator.fmi.model_description import parse_description
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.protocol import Unit
from orchestrator.master.session import Session
from orchestrator.master.signals import Constant
from orchestrator.master.system import Connection, Quantity, SignalSource, System
from orchestrator.master.units import conversion
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler
from tests.support.mock_slave import instance, model, variable

K, MK = Unit("K", (0, 0, 0, 0, 1, 0, 0, 0)), Unit("mK", (0, 0, 0, 0, 1, 0, 0, 0), 1e-3)
DEGC, DEGF = replace(K, name="degC", offset=273.15), replace(K, name="degF", factor=5 / 9, offset=255.37222222222223)
UNITS = (K, MK, DEGC, DEGF)
compiled = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")


def system(source: Unit, source_relative: bool, target: Unit, target_relative: bool) -> System:
    """What gives 5, connected to the first input of what has two, and a parameter."""
    gives = model("gives", variable("y", "output", 5.0, source.name, relative=source_relative), units=UNITS)
    kind = {"unit": target.name, "relative": target_relative}
    takes = model(
        "takes",
        variable("u", "input", **kind), variable("v", "input", **kind),
        variable("p", "parameter", variability="fixed", **kind), units=UNITS,
    )  # fmt: skip
    slaves = (instance("a", gives, lambda *_: None), instance("b", takes, lambda *_: None))
    return System(slaves, (Connection("a.y", "b.u"),), (SignalSource("b.v", Constant(5.0), source.name),))


@pytest.mark.parametrize(
    ("source", "target", "expected"),
    [(DEGC, K, 5.0), (K, DEGC, 5.0), (DEGF, K, 25 / 9), (DEGC, DEGF, 9.0), (DEGC, MK, 5000.0), (MK, DEGF, 0.009)],
)
def test_a_difference_has_no_offset_wherever_it_comes_from(source: Unit, target: Unit, expected: float) -> None:
    joined = system(source, True, target, True)
    with Session(joined, ["b.u", "b.v", "b.p"], GaussSeidel(0.1), 0.1) as session:
        values = session.run({"b.p": Quantity(5.0, source.name)}).values[:, -1]
    assert values == pytest.approx([expected] * 3)


def test_what_is_no_difference_keeps_its_offset() -> None:
    with Session(system(DEGC, False, K, False), ["b.u", "b.v"], GaussSeidel(0.1), 0.1) as session:
        assert session.run().values[:, -1] == pytest.approx([278.15, 278.15])


@pytest.mark.parametrize("relative", [(True, False), (False, True)])
def test_a_difference_is_nothing_else_where_that_changes_a_number(relative: tuple[bool, bool]) -> None:
    with pytest.raises(ConnectionMismatchError) as error:
        system(DEGC, relative[0], K, relative[1]).check()
    which = "degC" if relative[0] else "K"
    assert f"{which} is a difference (relativeQuantity)" in str(error.value)
    assert "correct relativeQuantity of one FMU" in str(error.value)
    for same in ((K, MK), (DEGC, DEGC), (MK, K)):
        assert not system(same[0], relative[0], same[1], relative[1]).problems()


def test_a_unit_that_says_nothing_is_what_the_other_is() -> None:
    assert conversion(DEGC, replace(K, difference=True)) == (1.0, 0.0)
    assert conversion(replace(DEGC, difference=True), K) == (1.0, 0.0)
    assert conversion(DEGC, K) == (1.0, 273.15)


FMI2 = """<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g"><CoSimulation modelIdentifier="m"/>
<UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit></UnitDefinitions>
<TypeDefinitions><SimpleType name="Difference"><Real unit="K" relativeQuantity="true"/></SimpleType></TypeDefinitions>
<ModelVariables>
<ScalarVariable name="own" valueReference="0"><Real unit="K" relativeQuantity="1"/></ScalarVariable>
<ScalarVariable name="inherited" valueReference="1"><Real declaredType="Difference"/></ScalarVariable>
<ScalarVariable name="corrected" valueReference="2">
<Real declaredType="Difference" relativeQuantity="false"/></ScalarVariable>
<ScalarVariable name="plain" valueReference="3"><Real unit="K"/></ScalarVariable>
</ModelVariables><ModelStructure/></fmiModelDescription>"""
FMI3 = """<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="g"><CoSimulation modelIdentifier="m"/>
<UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit></UnitDefinitions>
<TypeDefinitions><Float64Type name="Difference" unit="K" relativeQuantity="true"/></TypeDefinitions>
<ModelVariables>
<Float64 name="own" valueReference="1" unit="K" relativeQuantity="true">
<Dimension start="2"/><Alias name="other"/></Float64>
<Float64 name="inherited" valueReference="2" declaredType="Difference"/>
<Float64 name="corrected" valueReference="3" declaredType="Difference" relativeQuantity="false"/>
<Float64 name="plain" valueReference="4" unit="K"/>
</ModelVariables><ModelStructure/></fmiModelDescription>"""


@pytest.mark.parametrize("text", [FMI2, FMI3])
def test_what_a_description_says(text: str) -> None:
    variables = parse_description(text.encode(), "here").model.variables
    relative = {name for name, v in variables.items() if v.relative}
    assert relative in ({"own", "inherited"}, {"own[1]", "own[2]", "other[1]", "other[2]", "inherited"})


@compiled
def test_a_column_of_a_record_and_connected_fmus_of_a_fit(tmp_path: Path) -> None:
    for name, unit in (("first", "degC"), ("second", "K")):
        build_answers_fmu(tmp_path, unit=unit, relative=True, name=name)
    (tmp_path / "map.toml").write_text(
        '[inputs]\nu = { column = "du" }\n[outputs]\nx = { column = "dx" }\n'
        '[parameters]\ngain = { value = 2.0, uncertainty = "5 %" }\n'
    )
    rows = [f"{0.01 * k:.2f},{k % 7},{k * k}" for k in range(120)]
    (tmp_path / "record.csv").write_text("\n".join(["time [s],du [degC],dx [degC]", *rows]) + "\n")
    fmu = read_system(tmp_path / "second.fmu")
    record = read_fmu_record(tmp_path / "record.csv", read_map(tmp_path / "map.toml", fmu))
    assert np.array_equal(record.inputs[:, 0], np.arange(120) % 7)
    assert np.array_equal(record.outputs[:, 0], np.arange(120) ** 2)
    (tmp_path / "both.toml").write_text(
        'stop = 1.0\nrecord = ["b.x"]\n[master]\nstep = 0.125\n'
        '[instances.a]\nfmu = "first.fmu"\nparameters = { gain = { value = 4, unit = "K" } }\n'
        '[instances.b]\nfmu = "second.fmu"\nparameters = { gain = 1 }\n'
        '[[connections]]\nfrom = "a.x"\nto = "b.u"\n'
        '[[sources]]\nto = "a.u"\nkind = "constant"\nvalue = 1.0\nunit = "K"\n'
    )
    (joined,) = read_system(tmp_path / "both.toml").connections
    assert (joined.factor, joined.offset) == (1.0, 0.0)
    assert simulate(tmp_path / "both.toml")["b.x"][-1] == pytest.approx(4.0 * 0.5 * 1.125)
