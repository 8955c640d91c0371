"""Checks FMUs of any tools, and prints a table: by exporting tool, how many ran, and how many each rule names.

    python -m benchmarks.fmus_of_tools FOLDER ...
    python -m benchmarks.fmus_of_tools FOLDER --list FILE

FMUs are looked for in subfolders too; files of the same content count once. ``--list`` writes every finding, for a
second look.
"""

import argparse
import hashlib
import multiprocessing
import sys
import time
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.checking.findings import FmuFindings
from orchestrator.shared.isolation.limits import Limits

TOOLS = (
    "20-sim", "Altair Activate", "Amesim", "Dymola", "Hopsan", "JModelica", "OpenModelica", "Overture", "PythonFMU",
    "Reference FMUs", "Simulink",
)  # fmt: skip
OTHERS = "others, or not named"


@dataclass(frozen=True)
class Checked:
    """An FMU that was checked, the tool that wrote it, and how long that took [s]."""

    tool: str
    seconds: float
    report: FmuFindings


def check_one(task: tuple[Path, float]) -> Checked:
    """Check an FMU.

    Args:
        task: its path, and the time that a call may take [s].
    """
    path, limit = task
    begin = time.perf_counter()
    report = check_fmu(path, CheckOptions(limits=Limits(time=limit)))
    written = str(report.facts.get("generationTool", "")).lower()
    tool = next((t for t in TOOLS if t.lower() in written), OTHERS)
    return Checked(tool, time.perf_counter() - begin, report)


def find(folders: list[Path]) -> list[Path]:
    """All FMUs below folders, each content once."""
    paths = sorted(p for folder in folders for p in folder.rglob("*.fmu") if p.is_file())
    return list({hashlib.sha256(p.read_bytes()).hexdigest(): p for p in reversed(paths)}.values())[::-1]


def named(checked: list[Checked], severity: str) -> str:
    """The rules of a severity, each with the number of FMUs that it names; misuse counts as one rule."""
    counts: Counter[str] = Counter()
    for c in checked:
        rules = {f.rule for f in c.report.findings if f.severity == severity}
        counts.update({"misuse" if rule.startswith("misuse.") else rule for rule in rules})
    return ", ".join(f"{rule} {count}" for rule, count in sorted(counts.items())) or "-"


def table(checked: list[Checked]) -> str:
    """The table, by version and tool."""
    rows: dict[tuple[str, str], list[Checked]] = defaultdict(list)
    for c in checked:
        rows[c.report.version or "none", c.tool].append(c)
    lines = [
        "| FMI | tool | FMUs | executed | no error | longest | errors | warnings |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (version, tool), group in sorted(rows.items(), key=lambda item: (item[0][0], item[0][1] == OTHERS, item[0][1])):
        counts = f"{len(group)} | {sum(c.report.executed for c in group)} | {sum(c.report.ok for c in group)}"
        longest = f"{max(c.seconds for c in group):.1f} s"
        lines.append(
            f"| {version} | {tool} | {counts} | {longest} | {named(group, 'error')} | {named(group, 'warning')} |"
        )
    return "\n".join(lines)


def listing(checked: list[Checked]) -> str:
    """Every finding, FMU by FMU."""
    lines = []
    for c in checked:
        lines.append(f"{c.report.fmu} ({c.tool}, {c.seconds:.1f} s) {c.report.not_executed}")
        lines += [f"  {f.severity} {f.rule} {f.path}: {f.message}" for f in c.report.findings]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Check all and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--time-limit", type=float, default=20.0, help="of a call [s] (default: %(default)g)")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--list", type=Path, metavar="FILE", help="also write every finding there")
    arguments = parser.parse_args()
    tasks = [(path, arguments.time_limit) for path in find(arguments.folders)]
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(arguments.workers, mp_context=spawn) as pool:
        checked = list(pool.map(check_one, tasks))
    print(table(checked))
    if arguments.list:
        arguments.list.write_text(listing(checked), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
