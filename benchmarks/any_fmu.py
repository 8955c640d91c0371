"""Diagnosis of any FMU on records of independent equations: what is right by group and grade.

    python -m benchmarks.any_fmu --singles 40 --clean 16 --doubles 8 --unknown 12 --seed 20000 [--foreign DIR]

``--foreign``: a folder with the FMUs of others that ``any_fmu_plants`` names; without it only those in C take part.
``--records DIR``: instead of making records, those of a folder with ``fmus/`` and ``records/*.truth.json``.
One line a record as it goes, in two processes; the figures at the end. An interrupted run goes on where it stopped
(``--out`` keeps its lines). Seeds below 10000 were used in development.
"""

import argparse
import json
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.any_fmu_plants import INSIDE, PLANTS, Plant
from benchmarks.any_fmu_records import Case, Maker
from benchmarks.diagnosis import print_figures
from benchmarks.judging import Row, Truth, judge, parameter_line
from benchmarks.rows import run_tasks
from benchmarks.verdicts import diagnose_with_fmu
from orchestrator.effects.of_fmus import BANK
from tests.support.box_fmu import DOMAINS, write_fmu, write_map, write_scenario
from tests.support.box_records import coupled_record, record, write_record

SAME = {"input_offset": "load", "load": "input_offset"}
LEAST, MOST = 3.0, 60.0
"""Sizes of effects: what they change at an output, over its noise."""
SMALL = 0.5
"""What an effect changes beyond what parameters and another effect take up, over the noise; below, it counts apart."""
EXAMPLES = {"Spring": ("coulomb_friction",), "Tanks": ("input_saturation",), "Circuit": ()}
GAP = 0.006
"""Gap between the two FMUs of the last example [rad]."""


@dataclass(frozen=True)
class Hidden:
    """What is hidden in a record: effects, the value of the first parameter of each, and the FMU's parameters."""

    group: str
    names: tuple[str, ...]
    sizes: tuple[float, ...]
    parameters: dict[str, float]

    @property
    def truth(self) -> Truth:
        """Return what must be named, and with which values."""
        if self.group == "unknown":
            return Truth()
        expected = tuple((name, SAME.get(name, name)) for name in self.names)
        sizes = {
            name: {next(iter(BANK[name].parameters)): (size, 0.0)}
            for name, size in zip(self.names, self.sizes, strict=True)
            if name != "ripple"  # its size is that of a sine and a cosine together
        }
        return Truth(expected, sizes=sizes, parameters=self.parameters)


@dataclass(frozen=True)
class MadeTask:
    """A record to be made: its group and number there, its plant, and how it is made."""

    group: str
    number: int
    plant: int
    fmu: Path
    seed: int
    rows: int
    disturbance: float

    @property
    def key(self) -> str:
        """Return what tells it from every other record."""
        return f"{self.group}-{self.seed}-{self.number}"

    def make(self) -> Case:
        """Return the record."""
        rng = np.random.default_rng([self.seed, len(self.group), self.number])
        plant = next(p for p in PLANTS if p.number == self.plant)
        names = hidden_names(self.group, plant, int(rng.integers(1000)))
        closed = bool(plant.loop) and (rng.random() < 0.4 or plant.number == 11)
        return Maker(plant, rng, self.rows, closed, self.disturbance).case(names, LEAST, MOST)

    def write(self, folder: Path) -> tuple[tuple[Path, Path, Path], Hidden]:
        """Write record and map into a folder; return record, FMU and map, and what is hidden."""
        case = self.make()
        files = (case.write(folder / "record.csv"), self.fmu, case.plant.map(folder / "map.toml"))
        small = self.group in ("single", "double") and case.told < SMALL
        parameters = dict(zip(case.plant.parameters, case.parameters, strict=True))
        return files, Hidden(f"{self.group}, small" if small else self.group, case.names, case.sizes, parameters)


@dataclass(frozen=True)
class GivenTask:
    """A record of a folder, by the file that says what is hidden in it."""

    path: Path

    @property
    def key(self) -> str:
        """Return what tells it from every other record."""
        return self.path.name

    def write(self, folder: Path) -> tuple[tuple[Path, Path, Path], Hidden]:
        """Write a map into a folder; return record, FMU and map, and what is hidden."""
        said = json.loads(self.path.read_text(encoding="utf-8"))
        plant = next(p for p in PLANTS if p.name == said["fmu"])
        case = said["case"]
        group = "none" if case is None else "unknown" if case.startswith("unknown") else "single"
        record_path = self.path.with_name(self.path.name.replace(".truth.json", ".csv"))
        files = (record_path, self.path.parent.parent / "fmus" / plant.name, plant.map(folder / "map.toml"))
        names, sizes = ((case,), (said["truth"]["size"],)) if group == "single" else ((), ())
        return files, Hidden(group, names, sizes, dict(zip(plant.parameters, said["truth"]["p"], strict=False)))


Task = MadeTask | GivenTask


