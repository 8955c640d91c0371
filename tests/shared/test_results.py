"""Result files are what their types say: what a command writes is read back whole, and unknown words are noticed."""

import json

import msgspec
import pytest

import orchestrator as oc
from orchestrator.shared.results import PairFound, SignalsFound, SweepFound, as_plain, read

LOOP = """
stop = 0.05
record = ["plant.theta_l"]
[master]
step = 1e-3
[instances.plant]
fmu = "Drivetrain"
"""


@pytest.mark.parametrize("what", ["pair", "signals", "sweep"])
def test_a_file_is_read_back_as_it_was_made(tmp_path, fmus, what):
    (tmp_path / "loop.toml").write_text(LOOP)
    result, kind = {
        "pair": lambda: (oc.run_pair(alpha=0.02), PairFound),
        "signals": lambda: (oc.simulate(tmp_path / "loop.toml"), SignalsFound),
        "sweep": lambda: (oc.sweep(sizes=[0.02], noise=0.0, workers=1), SweepFound),
    }[what]()
    result.save(tmp_path / "out")
    written = json.loads((tmp_path / "out" / f"{result.command}.json").read_text())["results"]
    found = read(written, kind)
    assert found.schema_version == 1
    assert found == read(json.loads(json.dumps(as_plain(result.results()))), kind)
    assert set(written) == {field.name for field in msgspec.structs.fields(kind)}


def test_what_is_not_of_a_type_is_refused_with_its_place():
    with pytest.raises(ValueError, match=r"Expected `int`, got `str` - at `\$.cases`"):
        read({"cases": "many", "failed": 0}, SweepFound)
