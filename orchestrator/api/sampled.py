"""Results whose rows are samples: from one table of signals a CSV file, a frame of pandas and a dataset of xarray."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from orchestrator.api.plotted import PlottedResult
from orchestrator.errors import ScenarioError
from orchestrator.shared.output import write_columns

if TYPE_CHECKING:
    import numpy as np
    import pandas
    import xarray
    from numpy.typing import NDArray


class SampledResult(PlottedResult):
    """Base of results whose rows are samples. A subclass gives ``signals``."""

    csv_name: ClassVar[str] = ""
    """Name of the CSV file, without its suffix, where it is not the command's."""
    digits: ClassVar[int | None] = None
    """Of numbers in the CSV file; None: all. With digits, NaN is an empty cell."""

    @abstractmethod
    def signals(self) -> Mapping[str, NDArray[np.float64]]:
        """Collect the samples.

        Returns:
            Arrays of shape (n,) by name, ``time`` [s] first.
        """

    @property
    def units(self) -> Mapping[str, str | None]:
        """Unit of each signal; None where its FMU declares none. Empty: SI units."""
        return {}

    def write_csv(self, path: Path | str) -> None:
        """Write the samples as CSV. ``path``: of the CSV file to write.

        Raises:
            OutputError: it cannot be written.
        """
        write_columns(Path(path), self.signals(), None if self.digits is None else self._cell)

    def _cell(self, value: float) -> str:
        return "" if math.isnan(value) else f"{value:.{self.digits}g}"

    def write_data(self, folder: Path) -> None:
        self.write_csv(folder / f"{self.csv_name or self.command}.csv")

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the samples as a frame of pandas.

        Returns:
            A ``pandas.DataFrame``: a column each, ``time`` [s] as index, units in ``attrs["units"]``.

        Raises:
            ScenarioError: pandas is not installed.
        """
        columns = dict(self.signals())
        frame: pandas.DataFrame = _import("pandas", "to_dataframe").DataFrame(columns, index=columns.pop("time"))
        frame.index.name = "time"
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """Return the samples as a dataset of xarray.

        Returns:
            An ``xarray.Dataset``: a variable each over ``time`` [s], with its unit in ``attrs["units"]``.

        Raises:
            ScenarioError: pandas or xarray is not installed.
        """
        _import("xarray", "to_xarray")
        data = self.to_dataframe().to_xarray()
        for name, unit in {"time": "s", **self.units}.items():
            if unit and name in data:
                data[name].attrs["units"] = unit
        return data


def _import(name: str, method: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise ScenarioError(f"`{method}` needs the extra [frames]: pip install 'backlash-cosim[frames]'") from None
