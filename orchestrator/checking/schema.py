"""Validation against the XML schema of FMI 2.0 and by FMPy."""

import functools
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from lxml import etree

from orchestrator.checking.findings import Finding

_SHOWN = 50
_FEW_VARIABLES = 2000


@functools.cache
def _schema() -> etree.XMLSchema:
    path = Path(str(files("fmpy"))) / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
    return etree.XMLSchema(etree.parse(str(path)))


def check_schema(root: etree._Element) -> Iterator[Finding]:
    """Findings of the schema that FMPy ships, one per violation.

    Args:
        root: of modelDescription.xml.

    Yields:
        Each finding.
    """
    schema = _schema()
    if schema.validate(root):
        return
    for error in list(schema.error_log)[:_SHOWN]:
        path = f"modelDescription.xml:{error.path or '/'}"
        yield Finding("schema.invalid", path, error.message)


def check_with_fmpy(path: Path, variables: int = 0) -> Iterator[Finding]:
    """Findings of ``fmpy.validation.validate_fmu``, for what no rule here says already.

    Args:
        variables: their number; FMPy takes a millisecond for each name, so names are left to the rules here when
            there are many.

    Yields:
        Each finding.
    """
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError
    from fmpy.validation import validate_fmu

    problems: list[object]
    try:
        if variables <= _FEW_VARIABLES:
            problems = list(validate_fmu(str(path)))
        else:
            read_model_description(str(path), validate_variable_names=False, validate_model_structure=True)
            problems = []
    except ValidationError as error:
        problems = list(error.problems)
    except Exception as error:  # FMPy raises bare exceptions on input that it did not foresee
        problems = [f"FMPy cannot read the FMU: {error}"]
    for problem in problems:
        yield Finding("schema.fmpy", "modelDescription.xml", " ".join(str(problem).split()))
