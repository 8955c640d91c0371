"""The words that names of channels are made of, and those that options have for ways to resample."""

import re

_GREEK = str.maketrans({"θ": " theta ", "φ": " phi ", "ϕ": " phi ", "τ": " tau ", "ω": " omega ", "α": " alpha "})
_FUSED = re.compile(r"(theta|phi|th|q|pos|angle|ang|winkel|enc)(m|mot|motor|l|load|last)")


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


INTERPOLATION = ("linear", "cubic")
RESAMPLING = ("uniform", *INTERPOLATION)
ANGLE = _set("theta th phi angle ang pos position winkel lage encoder enc q stellung istposition")
MOTOR = _set("m mot motor drive antrieb input motorside primary")
LOAD = _set("l load last output out abtrieb arm link joint gelenk table tisch loadside secondary")
TORQUE = _set("u torque trq tq moment drehmoment tau drehmomentsollwert kraft force")
CURRENT = _set("current curr strom iq")
VOLTAGE = _set("voltage volt spannung umot")
ASKED = _set("ref set cmd command commanded soll sollwert sp setpoint target demand request req desired")
FOUND = _set("act actual ist istwert meas measured fb feedback")
SPEED = _set("speed velocity vel omega w dq rpm drehzahl geschwindigkeit acc acceleration")
OTHER = _set("err error dev deviation lag temp temperature limit lim max min abs std raw status ff")
TIME = _set("time t zeit timestamp datetime date uhrzeit elapsed zeitstempel stamp timestamps seconds")
SAMPLE = _set("sample samples index idx no nr k n counter cycle row samplenumber number zeile")
FURTHER = _set("filtered smoothed axis channel ch signal value avg mean x y z a b c d side one two i")
# What a field, an attribute or a line is called that holds a unit.
UNIT_KEYS = _set("unit units einheit einheiten unit_string physical_unit y_unit_label") | {"unit label"}
# Words that say what a channel is, and not in which unit.
DESCRIBING = ANGLE | MOTOR | LOAD | TORQUE | CURRENT | ASKED | FOUND | SPEED | OTHER | TIME | SAMPLE | FURTHER


def words_of(text: str) -> list[str]:
    """Return the words of a channel's name, in lower case."""
    plain = text.translate(_GREEK)
    plain = re.sub(r"([a-zäöü])([A-Z])", r"\1 \2", plain)
    words = [word for word in re.split(r"[^A-Za-zäöüÄÖÜß]+", plain.lower()) if word]
    parts: list[str] = []
    for word in words:
        fused = _FUSED.fullmatch(word)
        parts += fused.groups() if fused is not None else (word,)
    return parts


def names_time(text: str) -> bool:
    """Return whether a channel's name has a word for a time."""
    return not TIME.isdisjoint(words_of(text))


def describes(text: str) -> bool:
    """Return whether a text only says more of what a channel is, as ``(motor)``, ``(7)`` and ``(act)`` do."""
    return all(word in DESCRIBING for word in words_of(text)) and not re.search("[%°‰µΩ]|[A-Za-z][.]", text)
