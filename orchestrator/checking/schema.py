"""Validation against the XML schema of FMI 2.0 and by FMPy."""

import functools
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from lxml import etree

from orchestrator.checking.findings import Finding

_SHOWN = 50


@functools.cache
def _schema() -> etree.XMLSchema:
    path = Path(str(files("fmpy"))) / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
    return etree.XMLSchema(etree.parse(str(path)))


def check_schema(root: etree._Element) -> Iterator[Finding]:
    """Findings of the schema that FMPy ships, one per violation."""
    schema = _schema()
    if schema.validate(root):
        return
    for error in list(schema.error_log)[:_SHOWN]:
        path = f"modelDescription.xml:{error.path or '/'}"
        yield Finding("schema.invalid", path, error.message)


def check_with_fmpy(path: Path) -> Iterator[Finding]:
    """Findings of ``fmpy.validation.validate_fmu``, for what no rule here says already."""
    from fmpy.validation import validate_fmu

    try:
        problems = validate_fmu(str(path))
    except Exception as error:  # FMPy raises bare exceptions on input that it did not foresee
        problems = [f"FMPy cannot read the FMU: {error}"]
    for problem in problems:
        yield Finding("schema.fmpy", "modelDescription.xml", " ".join(str(problem).split()))
