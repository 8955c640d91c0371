"""FMUs that are legal but unusual have no finding: what few tools write is no fault."""

import sys
from pathlib import Path

import pytest

from orchestrator.checking.binaries import here
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.shared.isolation.limits import Limits
from tests.support.c_fmu import SUFFIX, have_compiler, write_fmu
from tests.support.plant import compile_plant, describe

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
TUNABLE = '"parameter" variability="tunable" initial="exact"'
EXPERIMENT = '<DefaultExperiment startTime="0" stopTime="1.5" stepSize="0.03"/>'
CATEGORIES = '<LogCategories><Category name="logStatusError"/><Category name="logAll"/></LogCategories>'
ALIAS = (
    '<ScalarVariable name="y of old" valueReference="10" causality="local" variability="continuous" '
    'initial="calculated"><Real/></ScalarVariable>\n  </ModelVariables>'
)
BESIDE = '></Float64>\n<Float64 name="z"'
BEFORE = [('startTime="0"', 'startTime="-7.5"'), ('stopTime="1.5"', 'stopTime="-6"')]
NO_INPUTS = {
    "Output y": "x",
    "Output o": "",
    "Derivative der(v)": "x v",
    "Derivative der(q)": "",
    "Derivative kinds der(q)": "",
}
UNTOLD = {f"Output {name}": "-" for name in ("x", "q", "y", "z", "ys", "o", "g", "sw", "t", "blob")}
ONE_VALUE = {"attributes w": 'start="0" min="0" max="0"', "attributes i": 'start="2" min="2" max="2"'}
# Version, interfaces, changes of the description by their names, and by their texts.
CASES: dict[str, tuple[str, str, dict[str, str], list[tuple[str, str]]]] = {
    "no inputs": (
        "2.0",
        "CS",
        NO_INPUTS,
        [(f'"input" variability="{k}"', TUNABLE) for k in ("continuous", "discrete")],
    ),
    "negative start time": ("2.0", "CS ME", {}, BEFORE),
    "negative start time, 3": ("3.0", "CS ME", {}, BEFORE),
    "aliases": ("2.0", "CS", {}, [("  </ModelVariables>", ALIAS)]),
    "aliases, 3": ("3.0", "ME", {}, [(BESIDE, BESIDE.replace(">", '><Alias name="y&#233;"/>', 1))]),
    "names of any letters": (
        "2.0",
        "CS",
        {},
        [('name="x"', 'name="положение, 位置"'), ('name="w"', 'name="a b.c[0]"')],
    ),
    "names of any letters, 3": ("3.0", "CS", {}, [('name="x"', 'name="положение [mm] 位置 🙂"')]),
    "min is max": ("2.0", "CS", ONE_VALUE, []),
    "min is max, 3": ("3.0", "ME", ONE_VALUE, []),
    "no dependencies told": ("3.0", "CS", UNTOLD, []),
    "no stop time": ("2.0", "CS", {}, [(' stopTime="1.5"', "")]),
    "no experiment": ("3.0", "CS", {}, [(EXPERIMENT, "")]),
    "no log categories": ("3.0", "CS", {}, [(CATEGORIES, "")]),
    "steps of one size": ("2.0", "CS", {"fixed steps": ""}, []),
}


AT_NIGHT = ("negative start time, 3", "names of any letters", "min is max, 3")  # by day in the other version


@pytest.mark.parametrize("case", [pytest.param(c, marks=pytest.mark.night if c in AT_NIGHT else ()) for c in CASES])
def test_a_legal_fmu_is_clean(case: str, tmp_path: Path) -> None:
    version, interfaces, changes, texts = CASES[case]
    description = describe(version, interfaces, {"stop": "1.5"} | changes)
    for old, new in texts:
        assert old in description
        description = description.replace(old, new)
    path = write_fmu(
        tmp_path / "plant.fmu",
        {
            "modelDescription.xml": description.encode(),
            f"binaries/{here(version)}/Plant{SUFFIX}": compile_plant(version),
            "documentation/index.html": b"<!DOCTYPE html><title>Plant</title><p>A plant.</p>\n",
            "documentation/licenses/license.txt": b"free\n",
        },
    )
    report = check_fmu(path, CheckOptions(limits=Limits(time=10.0)))
    assert report.findings == ()
    assert report.executed
