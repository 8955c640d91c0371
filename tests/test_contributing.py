"""The recipes of CONTRIBUTING.md, carried out on a copy of the sources: at most three files each, and they work."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.copies import copy_project
from tests.support.example_record import copy_examples

ROOT = Path(__file__).resolve().parents[1]
MOST_FILES = 3
PROGRAMS = {
    "A backlash model": (
        """
import numpy as np
import orchestrator as oc
from pyfmu_sources.drivetrain.equations import parameters
from pyfmu_sources.drivetrain.equations import shaft_stiffness

pair = oc.run_pair(alpha=0.02, backlash_model="series")
print(pair.crossings > 0, pair.machine["contact"].min(), round(shaft_stiffness(parameters(backlash_model=6.0)), 6))
twist = pair.machine["theta_m"] / 3.984 - pair.machine["theta_l"]
free = pair.machine["contact"] == 0
print(np.abs(twist[free]).max() <= 0.02 + 1e-9, np.abs(pair.machine["T_shaft"][free]).max())
""",
        ["True", "-1.0", "3000.0", "True", "0.0"],
    ),
    "An estimator": (
        """
import orchestrator as oc

gap = oc.estimate("docs/examples/machine.csv", method="twist_range")
found = gap.methods[0].estimate
low, high = found.interval
print(found.method, 0.005 < found.alpha < 0.05, 0.0 < low < found.alpha < high < 0.1)
""",
        ["twist_range", "True", "True"],
    ),
    "A command": (
        """
from orchestrator.cli import main

print(main(["units"]))
""",
        ["0"],
    ),
    "A check rule": (
        """
from pathlib import Path
from orchestrator.checking.check import CheckOptions, check_fmu
from tools import rules_page

TEXT = '<fmiModelDescription fmiVersion="2.0" modelName="a" guid="b"{}><CoSimulation modelIdentifier="a"/>' + (
    "<ModelVariables/><ModelStructure/></fmiModelDescription>"
)
for text in ("", ' description=" "', ' description="A motor."'):
    Path("fmu").mkdir(exist_ok=True)
    Path("fmu", "modelDescription.xml").write_text(TEXT.format(text))
    report = check_fmu(Path("fmu"), CheckOptions(static=True))
    print([(f.rule, f.severity) for f in report.findings if f.rule == "model.description"] == [
        ("model.description", "info")
    ])
print(rules_page.page().count("`model.description`"))
""",
        ["True", "True", "False", "1"],
    ),
    "A master algorithm": (
        """
import math
from pathlib import Path
from orchestrator.master.algorithms import ALGORITHMS
from orchestrator.master.session import Session
from orchestrator.master.system import Connection, System
from orchestrator.scenarios.scenario import load_scenario
from tests.support.mock_slave import instance, model, variable

text = Path("docs/examples/loop.toml").read_text()
Path("alternating.toml").write_text(text.replace("gauss_seidel", "alternating"))
print(load_scenario(Path("alternating.toml")).algorithm == ALGORITHMS["alternating"](1e-3))

def oscillator(sign, start):
    kind = model("integrator", variable("u", "input"), variable("y", "output", start=start))
    return kind, lambda values, time, step: values.update(y=values["y"] + sign * step * values["u"])

system = System(
    (instance("a", *oscillator(1.0, 1.0)), instance("b", *oscillator(-1.0, 0.0))),
    (Connection("b.y", "a.u"), Connection("a.y", "b.u")),
)
for name in ("gauss_seidel", "alternating"):
    errors = []
    for step in (0.1, 0.05):
        with Session(system, ("a.y",), ALGORITHMS[name](step), 2.0) as session:
            errors.append(abs(session.run()["a.y"][-1] - math.cos(2.0)))
    print(round(math.log2(errors[0] / errors[1])))
""",
        ["True", "1", "2"],
    ),
    "A field of a result": (
        """
import json
from pathlib import Path
import orchestrator as oc
from orchestrator.reporting import report_from_directory

log = Path("docs/examples/machine.csv")
log.write_text("".join(log.read_text().splitlines(keepends=True)[:401]))
found = oc.inspect(log)
found.save("out")
(told,) = {row["median"] for row in json.loads(Path("out/inspect.json").read_text())["results"]["channels"][:1]}
page = next(s for s in report_from_directory(Path("out")).all_sections() if s.title == "Channels")
print(told == found.channels[0].median == page.rows[0][-1], page.columns[-1].name)
print("median" in str(found).split("Channels")[1].splitlines()[1])
""",
        ["True", "median", "True"],
    ),
    "A page": (
        """
from pathlib import Path
from orchestrator.reporting import report_from_directory, write_report
from orchestrator.shared.output import write_result

write_result(Path.cwd(), "build", {}, None, {"fmus": {"Gear": "fmus/Gear.fmu"}, "remark": "no compiler"})
report = report_from_directory(Path.cwd())
print(report.sections[0].rows == (("Gear", "fmus/Gear.fmu"),), "no compiler" in write_report(Path.cwd()).read_text())
print(report.summary)
""",
        ["True", "True", "1", "FMUs", "are", "up", "to", "date."],
    ),
}


def recipe(title):
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", page, re.MULTILINE | re.DOTALL)[1]
    return re.findall(r"```python\n(.*?)```", section, re.DOTALL)


def apply(edit, root):
    """Make one edit: its first line says where, and what follows is inserted there, or is the file."""
    head, _, text = edit.partition("\n")
    match = re.fullmatch(r'# ([\w/.]+)(?:: (?:(at the end)|after "(.*)"))?', head)
    assert match, head
    path = root / match[1]
    if match[2] is None and match[3] is None:
        assert not path.exists(), path
        path.write_text(text, encoding="utf-8")
        return match[1]
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    after = [n for n, line in enumerate(lines) if match[3] is not None and match[3].lower() in line.lower()]
    at = after[0] + 1 if after else len(lines)
    assert after or match[2], f"{match[1]} has no line with {match[3]!r}"
    if lines[at - 1].rstrip().endswith("import ("):  # an import over several lines: before it
        at -= 1
    lines.insert(at, text)
    path.write_text("".join(lines), encoding="utf-8")
    return match[1]


def test_the_tests_of_every_recipe_are_named_and_there():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| (an? [\w ]+) \| (.+) \|$", page, re.MULTILINE))
    assert rows.keys() == {"an effect", "a plant", *(title[0].lower() + title[1:] for title in PROGRAMS)}
    for row in rows.values():
        named = re.findall(r"`(tests/[\w/.]+)(?: -k (\w+))?`", row)
        assert len(named) >= 2, row
        for path, words in named:
            assert (ROOT / path).exists(), path
            assert not words or any(words in title.lower() for title in PROGRAMS), words


@pytest.mark.slow
@pytest.mark.parametrize("title", PROGRAMS)
def test_a_recipe_works_on_a_copy(tmp_path, title):
    copy_project(tmp_path)
    shutil.copytree(ROOT / "tools", tmp_path / "tools", ignore=shutil.ignore_patterns("__pycache__"))
    copy_examples(tmp_path / "docs" / "examples")
    edits = recipe(title)
    assert edits
    touched = {apply(edit, tmp_path) for edit in edits}
    assert len(touched) <= MOST_FILES
    program, expected = PROGRAMS[title]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    assert run.stdout.split()[-len(expected) :] == expected
    if title == "A command":
        assert "J_m" in run.stdout
        assert "kg.m2" in run.stdout
