"""Effects at their sites in words."""

from collections.abc import Sequence

SITES = {"shaft": "in the shaft", "motor": "at the motor", "load": "at the load", "actuator": "in the drive",
         "log": "of the log"}  # fmt: skip
PROPER = {"coulomb": "Coulomb", "stribeck": "Stribeck"}


def effect_words(label: str) -> str:
    """Return an effect at a site, ``coulomb_friction@motor``, in words."""
    name, _, site = label.partition("@")
    parts = name.split("_")
    words = " ".join(PROPER.get(word, word) for word in parts)
    return words if site in parts else f"{words} {SITES.get(site, site)}".strip()


def place_words(name: str, site: str) -> str:
    """Return an effect and where it is in words, whatever the place."""
    words = " ".join(PROPER.get(word, word) for word in name.split("_"))
    return f"{words} {SITES.get(site, f'at {site}')}"


def list_effects(labels: Sequence[str]) -> str:
    """Return effects in words, as a list in a sentence."""
    return list_words([effect_words(label) for label in labels])


def list_words(words: Sequence[str]) -> str:
    """Return words as a list in a sentence."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def number_words(value: float, digits: int = 3) -> str:
    """Return a number with so many digits, below a million without an exponent."""
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e6 else text
