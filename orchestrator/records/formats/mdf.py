"""Records in MDF 3 and 4 (measurement data format), by asammdf."""

import gc
import logging
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.records.formats.heads import head_of
from orchestrator.records.formats.mdf_conversions import apply_ranges, has_formula, hides_ranges, maps_ranges
from orchestrator.records.formats.source import (
    MAXIMUM_BYTES,
    MAXIMUM_CHANNELS,
    Head,
    RecordSource,
    as_numbers,
    damage_error,
    extra_error,
)
from orchestrator.records.units import parse_unit
from orchestrator.records.words import names_time

# What the master of a group of version 4 may be besides a time.
MASTERS = {2: "angle", 3: "distance", 4: "index"}


class MdfSource(RecordSource):
    """An MDF file; each channel group is a raster of its own, its master the time."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file = path, file
        self._at: list[tuple[int, int | None]] = []
        heads = []
        for number, group in enumerate(file.groups):
            master = file.masters_db.get(number)
            if master is not None:
                heads.append(_master_head(group.channels[master], number))
                self._at.append((number, None))
            for index, channel in enumerate(group.channels):
                if index == master:
                    continue
                unit = channel.unit or getattr(channel.conversion, "unit", "") or ""
                heads.append(head_of(channel.name, unit if isinstance(unit, str) else "", "number", number))
                self._at.append((number, index))
        self.heads: Sequence[Head] = heads
        channels = sum(index is not None for _, index in self._at)
        self.dialect = f"MDF {file.version}, {len(file.groups)} groups, {channels} channels"
        self.rate = None

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        """Return the values of some channels, physical where the file says how."""
        out = []
        for place in places:
            group, index = self._at[place]
            invalid = None
            try:
                if index is None:
                    self._refuse_conversion(group, self._file.masters_db[group], maps_ranges)
                    values = np.asarray(self._file.get_master(group), dtype=float)
                else:
                    self._refuse_conversion(group, index, hides_ranges)
                    ranges = self._file.groups[group].channels[index].conversion
                    ranges = ranges if maps_ranges(ranges, str(self._file.version)) else None
                    signal = self._file.get(group=group, index=index, ignore_invalidation_bits=True, raw=bool(ranges))
                    values = np.asarray(signal.samples)
                    values = apply_ranges(values, ranges) if ranges else values
                    invalid = signal.invalidation_bits
            except RecordError:
                raise
            except Exception as error:  # asammdf raises whatever a broken file makes it meet
                raise damage_error(self._path, "MDF", error) from None
            numbers = as_numbers(values, self.heads[place].name, self._path)
            if invalid is not None and np.any(invalid):  # samples that the file marks, each at its own row
                numbers[np.asarray(invalid, dtype=bool)] = np.nan if numbers.dtype.kind == "f" else np.datetime64("NaT")
            out.append(numbers)
        return out

    def _refuse_conversion(self, group: int, index: int, has_ranges: Callable[[Any, str], bool]) -> None:
        """Refuse conversions that cannot be done: formulas, and ranges where they are not read here."""
        channel, version = self._file.groups[group].channels[index], str(self._file.version)
        for is_there, what in ((has_formula, "a formula"), (has_ranges, "a table of ranges")):
            if is_there(channel.conversion, version):
                raise RecordError(
                    f"{self._path}: column `{channel.name}` must have a linear conversion, but has {what}: export it "
                    "converted"
                )


def _master_head(channel: Any, group: int) -> Head:
    """Return the channel that a group's samples are taken over: a time, unless the file says that it is none."""
    unit = channel.unit or getattr(channel.conversion, "unit", "") or ""
    unit = unit if isinstance(unit, str) else ""
    word = MASTERS.get(getattr(channel, "sync_type", 0))
    known = None if unit in ("", "s") else parse_unit(unit, ("time",))  # what asks for it loads pint
    if word is None and known is not None and known.kind != "time":
        word = "master"  # version 3 has no word for it
    if word is None:
        stated = unit if known is not None else "s"
        return Head("time", stated, "number", group, "time" if group == 0 else f"time of group {group}")
    name = word if not channel.name or names_time(channel.name) else channel.name
    return head_of(name, "" if word == "index" else unit, "number", group)


def open_file(path: Path) -> MdfSource:
    """Return the opened file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import asammdf

        logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    except ImportError:
        raise extra_error(path, "an MDF file", "asammdf", "mdf") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = asammdf.MDF(path)
            rows = sum(int(group.channel_group.cycles_nr) for group in file.groups)
            channels = sum(len(group.channels) for group in file.groups)
    except Exception as error:  # asammdf raises whatever a broken file makes it meet
        told = damage_error(path, "MDF", error)
        _drop_silently(error)
        raise told from None
    if rows * 8 > MAXIMUM_BYTES or channels > MAXIMUM_CHANNELS:
        raise RecordError(f"{path}: a record must have at most {MAXIMUM_BYTES // 8} rows, but has {rows}")
    return MdfSource(path, file)


def _drop_silently(error: Exception) -> None:
    """Let go of the half-made files that an error holds now: their destructors complain."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        error.__traceback__ = None
        gc.collect()
    finally:
        sys.unraisablehook = hook
