"""The reference experiment inside each FMU: recomputed independently, and reproduced by the FMU."""

import csv
import io
import itertools
import posixpath
from pathlib import Path

import pytest
from lxml import etree

from orchestrator.building import build
from orchestrator.building.archive import read_archive
from orchestrator.building.launcher import find_toolchain
from orchestrator.building.reference_files import DATA, FOLDER, PARAMETERS
from orchestrator.building.starts import default_starts
from tests.support.fmu_calls import OK, RawFmu
from tools.reference_runs import design_starts, reference_run

NAMES = tuple(PARAMETERS)
LAYERED = "{http://fmi-standard.org/fmi-ls-manifest}"


def stored(name: str) -> list[dict[str, float]]:
    text = (DATA / f"{name}_reference.csv").read_text(encoding="ascii")
    return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(io.StringIO(text))]


@pytest.mark.parametrize("name", NAMES)
def test_the_stored_reference_is_what_the_independent_solution_gives(name: str) -> None:
    for row, again in zip(stored(name), reference_run(name), strict=True):
        assert row == pytest.approx(again, rel=1e-9, abs=1e-9)


def test_stored_start_values_are_those_of_the_design() -> None:
    """Within what the Riccati solvers of two machines differ by."""
    for name, values in design_starts().items():
        assert default_starts(name) == pytest.approx(values, rel=1e-6, abs=1e-12)


@pytest.mark.skipif(find_toolchain().compiler is None, reason="no C compiler")
@pytest.mark.parametrize("name", NAMES)
def test_the_fmu_reproduces_its_reference(fmus: dict[str, Path], name: str) -> None:
    """Well inside what the integrator of the reference allows, also at the rows between which contacts change."""
    fmu, rows = RawFmu(fmus[name]), stored(name)
    root = etree.parse(fmu.folder / "modelDescription.xml").getroot()
    variables = {v.get("name"): v for v in root.iterfind("ModelVariables/ScalarVariable")}
    inputs = [n for n in rows[0] if n in variables and variables[n].get("causality") == "input"]
    outputs = [n for n in rows[0] if n in variables and n not in inputs and variables[n][0].tag == "Real"]
    scale = {n: max(1.0, *(abs(row[n]) for row in rows)) for n in outputs}
    c = fmu.instantiate()
    assert c is not None
    assert fmu.set_real(c, list(PARAMETERS[name]), list(PARAMETERS[name].values())) == OK
    assert fmu.set_real(c, inputs, [rows[0][n] for n in inputs]) == OK
    assert fmu.setup(c) == OK
    assert fmu.library.fmi2EnterInitializationMode(c) == OK
    assert fmu.library.fmi2ExitInitializationMode(c) == OK
    worst = 0.0
    for row, following in zip(rows, [*rows[1:], None], strict=True):
        status, values = fmu.get_real(c, outputs)
        assert status == OK
        worst = max(worst, *(abs(v - row[n]) / scale[n] for n, v in zip(outputs, values, strict=True)))
        if following is not None:
            assert fmu.set_real(c, inputs, [row[n] for n in inputs]) == OK
            assert fmu.step(c, row["time"], following["time"] - row["time"]) == OK
    assert worst < 2e-9
    fmu.library.fmi2FreeInstance(c)


def test_the_plant_s_reference_crosses_the_gap() -> None:
    contacts = [row["contact"] for row in stored("Drivetrain")]
    assert {-1.0, 0.0, 1.0} == set(contacts)
    assert sum(a != b for a, b in itertools.pairwise(contacts)) >= 5


@pytest.mark.parametrize("name", NAMES)
def test_the_manifest_names_files_that_are_there(fmus: dict[str, Path], name: str) -> None:
    members = read_archive(fmus[name])
    manifest = etree.fromstring(members[f"{FOLDER}/fmi-ls-manifest.xml"])
    assert manifest.get(f"{LAYERED}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    for related in manifest.iterfind("Related"):
        assert posixpath.normpath(posixpath.join(FOLDER, related.get("source", ""))) in members
    rows = list(csv.DictReader(members[f"{FOLDER}/reference.csv"].decode().splitlines()))
    assert [float(row["time"]) for row in rows] == [row["time"] for row in stored(name)]
    for parameter, value in PARAMETERS[name].items():
        assert {row[parameter] for row in rows} == {repr(value)}


@pytest.mark.parametrize("name", NAMES)
def test_every_variable_is_on_the_documentation_page(fmus: dict[str, Path], name: str) -> None:
    members = read_archive(fmus[name])
    page = members["documentation/index.html"].decode()
    for variable in etree.fromstring(members["modelDescription.xml"]).iterfind("ModelVariables/ScalarVariable"):
        assert f"<code>{variable.get('name')}</code>" in page
    assert members["model.png"].startswith(b"\x89PNG")
    assert members["documentation/licenses/license.txt"] == (build.ROOT / "LICENSE").read_bytes()


def test_a_variant_has_no_reference_that_is_not_its_own(tmp_path: Path) -> None:
    variant = build.build_variant("Drivetrain_soft", start_values={"k": 1000.0}, directory=tmp_path)
    assert not [member for member in read_archive(variant) if member.startswith("extra/")]
