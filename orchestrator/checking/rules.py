"""Rules that a finding can name: where the standard has them, how bad they are, what is expected, and what to do.

A rule stands in the module that judges it: a line of the text that the module hands to ``declare``, below a heading
with the stage of the check. The columns:

    name | severity | FMI 2.0 | FMI 3.0 | what must hold | advice

The column of a version holds the section of its text (2.0.4 and 3.0.2), `*` for a rule that is not the standard's but
of use for FMUs of this version, or `-` where the rule does not apply. ``catalogue`` has them all, in order;
docs/rules.md shows them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "info"]
Version = Literal["2.0", "3.0"]
VERSIONS: tuple[Version, ...] = ("2.0", "3.0")
TEXTS: Mapping[Version, str] = {"2.0": "2.0.4", "3.0": "3.0.2"}
"""The release of the standard's text that the sections belong to, by version."""

_SEVERITIES: dict[str, Severity] = {"E": "error", "W": "warning", "I": "info"}
_PLACES = {
    "2.0": "https://github.com/modelica/fmi-standard/releases/download/v2.0.4/FMI-Specification-2.0.4.pdf",
    "3.0": "https://fmi-standard.org/docs/3.0.2/",
}
# What the headings of the text of 3.0.2 that rules name are called in its address; 2.0.4 is a PDF without names.
_HEADINGS = {
    "2.2.1": "_requirements_for_implementations_of_the_c_api",
    "2.2.4": "status-returned-by-functions",
    "2.2.5": "inquire-version-number",
    "2.2.7.2": "get-and-set-variable-values",
    "2.2.7.3": "min-max-violations",
    "2.2.7.4": "get-set-fmu-state",
    "2.2.8.2": "clock-types",
    "2.2.8.3": "clocked-variable",
    "2.2.8.4": "_clocks_specific_api",
    "2.2.11": "partial-derivatives",
    "2.3": "common-state-machine",
    "2.3.1": "FMUStateSettable",
    "2.3.2": "Instantiated",
    "2.3.3": "InitializationMode",
    "2.3.5": "EventMode",
    "2.3.6": "ConfigurationMode",
    "2.3.8": "Terminated",
    "2.4": "modelDescription.xml",
    "2.4.1": "fmiModelDescription",
    "2.4.2": "common-capability-flags",
    "2.4.3": "_physical_units",
    "2.4.4": "definition-of-types",
    "2.4.5": "definition-of-log-categories",
    "2.4.6": "DefaultExperiment",
    "2.4.7.2": "Dimension",
    "2.4.7.4": "_variable_attributes",
    "2.4.7.5": "_type_specific_properties",
    "2.4.7.5.1": "namingSection",
    "2.4.8": "ModelStructure",
    "2.4.9": "fmiTerminalsAndIcons",
    "2.4.9.1": "graphicalRepresentation",
    "2.4.9.2": "definitionOfTerminals",
    "2.4.10": "BuildConfiguration",
    "2.5.1": "structure-of-zip",
    "2.5.1.1": "documentation-directory",
    "2.5.1.3": "sources-directory",
    "2.5.1.4": "binaries-directory",
    "2.5.1.4.1": "platform-tuple-definition",
    "2.5.3": "dependency-on-external-tool",
    "2.6": "VersioningLayered",
    "3.2.1": "ContinuousTimeMode",
    "3.4": "model-exchange-schema",
    "4.1.3": "early-return",
    "4.2": "state-machine-co-simulation",
    "4.2.1": "StepMode",
    "4.2.2": "IntermediateUpdateMode",
    "4.4": "co-simulation-schema",
    "5.2.1": "ClockActivationMode",
}


@dataclass(frozen=True)
class Rule:
    """A rule."""

    severity: Severity  # "error", "warning" or "info"
    expects: str  # what must hold, in a few words
    advice: str  # what to do, for who broke it
    stage: str  # the part of the check that judges it, such as "archive", "description" or the probe "life cycle"
    # section of the standard's text by version, empty for a rule of our own; a version that is missing is one that the
    # rule does not apply to
    anchor: Mapping[Version, str]

    @property
    def versions(self) -> tuple[Version, ...]:
        return tuple(self.anchor)

    def link(self, version: Version) -> str:
        """Address of the standard's text, at its heading where its name is known; empty for a rule of our own."""
        section = self.anchor[version]
        if not section:
            return ""
        known = version == "3.0" and section in _HEADINGS
        return _PLACES[version] + (f"#{_HEADINGS[section]}" if known else "")


RULES: dict[str, Rule] = {}
"""Those of the modules that have been imported; see ``catalogue``."""


def declare(text: str) -> None:
    """Make rules known."""
    stage = ""
    for line in text.strip().splitlines():
        if line.startswith("["):
            stage = line.strip("[]")
        elif line:
            name, severity, second, third, expects, advice = (part.strip() for part in line.split("|"))
            columns = zip(VERSIONS, (second, third), strict=True)
            anchor = {version: cell.strip("*") for version, cell in columns if cell != "-"}
            RULES[name] = Rule(_SEVERITIES[severity], expects, advice, stage, anchor)
