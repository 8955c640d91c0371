"""What ``bench.json`` holds, as types that the API fills and the page reads."""

from benchmarks.masters.alone import RecordCost, SweepCost
from benchmarks.masters.measure import ToolRow
from benchmarks.masters.scaling import Cost
from orchestrator.shared.results import ResultData


class BenchFound(ResultData, frozen=True, kw_only=True):
    """``bench``: times of each tool; with ``scaling`` also the cost by numbers of FMUs and steps, and memory."""

    rows: tuple[ToolRow, ...] = ()
    scaling: tuple[Cost, ...] = ()
    sweeps: tuple[SweepCost, ...] = ()
    records: tuple[RecordCost, ...] = ()
