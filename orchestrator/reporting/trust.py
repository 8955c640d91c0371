"""The level of trust that a result file states, as a badge and as a section."""

from collections.abc import Mapping

from orchestrator.reporting.model import Badge, Section, Text
from orchestrator.shared.results import TrustFound

BADGES: Mapping[str, Badge] = {"green": "good", "amber": "warn", "red": "bad"}
MEANINGS = {
    "green": "Green: the answer may be used.",
    "amber": "Amber: the answer may be right, but a check is not satisfied:",
    "red": "Red: the answer must not be used:",
}


def trust_badge(trust: TrustFound | None, label: str, default: Badge = "neutral") -> tuple[Badge, str]:
    """Return the badge of a result: its label in the colour of its trust, with the level's word."""
    if trust is None or trust.level not in BADGES:
        return default, label
    return BADGES[trust.level], f"{trust.level}: {label}"


def trust_section(trust: TrustFound | None) -> list[Section]:
    """Return the section that says why a result is not green; empty where it is."""
    if trust is None or not trust.reasons:
        return []
    lines = tuple(f"{text[:1].upper()}{text[1:]}".rstrip(".") + "." for text in trust.reasons)
    return [Text("How far this can be trusted", (MEANINGS.get(trust.level, trust.level), *lines))]
