"""The level of trust that a result file states, as a badge and as a section."""

from collections.abc import Mapping
from typing import Any

from orchestrator.reporting.model import Badge, Section, Text

BADGES: Mapping[str, Badge] = {"green": "good", "amber": "warn", "red": "bad"}
MEANINGS = {
    "green": "Green: the answer may be used as it stands.",
    "amber": "Amber: the answer may be right, but this was not shown:",
    "red": "Red: the answer must not be used as it stands:",
}


def trust_badge(trust: Mapping[str, Any] | None, label: str, default: Badge = "neutral") -> tuple[Badge, str]:
    """Return the badge of a result: its label in the colour of its trust, with the level's word.

    Args:
        trust: what the result file says, with ``level`` and ``reasons``; None in files of older versions.
        label: the answer in a few words.
        default: the colour where the file states no trust.

    Returns:
        Colour and text.
    """
    level = str((trust or {}).get("level"))
    if level not in BADGES:
        return default, label
    return BADGES[level], f"{level}: {label}"


def trust_section(trust: Mapping[str, Any] | None) -> list[Section]:
    """Return the section that says why a result is not green; empty where it is.

    Args:
        trust: what the result file says, with ``level`` and ``reasons``; None in files of older versions.

    Returns:
        One section or none.
    """
    reasons = [str(reason) for reason in (trust or {}).get("reasons") or ()]
    if not reasons:
        return []
    level = str((trust or {}).get("level"))
    lines = tuple(text if text.endswith(".") else f"{text}." for text in reasons)
    return [Text("How far this can be trusted", (MEANINGS.get(level, level), *lines))]
