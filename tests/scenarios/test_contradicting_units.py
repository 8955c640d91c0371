"""A value or a connection is refused where a description contradicts the name of a unit, and the cure works."""

from pathlib import Path

import pytest

from orchestrator.api.simulate import simulate
from orchestrator.errors import ScenarioError
from tests.support.c_fmu import fmu_files, have_compiler, write_fmu

pytestmark = pytest.mark.skipif(not have_compiler(), reason="the FMUs are built with a C compiler")
SCENARIO = """stop = 0.1
record = ["n.stiffness"]
[master]
step = 0.05
[instances.n]
fmu = "a.fmu"
[instances.n.parameters]
stiffness = {value}
"""


def scenario(folder: Path, base: str, value: str, name: str = "radian") -> Path:
    """The stiffness is given another unit, for its value goes through unchanged."""
    files = fmu_files()
    xml = files["modelDescription.xml"].decode()
    xml = xml.replace("<UnitDefinitions>", f'<UnitDefinitions><Unit name="{name}"><BaseUnit {base}/></Unit>')
    xml = xml.replace('unit="N/m" start="40"', f'unit="{name}" start="40"')
    write_fmu(folder / "a.fmu", files | {"modelDescription.xml": xml.encode()})
    path = folder / "run.toml"
    path.write_text(SCENARIO.format(value=value))
    return path


@pytest.mark.parametrize(
    ("name", "base", "given", "stated", "right"),
    [
        ("radian", 'rad="0"', "deg", "rad=0", "rad=1"),
        ("rad/s", 's="-1"', "deg/s", "rad=0", "rad=1"),
        ("N.m", 'kg="1" m="1" s="-2"', "kN.m", "m=1", "m=2"),
        ("mm", "", "m", "m=0", "m=1"),
        ("deg", 'm="1"', "rad", "m=1 rad=0", "m=0 rad=1"),
    ],
)
def test_the_unit_is_named_and_both_cures_work(
    tmp_path: Path, name: str, base: str, given: str, stated: str, right: str
) -> None:
    path = scenario(tmp_path, base, f'{{ value = 2.0, unit = "{given}" }}', name)
    with pytest.raises(ScenarioError) as caught:
        simulate(path)
    wanted = f"the FMU's BaseUnit of `{name}` has {stated}, where its name means {right}: correct that in its"
    assert wanted in str(caught.value)
    assert f"or give a plain number, in {name}" in str(caught.value)
    assert simulate(scenario(tmp_path, base, "2.0", name))["n.stiffness"][0] == 2.0


def test_a_description_that_is_right_is_not_blamed(tmp_path: Path) -> None:
    path = scenario(tmp_path, 'rad="1"', '{ value = 180.0, unit = "deg" }')
    assert simulate(path)["n.stiffness"][0] == pytest.approx(3.141592653589793)
    with pytest.raises(ScenarioError, match="measures what radian does, but is in 'mm'") as caught:
        simulate(scenario(tmp_path, 'rad="1"', '{ value = 180.0, unit = "mm" }'))
    assert "BaseUnit" not in str(caught.value)
