"""A sweep over any scenario of FMUs."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from orchestrator.api.cases import AnySweepResult, RunOptions, Varied, draws_of, format_varied
from orchestrator.api.shown import Block, table
from orchestrator.engine import DesignCases, Row, Status, Sweep, parse_design
from orchestrator.scenarios.isolated import Safety, describe_walls
from orchestrator.scenarios.scenario import Scenario, load_scenario
from orchestrator.scenarios.sweep import SUMMARIES, scenario_work
from orchestrator.shared.results import SweepFound, SweptScenario, WallsFound


@dataclass(frozen=True, repr=False)
class ScenarioSweepResult(AnySweepResult):
    """A sweep of a scenario; of each recorded signal the last value, the extremes, the mean and the rms.

    Attributes:
        scenario: as read from its file, before parameters are varied.
        seed: from which random and Sobol parameters are drawn.
        isolation: the walls around the FMUs that are not ours.
    """

    scenario: Scenario
    cases: DesignCases
    sweep: Sweep
    seed: int | None = 0
    parquet: bool = False
    isolation: WallsFound | None = None

    def blocks(self) -> Sequence[Block]:
        rows = [_last_values(row, len(self.scenario.record)) for row in self._shown_rows()]
        name = self.scenario.name
        title = f"{name}: {len(self.cases)} cases, {self.failed} failed; last values, more in sweep.csv"
        shown: list[Block] = [table(title, [*self.cases.names, *self.scenario.record], rows)]
        remarked, first = self._remarks
        if remarked:
            shown.append(f"Note: {remarked} of {len(self.cases)} cases have remarks, see sweep.csv; the first: {first}")
        return shown

    @cached_property
    def _remarks(self) -> tuple[int, str]:
        """How many cases have remarks, and those of the first."""
        count, first = 0, ""
        for row in self.rows():
            text = str(row.outcome.values[-1]) if row.outcome.status is Status.DONE else ""
            first = first or text
            count += bool(text)
        return count, first

    def results(self, place: Path | None = None) -> SweepFound:
        remarked, first = self._remarks
        return SweepFound(
            cases=len(self.cases),
            failed=self.failed,
            remarked=remarked,
            first_remark=first,
            columns=self.columns(),
            scenario=SweptScenario(self.scenario.name, list(self.scenario.record), self.scenario.stop),
            isolation=self.isolation,
        )


def sweep_scenario(
    scenario: Scenario | Path | str,
    vary: Varied,
    *,
    samples: int | None = None,
    seed: int = 0,
    options: RunOptions | None = None,
    **more: Any,
) -> ScenarioSweepResult:
    """Run a scenario over a design of its FMUs' parameters.

    Args:
        scenario: a ``Scenario`` or a TOML scenario file.
        vary: parameters by ``instance.variable``, as in ``sweep``.
        samples: draws of what ``vary`` makes random or sobol (default: 16).
        seed: from which random and Sobol parameters are drawn.
        options: where and how cases run.
        **more: fields of ``RunOptions`` instead of ``options``.

    Returns:
        The table of cases.

    Raises:
        ScenarioError: the scenario or an argument is wrong.
        SimulationError: the place where cases run is gone. A case that fails is a row, not an error.

    Examples:
        >>> result = oc.sweep_scenario("loop.toml", {"plant.J_l": "range:5.3:5.9:3"})
        >>> len(result), result.failed
        (3, 0)
    """
    options = options or RunOptions(**more)
    words = format_varied(vary)
    cases = DesignCases(parse_design(words, draws_of(samples, words), seed), seed)
    chosen = scenario if isinstance(scenario, Scenario) else load_scenario(Path(scenario))
    done = options.run(cases, scenario_work(chosen, cases, options.trust))
    given = {"scenario": chosen.origin or chosen.name, "vary": list(words), "samples": samples}
    walls = describe_walls(chosen.system, Safety(trust=options.trust))
    return ScenarioSweepResult(chosen, cases, done, seed, options.parquet, walls, arguments=given)


def _last_values(row: Row, count: int) -> list[str]:
    start = [f"{v:.6g}" if isinstance(v, float) else str(v) for v in row.case.parameters.values()]
    if row.outcome.status is not Status.DONE:
        message = f"{row.outcome.status.value}: {row.outcome.message}"
        return [*start, message, *[""] * (count - 1)]
    last = row.outcome.values[: -1 : len(SUMMARIES)]
    return start + [f"{v:.6g}" if isinstance(v, float) else str(v) for v in last]
