"""All checks that execute nothing."""

from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.checking import xml_reading
from orchestrator.checking.archive import ArchiveLimits, FmuFiles, open_fmu
from orchestrator.checking.binaries import SUFFIXES, check_binaries
from orchestrator.checking.description import Description, read_description
from orchestrator.checking.findings import Facts, Finding
from orchestrator.checking.layered import ReferenceResult, check_files, check_layered
from orchestrator.checking.rules_model import check_model
from orchestrator.checking.rules_variables import check_variables
from orchestrator.checking.schema import check_schema, check_with_fmpy

STAGES = ("archive", "xml", "schema", "description", "files", "binaries")


@dataclass(frozen=True)
class StaticResult:
    """What the static checks found, and what the dynamic ones need.

    Attributes:
        files, description: None when they cannot be read or are not FMI 2.0.
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
    """Check one FMU (file or unpacked folder) without executing anything of it.

    Args:
        path: the FMU's file or folder.
        limits: the most bytes and files that are unpacked.

    Returns:
        Findings, and what the probes need: files, description, reference results, facts.
    """
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
    if version != "2.0":
        findings += _other_version(path, version, root)
        stages = {name: reason and f"FMI {version} is not covered" for name, reason in stages.items()}
        return StaticResult(findings, stages, files, facts=facts)
    findings += check_schema(root)
    description = read_description(root)
    facts |= _facts(description, files)
    findings += check_variables(description)
    findings += check_model(description)
    findings += check_binaries(description, files)
    findings += check_files(files)
    references, problems = check_layered(description, files)
    findings += problems
    if description.cosimulation is None and description.model_exchange is not None:
        where = xml_reading.xpath(root)
        findings.append(Finding("model.no-co-simulation", where, "the FMU has model exchange only: it is not run"))
    if not any(f.severity == "error" for f in findings):
        findings += check_with_fmpy(path, len(description.variables))
    return StaticResult(findings, dict.fromkeys(STAGES, ""), files, description, references, facts)


def _other_version(path: Path, version: str, root: "xml_reading.etree._Element") -> list[Finding]:
    where = xml_reading.xpath(root, "fmiVersion")
    if version != "1.0" and not version.startswith("3."):
        return [Finding("model.fmi-version", where, f"fmiVersion must be 1.0, 2.0 or 3.x, but is {version!r}")]
    message = f"the FMU is one of FMI {version}: only its archive and FMPy's validation are checked, nothing is run"
    return [Finding("model.not-covered", where, message), *check_with_fmpy(path)]


def _facts(d: Description, files: FmuFiles) -> Facts:
    names = files.names()
    return {
        "generationTool": d.root.get("generationTool", ""),
        "interfaces": [i.element.tag for i in d.interfaces],
        "variables": len(d.variables),
        "platforms": [p for p in SUFFIXES if any(n.startswith(f"binaries/{p}/") for n in names)],
    }
