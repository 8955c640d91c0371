"""What the text of a unit means: a list of spellings that are unambiguous, their values from ``pint``.

``pint`` reads nearly any text as some unit (``qc`` as a charge, ``min`` in a product as milli-inch), so it is asked for
the names of this list alone. A text that is not in the list, or may mean two things, is no unit.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache

Dimension = tuple[int, ...]
BASES = ("kilogram", "meter", "second", "ampere", "kelvin", "mole", "candela", "radian", "count")
EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")  # the same in FMI, which knows no counts
LONGEST = 40  # characters of a unit's text
_NEWTON_METRE = "newton*meter"
_ROTATION = "revolution/minute"
# Name in pint, then all its spellings.
_SPELLED = (
    ("second", "s sec secs second seconds Sek Sekunde Sekunden"),
    ("millisecond", "ms msec msecs millisecond milliseconds Millisekunden"),
    ("microsecond", "us usec usecs microsecond microseconds"),
    ("nanosecond", "ns nsec nanosecond nanoseconds"),
    ("minute", "min mins minute minutes Minuten"),
    ("hour", "h hr hrs hour hours Stunden"),
    ("day", "day days"),
    ("radian", "rad rads radian radians"),
    ("milliradian", "mrad millirad milliradian milliradians"),
    ("microradian", "urad microrad microradian microradians"),
    ("degree", "deg degs degree degrees Grad"),
    ("millidegree", "mdeg millidegree millidegrees"),
    ("grade", "gon gradian gradians"),
    ("arcminute", "arcmin arcminute arcminutes"),
    ("arcsecond", "arcsec arcsecond arcseconds"),
    (
        "revolution",
        "rev revs revolution revolutions rot rots rotation rotations turn turns U Umdr Umdrehung Umdrehungen",
    ),
    (_ROTATION, "rpm"),
    ("revolution/second", "rps"),
    ("radian/second", "radps"),
    ("degree/second", "degps dps"),
    ("meter", "m meter meters metre metres"),
    ("kilometer", "km kilometer kilometers"),
    ("decimeter", "dm"),
    ("centimeter", "cm centimeter centimeters centimetre centimetres"),
    ("millimeter", "mm millimeter millimeters millimetre millimetres"),
    ("micrometer", "um micron microns micrometer micrometers micrometre micrometres"),
    ("nanometer", "nm nanometer nanometers"),
    ("inch", "in inch inches"),
    ("foot", "ft foot feet"),
    ("newton", "N newton newtons"),
    ("millinewton", "mN millinewton"),
    ("kilonewton", "kN kilonewton"),
    ("meganewton", "MN meganewton"),
    ("decanewton", "daN"),
    ("pound_force", "lbf"),
    ("ounce_force", "ozf"),
    ("kilogram_force", "kgf kp kilopond"),
    (_NEWTON_METRE, "Nm Newtonmeter newtonmetre newtonmeters newtonmetres"),
    ("micronewton*meter", "uNm"),
    ("millinewton*meter", "mNm"),
    ("centinewton*meter", "cNm"),
    ("decinewton*meter", "dNm"),
    ("decanewton*meter", "daNm"),
    ("kilonewton*meter", "kNm"),
    ("meganewton*meter", "MNm"),
    ("newton*millimeter", "Nmm"),
    ("newton*centimeter", "Ncm"),
    ("kilonewton*millimeter", "kNmm"),
    ("pound_force*inch", "lbin inlb inlbs inlbf lbfin"),
    ("pound_force*foot", "lbft ftlb ftlbs ftlbf lbfft"),
    ("ounce_force*inch", "ozin inoz ozfin inozf"),
    ("kilogram_force*centimeter", "kgfcm"),
    ("kilogram_force*meter", "kgfm"),
    ("ampere", "A Amp Amps ampere amperes Arms A_rms"),
    ("milliampere", "mA milliampere milliamps"),
    ("microampere", "uA"),
    ("kiloampere", "kA"),
    ("volt", "V volt volts"),
    ("millivolt", "mV millivolt millivolts"),
    ("microvolt", "uV"),
    ("kilovolt", "kV"),
    ("percent", "% percent percents pct Prozent"),
    ("0.1*percent", "\u2030 permille promille Promille"),
    ("dimensionless", "1 - \u2013 p.u. pu p.u"),
    (
        "count",
        "count counts cts cnt cnts qc inc incr incs increment increments inkr inkremente tick ticks pulse pulses LSB",
    ),
    ("hertz", "Hz hertz"),
    ("kilohertz", "kHz"),
    ("kilogram", "kg kilogram kilograms"),
    ("gram", "g gram grams"),
    ("tonne", "t"),
    ("pound", "lb lbs pound pounds"),
    ("ounce", "oz ounce ounces"),
    ("kelvin", "K kelvin"),
    ("degree_Celsius", "degC Celsius"),
    ("degree_Fahrenheit", "degF Fahrenheit"),
    ("mole", "mol"),
    ("candela", "cd"),
    ("pascal", "Pa"),
    ("hectopascal", "hPa"),
    ("kilopascal", "kPa"),
    ("megapascal", "MPa"),
    ("bar", "bar"),
    ("millibar", "mbar"),
    ("psi", "psi"),
    ("joule", "J"),
    ("kilojoule", "kJ"),
    ("megajoule", "MJ"),
    ("kilowatt_hour", "kWh"),
    ("watt_hour", "Wh"),
    ("ampere_hour", "Ah"),
    ("watt", "W watt watts"),
    ("milliwatt", "mW"),
    ("kilowatt", "kW"),
    ("megawatt", "MW"),
    ("ohm", "ohm ohms Ohm"),
    ("kiloohm", "kOhm kohm"),
    ("henry", "H"),
    ("millihenry", "mH"),
    ("farad", "F"),
    ("microfarad", "uF"),
    ("weber", "Wb"),
    ("tesla", "T"),
    ("liter", "l L liter liters litre litres"),
    ("milliliter", "ml mL"),
)  # fmt: skip
ATOMS = {spelling: name for name, spellings in _SPELLED for spelling in spellings.split()}
_FOLDED: dict[str, tuple[tuple[str, str], ...]] = {}
for _spelling, _name in ATOMS.items():
    _FOLDED[_spelling.lower()] = (*_FOLDED.get(_spelling.lower(), ()), (_spelling, _name))
_PHRASES = {
    "a rms": "ampere", "a(rms)": "ampere", "per unit": "dimensionless", "per mille": "0.1*percent",
    "r/min": _ROTATION, "r/s": "revolution/second", "u/min": _ROTATION,
}  # fmt: skip
# What drives call revolutions a minute; elsewhere it is a frequency.
_EACH_MINUTE = frozenset(("1/min", "/min", "min^-1", "min-1", "1/minute"))
_SIGNS = str.maketrans(
    {
        "\u00b7": ".", "\u22c5": ".", "\u2219": ".", "\u2022": ".", "\u00d7": ".", "*": ".", "\u00b5": "u",
        "\u03bc": "u", "\u2212": "-", "\u2215": "/", "\u00a0": " ", "\u2126": "ohm", "\u03a9": "ohm",
    }
)  # fmt: skip
_POWERS = str.maketrans("\u2070\u00b9\u00b2\u00b3\u2074\u207b", "01234-")
_MULTIPLE = re.compile(
    r"(1/[1-9]\d*|10\^-?\d{1,2}|\d+(?:[.,]\d+)?(?:[eE][+-]?\d{1,2})?)\s*[.x ]?\s*(?=[A-Za-z%\u2030])(.+)"
)
_FACTOR = re.compile(r"([A-Za-z_%\u2030]+)(?:\^?(-?\d))?")
_QUANTITY = re.compile(r"(?i)(.+?)\s*\((?:torque|angle|position|velocity|speed|time|current|voltage|force|length)\)")
_ALONE = frozenset("urh")  # lower-case letters that stand for too much
_MASS_FOR_FORCE = {"pound": "pound_force", "ounce": "ounce_force"}  # where they are multiplied by inches or feet


@dataclass(frozen=True)
class KnownUnit:
    """A unit: the number of it times ``factor`` plus ``offset`` is the value in SI."""

    dimension: Dimension
    factor: float
    offset: float = 0.0  # added after ``factor``; other than 0.0 for temperatures alone


def dimension_of(**exponents: int) -> Dimension:
    """Return the exponents of ``BASES``, given by their names; those left out are 0."""
    return tuple(exponents.get(base, 0) for base in BASES)


@lru_cache(maxsize=4096)
def parse_unit(text: str, wanted: Collection[Dimension] = ()) -> KnownUnit | None:
    """Return what the text of a unit means, or None where it is not known or may mean two things.

    ``nm`` written small is a torque or a length and ``1/min`` a speed or a frequency: ``wanted`` decides.
    """
    found = [unit for name in _readings(text) if (unit := _unit_value(name)) is not None]
    return next((unit for unit in found if unit.dimension in wanted), found[0] if found else None)


def is_unit(text: str) -> bool:
    """Return whether a text is a known unit."""
    return bool(_readings(text))


@lru_cache(maxsize=4096)
def _readings(text: str) -> tuple[str, ...]:
    """Return the expressions in the names of pint that a text may stand for; none: it is not known."""
    plain = " ".join(text.split())
    while len(plain) > 2 and plain[0] + plain[-1] in ("[]", "()", "{}", "<>"):
        plain = plain[1:-1].strip()
    described = _QUANTITY.fullmatch(plain)
    plain = plain if described is None else described[1]
    if not plain or len(plain) > LONGEST:
        return ()
    plain = re.sub("[\u00b0\u00ba\u02da]\\s*(?=[CF]\\b)", "deg", plain)
    plain = re.sub("[\u00b0\u00ba\u02da]", "deg", plain).translate(_SIGNS)
    plain = re.sub("[\u2070\u00b9\u00b2\u00b3\u2074\u207b]+", lambda power: "^" + power[0].translate(_POWERS), plain)
    plain = re.sub(r"\s*([/.])\s*", r"\1", plain.replace(" per ", "/")) if plain != "per unit" else plain
    if plain.lower() in _EACH_MINUTE:
        return "1/minute", _ROTATION
    whole = _PHRASES.get(plain.lower()) or _PHRASES.get(plain)
    if whole is not None:
        return (whole,)
    single = _atoms(plain)
    if single:
        return single
    multiple = _MULTIPLE.fullmatch(plain)
    if multiple is not None:
        return tuple(f"{_number(multiple[1])!r}*({name})" for name in _readings(multiple[2]))
    found = _product(plain)
    if not found and plain.isupper() and not re.search(r"\bM[A-Z]", plain):  # mega or milli
        found = _product(plain.lower())
    return found


def _atoms(word: str) -> tuple[str, ...]:
    """Return what one word may stand for: as it is written, else with other capitals where that leaves no doubt."""
    if word in ATOMS and word != "nm":
        return (ATOMS[word],)
    if word.lower() in _ALONE or (len(word) == 1 and word.isupper()) or word.lower() == "grad":
        return ()
    alike = _FOLDED.get(word.lower(), ())
    if word.islower():  # nobody writes mega small
        names = dict.fromkeys(name for _, name in alike if not name.startswith("mega"))
    elif word[0] == "M" and any(name.startswith("milli") for _, name in alike):
        return ()
    else:
        capitals = [name for spelling, name in alike if not spelling.islower()]
        names = dict.fromkeys(capitals or [name for _, name in alike])
    return tuple(names) if len(names) == 1 or word == "nm" else ()


def _product(text: str) -> tuple[str, ...]:
    """Return the expression of a product or quotient of units, such as ``N.m``, ``lb-in`` or ``rad s^-1``."""
    above, *below = text.split("/")
    if any("." in part.strip("()") and not part.startswith("(") for part in below) or len(below) > 2:
        return ()  # what stands below the line is not clear
    factors: list[tuple[str, int]] = []
    for sign, part in ((1, above), *((-1, part) for part in below)):
        if sign == 1 and part == "1":
            continue
        for word in re.split(r"[. ]|-(?=[A-Za-z])", part.strip("()")):
            found = _FACTOR.fullmatch(word)
            names = () if found is None else _atoms(found[1])
            if found is None or not names:
                return ()
            factors.append((names[-1] if found[1] == "nm" else names[0], sign * int(found[2] or 1)))
    if len(factors) == 2 and any(factor in (("inch", 1), ("foot", 1)) for factor in factors):
        factors = [(_MASS_FOR_FORCE.get(name, name), power) for name, power in factors]
    if len(factors) < 2 and not any(power != 1 for _, power in factors):
        return ()
    return ("*".join(f"({name})**{power}" for name, power in factors),)


def _number(text: str) -> float:
    if text.startswith("1/"):
        return 1.0 / float(text[2:])
    return 10.0 ** float(text[3:]) if text.startswith("10^") else float(text.replace(",", "."))


@lru_cache(maxsize=4096)
def _unit_value(name: str) -> KnownUnit | None:
    """Return the value of an expression of known names."""
    import pint  # a quarter of a second that few commands need

    registry = _registry()
    try:
        unit = registry.Quantity(name)
        one, zero = (registry.Quantity(unit.magnitude * n, unit.units).to_base_units() for n in (1.0, 0.0))
    except (pint.PintError, ZeroDivisionError, OverflowError):
        return None
    powers = {str(base): power for base, power in one.unit_items()}
    if set(powers) - set(BASES) or any(power != int(power) for power in powers.values()):
        return None
    offset = float(zero.magnitude)
    return KnownUnit(tuple(int(powers.get(base, 0)) for base in BASES), float(one.magnitude) - offset, offset)


@lru_cache(maxsize=1)
def _registry():  # type: ignore[no-untyped-def]
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
