"""What reaches a terminal is one line that steers nothing, and names no folder that is gone by then."""

import zipfile
from pathlib import Path

import pytest

from orchestrator.api.shown import Result, table
from orchestrator.cli import main
from orchestrator.commands._console import print_blocks, print_table
from orchestrator.commands._trust import note
from orchestrator.errors import FmuError
from orchestrator.plain_text import name_folder, plain_text
from orchestrator.scenarios.ssp.read import open_ssp
from orchestrator.shared.scratch import Scratch
from tests.support.c_fmu import build_c_fmu, fmu_files, have_compiler, write_fmu

ODD = "a\nb\r\tc\x07\x1b[2J\x9b31m\u202ed\u2028e\u200bf\ud800"
PLAIN = "a\\nb\\r\\tc\\x07\\x1b[2J\\x9b31m\\u202ed\\u2028e\\u200bf\\ud800"


def steers(text: str) -> list[str]:
    return [c for c in text if not c.isprintable() and c != "\n"]


def test_what_would_steer_a_terminal_is_an_escape() -> None:
    assert plain_text(ODD) == PLAIN
    assert plain_text("two  blanks, é, 漢, N·m") == "two  blanks, é, 漢, N·m"


LONG = ("x" * 70_000, "x y " * 20_000)


@pytest.mark.parametrize("value", LONG)
def test_of_a_long_value_in_a_message_the_middle_is_left_out(value: str, tmp_path: Path, capsys) -> None:
    (tmp_path / "a.toml").write_text(f'kind = "{value}"\n')
    (tmp_path / f"{'long' * 40}.csv").write_text("time\n")
    model = str(tmp_path / "a.toml")
    for words in (
        ["simulate", "--scenario", model], ["estimate", "a.csv", "--model", model], ["simulate", "--alpha", value],
    ):  # fmt: skip
        with pytest.raises(SystemExit, match=r"^2$"):  # by the parser, or by what follows
            raise SystemExit(main(words))
        (line,) = capsys.readouterr().err.splitlines()
        assert len(line) < 2100
        assert line.startswith("error: ")
    error = FmuError(f"{tmp_path}/{'long' * 40}.csv: `kind` must be `a`, but is '{value}': choose")
    assert f"{tmp_path}/{'long' * 40}.csv: `kind` must be `a`, but is 'x" in str(error)
    assert str(error).endswith(": choose")


class Named(Result):
    command = "named"
    results = None

    def blocks(self):
        return [f"Note: {ODD}", table(ODD, ("signal", ODD), ((ODD, ODD),))]


def test_blocks_tables_and_notes_are_plain(capsys) -> None:
    print_blocks([f"Note: {ODD}", table(ODD, ("signal", ODD), ((ODD, "1"),))])
    print_table(plain_text(ODD), ("a",), (("1",),))
    note(ODD)
    said = capsys.readouterr()
    assert steers(said.out + said.err) == []
    assert f"Note: {PLAIN}\n" in said.out
    assert said.err == f"note: {PLAIN}\n"
    for text in (str(Named()), Named()._repr_html_()):
        assert steers(text) == []
        assert text.count(PLAIN) == 5


def test_temporary_folders_have_the_name_of_what_is_in_them() -> None:
    with Scratch("one") as first, Scratch("two") as second:
        name_folder(first.path / "content", "theirs.ssp")
        name_folder(second.path / "x", first.path / "content" / "resources" / "a.fmu")
        text = f"{second.path}/x/binaries/a.so of {first.path}/content/b.ssv"
    assert plain_text(text) == "theirs.ssp/resources/a.fmu/binaries/a.so of theirs.ssp/b.ssv"
    assert str(FmuError(text)) == plain_text(text)


# Names of each kind ---------------------------------------------------------------------------------------------------

