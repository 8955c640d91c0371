"""LabVIEW's measurement files (lvm): ``X_Value`` is a time, and each one begins a raster of its own.

See NI's "Specification for the LabVIEW Measurement File": a segment has a head of its own, in which ``X_Dimension``
says what ``X_Value`` is (``Time`` where it is not there) and ``X_Columns`` whether there is one for each channel.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from orchestrator.errors import RecordError
from orchestrator.records.formats.source import Head

END = "***End_of_Header***"
_MARK, _X = "LabVIEW Measurement", "X_Value"


def is_labview(preamble: Sequence[str]) -> bool:
    """Return whether lines above a table are the head of such a file."""
    return bool(preamble) and preamble[0].startswith(_MARK)


def with_rasters(heads: Sequence[Head], preamble: Sequence[str]) -> list[Head]:
    """Return the columns, times called so, with the raster of each."""
    dimensions = next((line.split()[1:] for line in preamble if line.startswith("X_Dimension")), [])
    times = not dimensions or all(word == "Time" for word in dimensions)
    out: list[Head] = []
    raster = -1
    for head in heads:
        is_x = head.name.partition(" ")[0] == _X
        raster += is_x
        named = replace(head, raster=max(raster, 0))
        if is_x and times:
            # `X_Value` is the name in the file; the further ones are numbered as groups of MDF are.
            named = replace(named, name="time", unit="s", full=_X if raster == 0 else f"time of group {raster}")
        out.append(named)
    return out


def refuse_starts(lines: Sequence[Sequence[str]], path: Path) -> None:
    """Refuse channels that begin at different times; those of `X0` are in the X column that each one may have."""
    rows = {cells[0]: {*cells[1:]} - {""} for cells in lines if cells}
    stated = ("Date", "Time") if rows.get("X_Columns") == {"Multi"} else ("Date", "Time", "X0")
    for key in stated:
        if len(rows.get(key, ())) > 1:
            raise RecordError(
                f"{path}: all channels must begin together, but begin at {' and '.join(sorted(rows[key]))} (`{key}`): "
                "save those that begin together in a file of their own"
            )


def refuse_segment(line: str, number: int, path: Path) -> None:
    """Refuse a second segment within the rows, which begins anew with channels and times of its own."""
    if line.startswith(END):
        raise RecordError(
            f"{path}: must hold one segment, but another one has its head above line {number}: keep the rows of one, "
            "with its head, in a file"
        )
