"""Model descriptions of FMI 3.0: types, arrays, aliases, dependencies, clocks, and what is refused by name."""

from fractions import Fraction
from pathlib import Path

import pytest

from orchestrator.errors import FmuError
from orchestrator.fmi.access import Access
from orchestrator.fmi.model_description import FmuDescription, parse_description, read_description
from orchestrator.master.protocol import PeriodicClock, TriggeredClock
from tests.support.ball3 import model_description

FLAGS = 'hasEventMode="true" providesIntermediateUpdate="true" canGetAndSetFMUState="true"'


def parsed(variables: str, structure: str = "", flags: str = FLAGS, types: str = "") -> FmuDescription:
    """The description of an FMU with these variables."""
    text = (
        '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="{t}">'
        f'<CoSimulation modelIdentifier="m" {flags}/><TypeDefinitions>{types}</TypeDefinitions>'
        f"<ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )
    return parse_description(text.encode(), "m.fmu")


def test_the_ball_of_the_tests_is_read_with_all_that_it_has() -> None:
    ball = parse_description(model_description().encode(), "ball.fmu")
    variables = ball.model.variables
    assert (ball.version, ball.guid, ball.identifier) == ("3.0", "{ball}", "Ball")
    assert (ball.model.has_events, ball.model.can_save_state, ball.model.can_vary_step) == (True, True, True)
    assert ball.model.inputs_inside_steps == {"u"}
    assert (variables["x"].unit, variables["x"].maximum, variables["x"].start) == ("m", 50.0, 1.0)
    assert [variables[f"p[{n}]"].start for n in (1, 2, 3)] == [1.0, 2.0, 3.0]
    assert [ball.access[f"q[{n}]"] for n in (1, 2, 3)] == [Access("Float64", 9, n, 3) for n in (0, 1, 2)]
    assert (variables["n"].causality, variables["n"].variability) == ("calculatedParameter", "constant")
    assert (variables["height"].causality, ball.access["height"]) == ("local", ball.access["x"])
    assert variables["mode"].items == (("hard", 1), ("soft", 2))
    assert (ball.access["mode"].kind, ball.access["small"].kind, ball.access["big"].kind) == (
        "Int64",
        "Float32",
        "UInt64",
    )
    assert (variables["big"].minimum, variables["bounces"].maximum) == (0, 1000.0)
    assert (variables["label"].start, variables["flag"].start) == ("ball", False)
    assert ball.model.feedthrough == {"x": frozenset(), "bounces": frozenset({"u"})}
    assert dict(ball.model.clocks) == {
        "tick": PeriodicClock(Fraction(1, 10), Fraction(1, 20), ("count", "smooth", "old"), 100)
    }
    assert ball.events.inside == {"u"}
    assert dict(ball.model.output_clocks) == {"hit": 101}
    assert "Binary blob" in ball.left_out
    assert "blob" not in variables


def test_arrays_are_counted_by_rows_and_a_single_start_value_is_that_of_all() -> None:
    found = parsed(
        '<Float64 name="a" valueReference="5" causality="parameter" start="1 2 3 4 5 6"><Dimension start="2"/>'
        '<Dimension start="3"/></Float64>'
        '<Int32 name="b" valueReference="6" causality="input" start="7"><Dimension start="2"/></Int32>'
        '<String name="c" valueReference="7" causality="parameter"><Dimension start="2"/>'
        '<Start value="one two"/><Start value="three"/></String>'
        '<Float64 name="y" valueReference="8" causality="output"><Dimension start="2"/></Float64>',
        '<Output valueReference="8" dependencies="5 6"/>',
    )
    variables = found.model.variables
    assert [n for n in variables if n.startswith("a")] == [f"a[{i},{k}]" for i in (1, 2) for k in (1, 2, 3)]
    assert (variables["a[2,1]"].start, found.access["a[2,1]"]) == (4.0, Access("Float64", 5, 3, 6))
    assert (variables["b[1]"].start, variables["b[2]"].start) == (7, 7)
    assert (variables["c[1]"].start, variables["c[2]"].start) == ("one two", "three")
    assert found.model.feedthrough == dict.fromkeys(("y[1]", "y[2]"), frozenset({"b[1]", "b[2]"}))


def test_defaults_are_those_of_the_standard() -> None:
    found = parsed(
        '<Float32 name="a" valueReference="1" causality="parameter"/><Float64 name="b" valueReference="2"/>'
        '<Int8 name="c" valueReference="3"/><Boolean name="d" valueReference="4" causality="input" start="1"/>'
        '<Float64 name="e" valueReference="5" declaredType="T" min="0"/>',
        types='<Float64Type name="T" unit="m" min="-5" max="5"/>',
    ).model.variables
    kinds = [(v.causality, v.variability) for v in found.values()]
    assert kinds[:3] == [("parameter", "fixed"), ("local", "continuous"), ("local", "discrete")]
    assert (found["c"].minimum, found["c"].maximum, found["d"].start) == (-128, 127, True)
    assert (found["e"].unit, found["e"].minimum, found["e"].maximum) == ("m", 0.0, 5.0)


@pytest.mark.parametrize(
    ("attributes", "interval", "shift"),
    [
        ('intervalVariability="constant" intervalDecimal="0.2"', Fraction(1, 5), Fraction(0)),
        (
            'intervalVariability="constant" supportsFraction="true" resolution="3000" '
            'intervalCounter="1" shiftCounter="2" intervalDecimal="0.00033333"',
            Fraction(1, 3000),
            Fraction(2, 3000),
        ),
        ('intervalVariability="fixed" intervalDecimal="1e-3" shiftDecimal="0.5"', Fraction(1, 1000), Fraction(1, 2)),
        ('intervalVariability="tunable" intervalDecimal="0.125"', Fraction(1, 8), Fraction(0)),
    ],
)
def test_periods_of_clocks_are_exact(attributes: str, interval: Fraction, shift: Fraction) -> None:
    found = parsed(f'<Clock name="c" valueReference="1" causality="input" {attributes}/>')
    assert dict(found.model.clocks) == {"c": PeriodicClock(interval, shift, (), 1)}


@pytest.mark.parametrize("kind", ["fixed", "tunable", "changing", "countdown"])
def test_clocks_whose_times_the_fmu_says_are_not_the_masters(kind: str) -> None:
    found = parsed(f'<Clock name="c" valueReference="1" causality="input" intervalVariability="{kind}"/>')
    assert not found.model.clocks
    assert dict(found.events.timed) == {"c": (1, kind)}


def test_clocks_that_others_trigger_are_not_the_masters() -> None:
    found = parsed(
        '<Clock name="c" valueReference="1" causality="input" intervalVariability="triggered"/>'
        '<Float64 name="x" valueReference="2" causality="input" variability="discrete" start="0" clocks="1"/>'
    )
    assert dict(found.model.triggered) == {"c": TriggeredClock(("x",), 1)}
    assert not found.model.clocks


CLOCK = '<Clock name="c" valueReference="1" causality="input" intervalVariability="{}"/>'


@pytest.mark.parametrize(
    ("variables", "flags", "expected"),
    [
        (CLOCK.format("constant"), FLAGS, "its clock 'c' has the intervalVariability 'constant', but no interval"),
        (CLOCK.format("countdown"), "", r"it has clocks \(c\), but no event mode"),
        (
            CLOCK.format('constant" intervalDecimal="0'),
            FLAGS,
            "the interval of its clock 'c' must be positive, but is 0 s",
        ),
        (
            CLOCK.format('constant" intervalDecimal="1" shiftDecimal="-1'),
            FLAGS,
            "the shift of its clock 'c' must not be negative, but is -1 s",
        ),
        ('<Real name="a" valueReference="1"/>', "", "'a' has the type Real, which FMI 3.0 does not have"),
        ('<Float64 name="a" valueReference="1"><Dimension start="0"/></Float64>', "", "'a' has a dimension of size 0"),
        ('<Float64 name="a" valueReference="1"><Dimension valueReference="9"/></Float64>', "", "must follow FMI 3.0"),
        (
            '<Float64 name="a" valueReference="1"><Dimension start="1000000"/><Dimension start="9"/></Float64>',
            "",
            "must have at most 250000 variables, elements of arrays included, but has more: counted up to 'a'",
        ),
        (
            '<Float64 name="a" valueReference="1" start="1 2"><Dimension start="3"/></Float64>',
            "",
            "'a' has 2 start values for 3 elements",
        ),
        ('<Float64 name="a" valueReference="1"><Alias name="a"/></Float64>', "", "'a' is declared twice"),
        ('<Int8 name="a" valueReference="1" start="1.5"/>', "", "must follow FMI 3.0"),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(variables: str, flags: str, expected: str) -> None:
    with pytest.raises(FmuError, match=expected):
        parsed(variables, flags=flags)


def test_clocks_are_refused_where_event_mode_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "modelDescription.xml").write_text(model_description())
    assert read_description(tmp_path).model.has_events
    with pytest.raises(FmuError, match=r"its clocks \(tick\) tick in event mode, which is not used here"):
        read_description(tmp_path, events=False)
