"""Terminals of FMUs of FMI 3.0: joined in one line of a scenario, with what does not match named."""

import shutil
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.building.compilers import find_compiler
from orchestrator.errors import ConnectionMismatchError, FmuError, ScenarioError
from orchestrator.fmi.terminals import FILE, Joint, Member, Terminal, TerminalEnd, join_terminals, read_terminals
from orchestrator.master.protocol import ModelInterface, Unit, Variable
from orchestrator.master.system import Connection
from orchestrator.scenarios.scenario import Scenario, load_scenario, simulate

UNITS = {
    "rad": Unit("rad", (0, 0, 0, 0, 0, 0, 0, 1)),
    "deg": Unit("deg", (0, 0, 0, 0, 0, 0, 0, 1), 0.0174532925199433),
    "N.m": Unit("N.m", (1, 2, -2, 0, 0, 0, 0, 0)),
}


def end(name: str, variables: list[Variable], own: list[tuple[str, str, str]], **kind: object) -> TerminalEnd:
    model = ModelInterface(name, {v.name: v for v in variables}, UNITS)
    terminal = Terminal("plug", "", tuple(Member(*member) for member in own), {})
    return TerminalEnd(f"{name}.t", name, model, replace(terminal, **kind))


def motor(**kind: object) -> TerminalEnd:
    variables = [Variable("phi", "output", unit="rad"), Variable("T", "input", unit="N.m")]
    return end("a", variables, [("angle", "phi", "signal"), ("torque", "T", "outflow")], **kind)


def load(flow: str = "inflow", unit: str = "deg", **kind: object) -> TerminalEnd:
    variables = [Variable("q", "input", unit=unit), Variable("M", "output", unit="N.m")]
    return end("b", variables, [("torque", "M", flow), ("angle", "q", "signal")], **kind)


def test_members_are_matched_by_name_in_both_directions_and_flows_add_up_to_zero() -> None:
    assert join_terminals(motor(), load()) == ([Joint("a.phi", "b.q", 1.0), Joint("b.M", "a.T", 1.0)], [])
    assert join_terminals(load("outflow"), motor())[0] == [Joint("b.M", "a.T", -1.0), Joint("a.phi", "b.q", 1.0)]


def test_a_sequence_is_matched_by_order_a_bus_takes_what_both_have() -> None:
    by_order = load(members=(Member("", "q", "signal"), Member("", "M", "inflow")), rule="sequence")
    assert join_terminals(motor(rule="sequence"), by_order)[0] == [Joint("a.phi", "b.q", 1.0), Joint("b.M", "a.T", 1.0)]
    some = motor(rule="bus", members=(Member("angle", "phi", "signal"), Member("more", "T", "outflow")))
    assert join_terminals(some, load(rule="bus")) == ([Joint("a.phi", "b.q", 1.0)], [])


def test_arrays_and_terminals_within_terminals() -> None:
    x = end("a", [Variable(f"x[{k}]", "output") for k in (1, 2)], [("x", "x", "signal")])
    y = end("b", [Variable(f"y[{k}]", "input") for k in (1, 2)], [("x", "y", "signal")])
    expected = [Joint("a.x[1]", "b.y[1]", 1.0), Joint("a.x[2]", "b.y[2]", 1.0)]
    assert join_terminals(x, y) == (expected, [])
    outer = [replace(e, terminal=Terminal("plug", "", (), {"inner": e.terminal})) for e in (x, y)]
    assert join_terminals(*outer) == (expected, [])


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (motor(), load(unit="N.m"), "must have units that measure the same, but a.phi has rad and b.q has N.m"),
        (motor(), load("signal"), "member torque must be of one kind, but a.T is outflow and b.M is signal"),
        (motor(), motor(), "member angle must be an output of one and an input of the other, but a.phi is"),
        (motor(), load(rule="sequence"), "must both have the matchingRule sequence, or plug or bus, but have plug"),
        (motor(rule="none"), load(), "but have none"),
        (motor(kind="x.y"), load(kind="x.z"), "must have the same terminalKind, but have 'x.y' (a.t) and 'x.z' (b.t)"),
        (
            motor(),
            load(members=(Member("angel", "q", "signal"), Member("torque", "M", "inflow"))),
            "must both have the member angle of the plug a.t, but b.t has not; did you mean 'angel'?",
        ),
        (
            motor(members=(Member("angle", "psi", "signal"),), rule="bus"),
            load(rule="bus"),
            "member angle of a.t must be a variable that can be connected, but a.psi is none",
        ),
        (
            motor(rule="sequence"),
            load(rule="sequence", members=(Member("", "q", "signal"),)),
            "must have as many members in both terminals, but have 2 (a.t) and 1 (b.t)",
        ),
    ],
)  # fmt: skip
def test_what_does_not_match_is_named(first: TerminalEnd, second: TerminalEnd, expected: str) -> None:
    problems = join_terminals(first, second)[1]
    assert expected in problems[0]


