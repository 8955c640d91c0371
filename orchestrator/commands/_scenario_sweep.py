"""The sweep over any scenario: what it prints and writes."""

import argparse

from orchestrator.commands._console import print_table
from orchestrator.commands._progress import samples_of, swept
from orchestrator.engine import DesignCases, Row, Status, parse_design
from orchestrator.output import staged
from orchestrator.scenario import load_scenario
from orchestrator.scenario_sweep import SUMMARIES, scenario_work

MOST_ROWS_PRINTED = 40


def run_scenario_sweep(arguments: argparse.Namespace) -> int:
    """Run a scenario over a design; return the number of failed cases."""
    cases = DesignCases(parse_design(arguments.vary, samples_of(arguments), arguments.seed), arguments.seed)
    with staged(arguments.out) as directory:
        scenario = load_scenario(arguments.scenario)
        work = scenario_work(scenario, cases)
        with swept(cases, work, arguments, directory) as (sweep, results):
            rows = [_cells(row) for row in sweep.rows() if row.outcome.index < MOST_ROWS_PRINTED]
            title = f"{scenario.name}: {len(cases)} cases, {sweep.failed} failed; last values, more in sweep.csv"
            print_table(title, [*cases.names, *scenario.record], rows)
            results["scenario"] = {"name": scenario.name, "record": list(scenario.record), "stop": scenario.stop}
    sweep.discard_journal()
    return sweep.failed


def _cells(row: Row) -> list[str]:
    start = [f"{v:.6g}" if isinstance(v, float) else str(v) for v in row.case.parameters.values()]
    if row.outcome.status is not Status.DONE:
        return [*start, f"{row.outcome.status.value}: {row.outcome.message}"]
    last = row.outcome.values[:: len(SUMMARIES)]
    return start + [f"{v:.6g}" if isinstance(v, float) else str(v) for v in last]
