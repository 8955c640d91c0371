"""The reference experiment inside an FMU, as the layered standard FMI-LS-REF 1.0.0-alpha.1 describes related files.

The experiment's own format is the Modelica Association's for experiments (XML; it was an appendix of FMI-LS-REF
before it became a specification of its own), its parameter set is SSP's SSV. The results come from
:mod:`tools.reference_runs`, not from the FMU.
"""

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from orchestrator.building.sources import Recipe
from orchestrator.building.stamping import xml_text

DATA = Path(__file__).parent / "data"
FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
LAYERED = "http://fmi-standard.org/fmi-ls-manifest"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
# Parameters of each experiment that differ from the start values, and its communication step [s].
PARAMETERS: Mapping[str, Mapping[str, float]] = {
    "Drivetrain": {"alpha": 0.02},
    "LqrController": {},
    "KalmanEstimator": {},
}
STEPS = {"Drivetrain": 1e-2, "LqrController": 1e-3, "KalmanEstimator": 1e-3}
EXPERIMENT = "Motion against an independent solution"
TOLERANCE = "1e-6"


def reference_files(recipe: Recipe, description: Element) -> dict[str, bytes]:
    """Return members of the archive, none for a variant: its reference would have to be computed for it."""
    path = DATA / f"{recipe.class_name}_reference.csv"
    if recipe.starts or not path.exists():
        return {}
    rows = list(csv.reader(io.StringIO(path.read_text(encoding="ascii"))))
    parameters = PARAMETERS[recipe.class_name]
    causalities = {v.attrib["name"]: v.attrib["causality"] for v in description.iter("ScalarVariable")}
    stimuli = [n for n, name in enumerate(rows[0]) if name == "time" or causalities[name] == "input"]
    files = {
        "fmi-ls-manifest.xml": _manifest(),
        "experiments.xml": _experiments(rows, STEPS[recipe.class_name]),
        "parameters.ssv": _parameter_set(dict(parameters)),
        "stimuli.csv": _lines([[row[n] for n in stimuli] for row in rows]),
        "reference.csv": _lines(_with_parameters(rows, dict(parameters))),
    }
    return {f"{FOLDER}/{name}": data for name, data in files.items()}


def _with_parameters(rows: list[list[str]], parameters: dict[str, float]) -> list[list[str]]:
    """Return the rows with a constant column for each parameter, so that the file says all by itself."""
    extra = [list(parameters), *([repr(value) for value in parameters.values()] for _ in rows[1:])]
    return [[row[0], *more, *row[1:]] for row, more in zip(rows, extra, strict=True)]


def _lines(rows: list[list[str]]) -> bytes:
    return "".join(",".join(row) + "\n" for row in rows).encode("ascii")


def _manifest() -> bytes:
    ElementTree.register_namespace("fmi-ls", LAYERED)
    root = Element(
        "fmiReferences",
        {
            f"{{{LAYERED}}}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            f"{{{LAYERED}}}fmi-ls-version": "1.0.0-alpha.1",
            f"{{{LAYERED}}}fmi-ls-description": "Layered Standard providing information on related files included in "
            "an FMU.",
        },
    )
    related = [
        ("application/x-ma-hs-experiments", "experiments.xml", "experiment/validation", EXPERIMENT),
        ("application/x-ssp-parameter-set", "parameters.ssv", "parameter", "Parameters of the experiment"),
        ("text/csv", "stimuli.csv", "other", "Inputs of the experiment, each row held until the next"),
        ("text/csv", "reference.csv", "result", "Result of the experiment, computed without this FMU"),
        ("text/html", "../../documentation/index.html", "document", "Equations, parameters and interface"),
    ]
    for kind, source, role, text in related:
        SubElement(root, "Related", {"type": kind, "source": source, "role": role, "description": text})
    return xml_text(root)


def _experiments(rows: list[list[str]], step: float) -> bytes:
    root = Element("Experiments", {"name": "Reference", "description": "What this FMU must reproduce"})
    attributes = {
        "name": EXPERIMENT,
        "startTime": rows[1][0],
        "stopTime": rows[-1][0],
        "stepSize": repr(step),
        "tolerance": TOLERANCE,
    }
    experiment = SubElement(root, "Experiment", attributes)
    SubElement(experiment, "Parameters", {"source": "parameters.ssv"})
    SubElement(experiment, "Stimuli", {"source": "stimuli.csv"})
    SubElement(experiment, "References", {"source": "reference.csv"})
    return xml_text(root)


def _parameter_set(parameters: dict[str, float]) -> bytes:
    ElementTree.register_namespace("ssv", SSV)
    root = Element(f"{{{SSV}}}ParameterSet", {"version": "1.0", "name": "Reference experiment"})
    entries = SubElement(root, f"{{{SSV}}}Parameters")
    for name, value in parameters.items():
        SubElement(SubElement(entries, f"{{{SSV}}}Parameter", {"name": name}), f"{{{SSV}}}Real", {"value": repr(value)})
    return xml_text(root)
