"""Values as netCDF packs them: attributes of the Climate and Forecast conventions (CF 1.11, sections 2.5.1 and 8.1).

The physical value is ``scale_factor`` times the number plus ``add_offset``. ``_FillValue``, ``missing_value`` and what
lies outside ``valid_range``, ``valid_min`` or ``valid_max`` is missing; these are packed numbers, too, unless a limit
of whole numbers is none itself (NetCDF Users' Guide, appendix A). ``_Unsigned`` says how whole numbers are read.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.records.words import words_of

Array = NDArray[Any]

# Words in attributes of other conventions, which mean one thing here and another there.
UNKNOWN = frozenset(["scale", "scaling", "factor", "gain", "slope", "offset", "intercept", "multiplier", "lsb"])
# Other spellings of what marks a missing value, in small letters without underscores.
MARKS = frozenset(["fillvalue", "missingvalue", "missing", "nodata", "nodatavalue", "invalidvalue"])
KNOWN = ("scale_factor", "add_offset", "_FillValue", "missing_value")


def unpack(values: Array, attributes: Mapping[str, Any], fill: Any = None) -> tuple[Array, str]:
    """Return physical values, NaN where one is missing, and what was done in words (empty: nothing).

    Args:
        values: of any shape.
        attributes: by name, as the file has them.
        fill: what the file holds where nothing was written; None: that is not known.
    """
    if values.dtype.kind not in "fiu":
        return values, ""
    raw = _with_sign(values, attributes)
    missing = _missing(raw, attributes, fill)
    scale, offset = (_number(attributes, key) for key in ("scale_factor", "add_offset"))
    if scale is not None and not (np.isfinite(scale) and scale != 0.0):
        raise ValueError(f"`scale_factor` must be a finite number that is not 0, but is {scale:g}")
    if offset is not None and not np.isfinite(offset):
        raise ValueError(f"`add_offset` must be a finite number, but is {offset:g}")
    out = raw
    if scale is not None or offset is not None:
        out = raw.astype(float)
        out *= 1.0 if scale is None else scale
        out += 0.0 if offset is None else offset
    missing |= _outside(raw, out, attributes)
    said = [f"{word} {number:g}" for word, number in (("times", scale), ("plus", offset)) if number is not None]
    if raw.dtype.kind != values.dtype.kind:
        said.append("without a sign" if raw.dtype.kind == "u" else "with a sign")
    if missing.any():
        out = out.astype(float)
        out[missing] = np.nan
        said.append(f"{np.count_nonzero(missing)} missing")
    others = [
        key for key in attributes
        if key not in KNOWN and (UNKNOWN & set(words_of(key)) or key.lower().replace("_", "") in MARKS)
    ]  # fmt: skip
    said += [f"attribute `{key}` not used" for key in others]
    return out, ", ".join(said)


def _with_sign(values: Array, attributes: Mapping[str, Any]) -> Array:
    """Return whole numbers with or without a sign, as an attribute says."""
    word = _text(attributes.get("_Unsigned", "")).lower()
    if values.dtype.kind == "i" and word == "true":
        return values.view(values.dtype.str.replace("i", "u"))
    if values.dtype.kind == "u" and word == "false":
        return values.view(values.dtype.str.replace("u", "i"))
    return values


def _missing(raw: Array, attributes: Mapping[str, Any], fill: Any) -> NDArray[np.bool_]:
    """Return where numbers are those that stand for no value."""
    marks = [np.ravel(_plain(attributes[key], key)) for key in ("_FillValue", "missing_value") if key in attributes]
    if fill is not None and np.size(fill) == 1 and fill != 0:
        marks.append(np.ravel(np.asarray(fill)))
    missing = np.zeros(raw.shape, dtype=bool)
    raw = raw.astype(raw.dtype.newbyteorder("="), copy=False)
    size = 2 ** (8 * raw.dtype.itemsize)
    for mark in [number for several in marks for number in several.tolist()]:
        if raw.dtype.kind == "f":
            missing |= raw == raw.dtype.type(mark)
        elif np.isfinite(mark) and mark == int(mark) and -size // 2 <= mark < size:  # by its bits: either sign
            missing |= raw.view(f"u{raw.dtype.itemsize}") == int(mark) % size
    return missing


def _outside(raw: Array, out: Array, attributes: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Return where numbers are outside the valid ones."""
    limits = [
        (key, _plain(attributes[key], key)) for key in ("valid_min", "valid_max", "valid_range") if key in attributes
    ]
    outside = np.zeros(raw.shape, dtype=bool)
    for key, limit in limits:
        if limit.size != (2 if key == "valid_range" else 1):
            raise ValueError(f"`{key}` must be {'two numbers' if key == 'valid_range' else 'a number'}, but is {limit}")
        numbers = out if raw.dtype.kind in "iu" and limit.dtype.kind == "f" else raw
        ends = np.ravel(_with_sign(limit, {"_Unsigned": "true"}) if raw.dtype.kind == "u" else limit)
        if key != "valid_max":
            outside |= numbers < ends[0]
        if key != "valid_min":
            outside |= numbers > ends[-1]
    return outside


def _number(attributes: Mapping[str, Any], key: str) -> float | None:
    if key not in attributes:
        return None
    plain = _plain(attributes[key], key)
    if plain.size != 1:
        raise ValueError(f"`{key}` must be one number, but is {plain.size}")
    return float(np.ravel(plain)[0])


def _plain(value: Any, key: str) -> Array:
    plain = np.asarray(value)
    if plain.dtype.kind not in "fiu":
        raise ValueError(f"`{key}` must be a number, but is {_text(value)!r}")
    return plain


def _text(value: Any) -> str:
    plain = value.ravel()[0] if isinstance(value, np.ndarray) and value.size else value
    return plain.decode("utf-8", "replace") if isinstance(plain, bytes) else str(plain)
