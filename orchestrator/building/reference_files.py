"""The reference experiment inside an FMU, as the layered standard FMI-LS-REF 1.0.0-alpha.1 describes related files.

One table says it all: parameters, inputs and results over time. The results come from :mod:`tools.reference_runs`, not
from the FMU.
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
# Parameters of each experiment that differ from the start values.
PARAMETERS: Mapping[str, Mapping[str, float]] = {
    "Drivetrain": {"alpha": 0.02},
    "LqrController": {},
    "KalmanEstimator": {},
}


def reference_files(recipe: Recipe) -> dict[str, bytes]:
    """Return members of the archive, none for a variant: its reference would have to be computed for it."""
    path = DATA / f"{recipe.class_name}_reference.csv"
    if recipe.starts or not path.exists():
        return {}
    rows = list(csv.reader(io.StringIO(path.read_text(encoding="ascii"))))
    parameters = PARAMETERS[recipe.class_name]  # each is a constant column, so that the file says all by itself
    extra = [list(parameters), *([repr(value) for value in parameters.values()] for _ in rows[1:])]
    table = "".join(",".join([row[0], *more, *row[1:]]) + "\n" for row, more in zip(rows, extra, strict=True))
    return {f"{FOLDER}/fmi-ls-manifest.xml": _manifest(), f"{FOLDER}/reference.csv": table.encode("ascii")}


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
        ("text/csv", "reference.csv", "result", "Result of the experiment, computed without this FMU"),
        ("text/html", "../../documentation/index.html", "document", "Equations, parameters and interface"),
    ]
    for kind, source, role, text in related:
        SubElement(root, "Related", {"type": kind, "source": source, "role": role, "description": text})
    return xml_text(root)