C_FMU = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
SCENARIO = """
stop = 0.1
record = ["slave.{name}"]
[master]
algorithm = "jacobi"
step = 0.01
[instances.slave]
fmu = "MassSpring.fmu"
"""
SSD = (
    '<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="p{odd}"><ssd:System name="s">'
    '<ssd:Elements><ssd:Component name="part{odd}" source="{source}"><ssd:Connectors>'
    '<ssd:Connector name="x" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors></ssd:Component></ssd:Elements>'
    '</ssd:System><ssd:DefaultExperiment startTime="0" stopTime="0.1"/></ssd:SystemStructureDescription>'
)
XML_ODD = "&#10;&#13;&#9;&#x9b;31m&#x202e;$^$"


@C_FMU
@pytest.mark.parametrize("what", ["variable", "unit", "model"])
@pytest.mark.parametrize("command", ["simulate", "check"])
def test_names_in_fmus_steer_no_terminal(what: str, command: str, tmp_path: Path, capsys) -> None:
    files = fmu_files()
    text = files["modelDescription.xml"].decode()
    before = {"variable": 'name="x"', "unit": 'name="m"', "model": 'modelName="MassSpring"'}[what]
    assert before in text
    text = text.replace(before, before[:-1] + XML_ODD + '"')
    if what == "unit":
        text = text.replace('unit="m"', f'unit="m{XML_ODD}"')
    write_fmu(tmp_path / "MassSpring.fmu", files | {"modelDescription.xml": text.encode()})
    name = "x\\n\\r\\t\\u009b31m\\u202e$^$" if what == "variable" else "x"
    (tmp_path / "s.toml").write_text(SCENARIO.format(name=name), encoding="utf-8")
    words = ["--scenario", str(tmp_path / "s.toml")] if command == "simulate" else [str(tmp_path / "MassSpring.fmu")]
    main([command, *words, "--out", str(tmp_path / "out")])
    said = capsys.readouterr()
    assert steers(said.out + said.err) == []
    assert said.out + said.err


@C_FMU
def test_names_in_packages_steer_no_terminal_and_name_no_temporary_folder(tmp_path: Path, capsys) -> None:
    fmu = build_c_fmu(tmp_path)
    for source, code in (("part.fmu", 0), ("none.fmu", 2)):
        with zipfile.ZipFile(tmp_path / "p.ssp", "w") as archive:
            archive.writestr("SystemStructure.ssd", SSD.format(odd=XML_ODD, source=source))
            archive.write(fmu, "part.fmu")
        assert main(["ssp", "run", str(tmp_path / "p.ssp"), "--out", str(tmp_path / "out")]) == code
        said = capsys.readouterr()
        assert steers(said.out + said.err) == []
    with zipfile.ZipFile(tmp_path / "p.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", SSD.format(odd="", source="part.fmu"))
        archive.writestr("part.fmu", b"PK no archive")
    with pytest.raises(FmuError, match=r"p.ssp/part.fmu is not") as raised, open_ssp(tmp_path / "p.ssp"):
        pass
    assert "backlash-cosim-" not in str(raised.value)


@C_FMU
def test_a_run_that_fails_in_a_package_names_no_temporary_folder(tmp_path: Path, capsys) -> None:
    fmu = build_c_fmu(tmp_path, "crash_step")
    with zipfile.ZipFile(tmp_path / "p.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", SSD.format(odd="", source="part.fmu"))
        archive.write(fmu, "part.fmu")
    assert main(["ssp", "run", str(tmp_path / "p.ssp"), "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err
    assert "backlash-cosim-" not in said
    assert f"{tmp_path / 'p.ssp'}/part.fmu: " in said


@pytest.mark.parametrize("column", ["theta\x1b[31m_m", "theta\x9b_m", "theta\u202e_m", '"theta\nm"', "theta\x07_m"])
def test_names_of_columns_steer_no_terminal(column: str, tmp_path: Path, capsys) -> None:
    rows = [f"{0.002 * k:.3f},{k % 7 - 3},{0.001 * k * k:.6f}" for k in range(300)]
    (tmp_path / "a.csv").write_text("\n".join([f"time,u,{column}", *rows]), encoding="utf-8")
    main(["inspect", str(tmp_path / "a.csv"), "--out", str(tmp_path / "out")])
    said = capsys.readouterr()
    assert steers(said.out + said.err) == []
