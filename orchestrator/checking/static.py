"""All checks that execute nothing."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.checking import xml_reading
from orchestrator.checking.archive import ArchiveLimits, FmuFiles, open_fmu
from orchestrator.checking.binaries import PLATFORMS, check_binaries
from orchestrator.checking.description import Description
from orchestrator.checking.description_reading import read_description
from orchestrator.checking.findings import Facts, Finding
from orchestrator.checking.layered import ReferenceResult, check_files, check_layered
from orchestrator.checking.rules import declare
from orchestrator.checking.rules_arrays import check_arrays, check_clocks
from orchestrator.checking.rules_model import check_model
from orchestrator.checking.rules_structure import check_structure
from orchestrator.checking.rules_variables import check_variables

declare("""
[description]
model.fmi-version | E | 2.2.1 | 2.4.1 | fmiVersion is 2.0 or 3.0 | write the version of the standard that was used
model.not-covered | W | - | * | the FMU is one of FMI 2.0 or 3.0 | use the tools of that version for the rest
""")

STAGES = ("archive", "xml", "schema", "description", "files", "binaries")
_COVERED = re.compile(r"2\.0|3\.\d+(\.\d+)?")


@dataclass(frozen=True)
class StaticResult:
    """What the static checks found, and what the dynamic ones need.

    Attributes:
        files, description: None when they cannot be read or are of a version that is not covered.
        stages: what was carried out (empty) and what not, with the reason.
        references: reference results fit for comparison.
    """

    findings: list[Finding]
    stages: dict[str, str]
    files: FmuFiles | None = None
    description: Description | None = None
    references: list[ReferenceResult] = field(default_factory=list)
    facts: Facts = field(default_factory=dict)


def check_static(path: Path, limits: ArchiveLimits) -> StaticResult:
    """Check one FMU (file or unpacked folder) without executing anything of it."""
    files, findings = open_fmu(path, limits)
    stages = dict.fromkeys(STAGES, "the archive cannot be read") | {"archive": ""}
    if files is None:
        return StaticResult(findings, stages)
    data = files.read("modelDescription.xml", xml_reading.MAXIMUM_BYTES)
    root, problems = xml_reading.parse(data, "modelDescription.xml")
    findings += problems
    stages = dict.fromkeys(STAGES, "modelDescription.xml cannot be read") | {"archive": "", "xml": ""}
    if root is None:
        return StaticResult(findings, stages, files)
    version = root.get("fmiVersion", "")
    facts: Facts = {"modelName": root.get("modelName", ""), "fmiVersion": version}
    if root.tag != "fmiModelDescription" or not _COVERED.fullmatch(version):
        findings.append(_not_covered(root, version))
        stages = {name: reason and f"FMI {version} is not covered" for name, reason in stages.items()}
        return StaticResult(findings, stages, files, facts=facts)
    description = read_description(root)
    facts |= _facts(description, files)
    findings += xml_reading.check_grammar(root, description.dialect.version)
    findings += _check_description(description)
    findings += check_binaries(description, files)
    findings += check_files(description, files)
    references, problems = check_layered(description, files)
    findings += problems
    return StaticResult(findings, dict.fromkeys(STAGES, ""), files, description, references, facts)


def _check_description(d: Description) -> Iterator[Finding]:
    yield from check_variables(d)
    yield from check_model(d)
    yield from check_structure(d)
    if d.dialect.version == "3.0":
        yield from check_arrays(d)
        yield from check_clocks(d)


def _not_covered(root: "xml_reading.etree._Element", version: str) -> Finding:
    where = xml_reading.xpath(root, "fmiVersion")
    if root.tag != "fmiModelDescription":
        return Finding("schema.invalid", where, f"the root must be <fmiModelDescription>, but is <{root.tag}>")
    if not re.fullmatch(r"1\.0|3\..*", version):
        return Finding("model.fmi-version", where, f"fmiVersion must be 2.0 or 3.0, but is {version!r}")
    message = f"the FMU is one of FMI {version}: only its archive is checked, nothing is run"
    return Finding("model.not-covered", where, message)


def _facts(d: Description, files: FmuFiles) -> Facts:
    names = files.names()
    folders = dict.fromkeys((*PLATFORMS["2.0"], *PLATFORMS["3.0"]))
    return {
        "generationTool": d.root.get("generationTool", ""),
        "interfaces": [i.kind for i in d.interfaces],
        "variables": len(d.variables),
        "platforms": [p for p in folders if any(n.startswith(f"binaries/{p}/") for n in names)],
    }