# Scenario files ---------------------------------------------------------------------------------------------------

needs_compiler = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")
JOINED = '[[terminals]]\njoin = ["motor.shaft", "load.shaft"]\n'
ONE_BY_ONE = "".join(
    f'[[connections]]\nfrom = "{a}.{v}"\nto = "{b}.{v}"\n'
    for a, b, v in (("motor", "load", "theta_m"), ("motor", "load", "omega_m"), ("load", "motor", "T_shaft"))
)


@pytest.fixture(scope="module")
def halves(tmp_path_factory: pytest.TempPathFactory, build_native: Callable[..., dict[str, Path]]) -> Path:
    folder = tmp_path_factory.mktemp("halves")
    for path in build_native(["MotorHalf", "LoadHalf"], fmi=3).values():
        shutil.copy(path, folder)
    return folder


def loaded(folder: Path, lines: str) -> Scenario:
    path = folder / "halves.toml"
    path.write_text(
        'stop = 0.2\nrecord = ["motor.theta_m", "load.theta_l"]\n[master]\nstep = 1e-3\nalgorithm = "iterated"\n'
        '[instances.motor]\nfmu = "MotorHalf.fmu"\n[instances.load]\nfmu = "LoadHalf.fmu"\n'
        '[[sources]]\nto = "motor.u"\nkind = "constant"\nvalue = 20.0\n' + lines
    )
    return load_scenario(path)


@needs_compiler
def test_one_line_is_the_same_run_as_three(halves: Path) -> None:
    joined, apart = loaded(halves, JOINED), loaded(halves, ONE_BY_ONE)
    assert set(joined.system.connections) == set(apart.system.connections)
    assert joined.system.connections[0] == Connection("motor.theta_m", "load.theta_m")
    assert simulate(joined).values.tobytes() == simulate(apart).values.tobytes()


@needs_compiler
@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (JOINED.replace("load.shaft", "load.shift"), r"terminals\[0\].join: .*'shift' is none; it has shaft, encoder"),
        (JOINED.replace("load.shaft", "lode.shaft"), "there is no instance 'lode'; did you mean 'load'"),
        (JOINED.replace("load.shaft", "load.encoder"), "must both have the member speed of the plug motor.shaft"),
        (JOINED + JOINED, "must join a terminal with flows once, but motor.shaft is joined at"),
        (JOINED + ONE_BY_ONE, "must be fed once"),
        (JOINED.replace(', "load.shaft"', ""), r"\$.terminals\[0\].join"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_file_is_named(halves: Path, lines: str, expected: str) -> None:
    with pytest.raises((ScenarioError, ConnectionMismatchError), match=expected):
        loaded(halves, lines)


def test_files_without_or_with_broken_terminals(tmp_path: Path) -> None:
    path = tmp_path / "a.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", "<a/>")
    assert read_terminals(path) == {}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            FILE, "<fmiTerminalsAndIcons><Terminals><Terminal name='a'/></Terminals></fmiTerminalsAndIcons>"
        )
    with pytest.raises(FmuError, match=r"must follow FMI 3\.0, but does not: 'matchingRule'"):
        read_terminals(path)