def hidden_names(group: str, plant: Plant, turn: int) -> tuple[str, ...]:
    """Return what is hidden in a record.

    Args:
        group: of the record.
        plant: that it is made of.
        turn: random number.

    Returns:
        Names of effects.
    """
    if group == "none":
        return ()
    if group == "double":
        before = [e for e in plant.effects if e.startswith("input_")]
        behind = [e for e in plant.effects if not e.startswith("input_")]
        return before[turn % len(before)], behind[(turn // 7) % len(behind)]
    choice = plant.effects if group == "single" else (*plant.unknown, *((INSIDE,) if plant.inside else ()))
    return (choice[turn % len(choice)],)


def made_tasks(args: argparse.Namespace, fmus: dict[int, Path]) -> Iterator[MadeTask]:
    """Yield the records that are to be made; plants take turns, every second round of clean ones has a disturbance."""
    plants = [p for p in PLANTS if p.number in fmus and (not args.plants or p.number in args.plants)]
    for group, count in (("single", args.singles), ("none", args.clean), ("double", args.doubles),
                         ("unknown", args.unknown)):  # fmt: skip
        chosen = [p for p in plants if group != "double" or "quadratic_drag" in p.effects]
        for k in range(count):
            disturbance = 0.01 if group == "none" and (k // len(chosen)) % 2 else args.disturbance
            number = chosen[k % len(chosen)].number
            yield MadeTask(group, k, number, fmus[number], args.seed, args.rows, disturbance)


def diagnose_task(task: Task) -> Row:
    """Return what a diagnosis says of one record, and what of that is right.

    Args:
        task: the record.

    Returns:
        The row.
    """
    with tempfile.TemporaryDirectory() as name:
        files, hidden = task.write(Path(name))
        outcome = diagnose_with_fmu(*files)
    said = ", ".join(f"{n} {size:.3g}" for n, size in zip(hidden.names, hidden.sizes, strict=True))
    shown = f"{files[1].stem}: {said or 'nothing'}"
    kind = "+".join(hidden.names) or hidden.group
    return Row(task.key, hidden.group, kind, outcome, judge(outcome, hidden.truth), shown)


def print_verdicts(rows: Sequence[Row]) -> None:
    """Print how often each verdict was given in each group, and how often intervals hold the FMU's parameters.

    Args:
        rows: of records.
    """
    counts = Counter((row.group, row.outcome.verdict or "refused") for row in rows)
    for group in dict.fromkeys(row.group for row in rows):
        print(f"verdicts, {group}: {', '.join(f'{n} {v}' for (g, v), n in sorted(counts.items()) if g == group)}")
    print(parameter_line([row for row in rows if row.is_right() and row.group != "unknown"]))


def write_examples(folder: Path) -> None:
    """Write the FMUs, maps and records of the documentation's examples.

    Args:
        folder: that they go into.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for domain in DOMAINS:
        if domain.name in EXAMPLES:
            case = record(domain, EXAMPLES[domain.name], np.random.default_rng(7), 1200)
            write_fmu(folder / f"{domain.name}.fmu", domain)
            write_map(folder / f"{domain.name}.toml", domain)
            write_record(folder / f"{domain.name}.csv", case)
            print(f"{domain.name}: hidden {dict(zip(case.names, case.sizes, strict=True))}, values {case.parameters}")
    write_scenario(folder)
    coupled_record(folder / "loop.csv", np.random.default_rng(3), 700, gap=GAP)
    print(f"loop: hidden backlash {GAP:g} rad")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    counts = {"singles": 40, "clean": 16, "doubles": 8, "unknown": 12, "rows": 1200, "seed": 20000, "processes": 2}
    for name, count in counts.items():
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--foreign", type=Path, metavar="DIR", help="FMUs of others, by the names of their plants")
    parser.add_argument("--records", type=Path, metavar="DIR", help="judge the records of a folder")
    parser.add_argument("--disturbance", type=float, default=0.0, help="coloured noise at the port, over the drive")
    parser.add_argument("--plants", type=int, nargs="*", default=[], help="numbers of the plants that take part")
    parser.add_argument("--write", type=Path, metavar="DIR", help="write the examples of the documentation, and stop")
    parser.add_argument("--out", type=Path, default=Path("results/bench_any_fmu"))
    args = parser.parse_args()
    if args.write is not None:
        write_examples(args.write)
        return
    with tempfile.TemporaryDirectory() as name:
        fmus = {p.number: path for p in PLANTS if (path := p.fmu(Path(name), args.foreign)) is not None}
        tasks: list[Task] = list(made_tasks(args, fmus))
        if args.records is not None:
            tasks = [GivenTask(path) for path in sorted((args.records / "records").glob("*.truth.json"))]
        source = f"seed-{args.seed}" if args.records is None else args.records.name
        rows = run_tasks(tasks, diagnose_task, args.out / f"rows-{source}.jsonl", args.processes)
    if rows:
        print_figures(rows)
        print_verdicts(rows)


if __name__ == "__main__":
    main()
