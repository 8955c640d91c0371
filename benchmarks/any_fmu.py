"""Benchmark of the diagnosis of any FMU: records of independent equations around FMUs of many exporters.

    python -m benchmarks.any_fmu --singles 40 --clean 16 --doubles 8 --unknown 12 --seed 20000 [--foreign DIR]

``--foreign``: a folder with the FMUs of others that ``any_fmu_plants`` names; without it only those in C take part.
``--records DIR``: instead of making records, those of a folder with ``fmus/`` and ``records/*.truth.json``.
One line a record, then the rates. Seeds below 10000 were used in development.
"""

import argparse
import json
import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.any_fmu_plants import INSIDE, PLANTS, Case, Maker, Plant
from orchestrator.api.any_fmu import FmuDiagnosisResult
from orchestrator.api.diagnose import diagnose
from orchestrator.diagnosis.fmu.deliver import deliver
from orchestrator.errors import OrchestratorError
from tests.support.box_fmu import DOMAINS, coupled_record, record, write_fmu, write_map, write_record, write_scenario

SAME = {"input_offset": "load", "load": "input_offset"}
LEAST, MOST = 3.0, 60.0
"""Sizes of effects: what they change at an output, over its noise."""
QUICK = 10e-6
"""Step of an FMU [s] up to which the time of a record is counted apart."""
TOLD = 0.5
"""What an effect must change beyond what parameters and another effect take up, over the noise, to be counted apart."""


def cases(args: argparse.Namespace, plants: list[Plant]) -> Iterator[tuple[str, Case]]:
    """Yield kind and case."""
    for kind in ("single", "clean", "double", "unknown"):
        for k in range(getattr(args, f"{kind}s" if kind in ("single", "double") else kind)):
            rng = np.random.default_rng([args.seed, len(kind), k])
            plant = plants[k % len(plants)]
            turn = int(rng.integers(1000))
            names: tuple[str, ...] = ()
            if kind == "single":
                names = (plant.effects[turn % len(plant.effects)],)
            elif kind == "double":
                moving = [p for p in plants if "quadratic_drag" in p.effects]
                plant = moving[k % len(moving)]
                before = [e for e in plant.effects if e.startswith("input_")]
                behind = [e for e in plant.effects if not e.startswith("input_")]
                names = (before[turn % len(before)], behind[(turn // 7) % len(behind)])
            elif kind == "unknown":
                hidden = (*plant.unknown, *((INSIDE,) if plant.inside else ()))
                names = (hidden[turn % len(hidden)],)
            closed = bool(plant.loop) and (rng.random() < 0.4 or plant.number == 11)
            disturbance = 0.01 if kind == "clean" and (k // len(plants)) % 2 else args.disturbance
            yield kind, Maker(plant, rng, args.rows, closed, disturbance).case(names, LEAST, MOST)


EXAMPLES = {"Spring": ("coulomb_friction",), "Tanks": ("input_saturation",), "Circuit": ()}


GAP = 0.006
"""Gap between the two FMUs of the last example [rad]."""


def write_examples(folder: Path) -> None:
    """Write the FMUs, maps and records of the documentation's examples."""
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


def right(kind: str, names: tuple[str, ...], found: FmuDiagnosisResult) -> str:
    """Return "right", "family", "partly", "missed" or "wrong" (a name that is not there comes first)."""
    named = [f.effect.kind.name for f in found.effects]
    if kind == "clean":
        return "right" if found.verdict in ("none", "parameters") else "missed" if not named else "wrong"
    if kind == "unknown":
        return "right" if found.verdict == "unknown" else "wrong"
    families = [{f.effect.kind.name, *(name.partition("@")[0] for name in f.family)} for f in found.effects]
    families = [family | {SAME[name] for name in family if name in SAME} for family in families]
    if set(named) == set(names):
        return "right"
    if len(named) == len(names) and all(any(n in f for f in families) for n in names):
        return "family"
    if not named:
        return "missed"
    return "partly" if families[0] & set(names) else "wrong"


def processor_time() -> float:
    """Return the seconds that this process and its ended children have computed."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


@dataclass
class Tally:
    """What came out."""

    counts: dict[str, dict[str, int]] = field(default_factory=dict)
    trusts: dict[str, dict[str, int]] = field(default_factory=dict)
    told: dict[str, dict[str, int]] = field(default_factory=dict)
    misfits: dict[str, list[float]] = field(default_factory=dict)
    errors: list[float] = field(default_factory=list)
    z: list[float] = field(default_factory=list)
    z_sizes: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    passed: list[tuple[float, float]] = field(default_factory=list)
    """Time that passed [s], and the cost of a step [s], of each record."""
    delivered: list[float] = field(default_factory=list)
    """Difference of each corrected system from its fit, over the noise."""

    def take(self, kind: str, verdict: str, names: tuple[str, ...], sizes: tuple[float, ...],
             parameters: tuple[float, ...], found: FmuDiagnosisResult, told: float) -> None:  # fmt: skip
        """Count one record."""
        self.counts.setdefault(kind, {}).setdefault(verdict, 0)
        self.counts[kind][verdict] += 1
        if names:
            which = f"{kind}, told by {TOLD:g} of the noise at {'least' if told >= TOLD else 'most'}"
            of_told = self.told.setdefault(which, {})
            of_told[verdict] = of_told.get(verdict, 0) + 1
        of_level = self.trusts.setdefault(found.trust.level.word, {})
        of_level[verdict] = of_level.get(verdict, 0) + 1
        self.misfits.setdefault(kind, []).append(max(m.corrected for m in found.outcome.misfit))
        if verdict != "right" or kind == "unknown":
            return
        for f in found.effects:
            e, size = f.estimates[0], dict(zip(names, sizes, strict=True))[f.effect.kind.name]
            if f.effect.kind.name == "ripple":  # sine and cosine of an amplitude
                self.errors.append(abs(np.hypot(e.value, f.estimates[1].value) / size - 1.0))
                continue
            self.errors.append(abs(e.value / size - 1.0))
            self.z_sizes.append((e.value - size) / e.standard_error)
        for e, value in zip(found.outcome.parameters, parameters, strict=False):
            self.z.append((e.value - value) / e.standard_error)

    def show(self) -> None:
        """Print the rates."""
        for kind, counts in (*self.counts.items(), *self.told.items(), *self.trusts.items()):
            listed = ", ".join(f"{k} {n}" for k, n in sorted(counts.items()))
            print(f"{kind}: {sum(counts.values())} records; {listed}")
        for kind, misfits in self.misfits.items():
            print(f"misfit over noise, {kind}: median {np.median(misfits):.3f}, 90 % {np.quantile(misfits, 0.9):.3f}")
        if self.errors:
            percent = (100 * np.quantile(self.errors, q) for q in (0.5, 0.9))
            print("error of the size: median {:.3f} %, 90 % {:.3f} %".format(*percent))
        for which, z in (("parameters", self.z), ("sizes", self.z_sizes)):
            if z:
                print(f"{which} within their 95 % intervals: {100 * np.mean(np.abs(z) < 1.96):.1f} % of {len(z)}")
        if self.seconds:
            print(f"processor time a record [s]: median {np.median(self.seconds):.1f}, most {max(self.seconds):.1f}")
        for which, most in (("", np.inf), (f", {1e6 * QUICK:g} us a step at most", QUICK)):
            passed = [seconds for seconds, cost in self.passed if cost <= most]
            if passed:
                quantiles = "median {:.1f}, 99 % {:.1f}, most {:.1f}".format(*np.quantile(passed, (0.5, 0.99, 1.0)))
                print(f"time that passed a record [s], {len(passed)} records{which}: {quantiles}")
        if self.delivered:
            shown = "median {:.3g}, most {:.3g}".format(*np.quantile(self.delivered, (0.5, 1.0)))
            print(f"{len(self.delivered)} corrected.ssp, difference from the fit over the noise: {shown}")


def judged(tally: Tally, kind: str, label: str, names: tuple[str, ...], sizes: tuple[float, ...],
           parameters: tuple[float, ...], files: tuple[Path, Path, Path], told: float = np.inf,
           delivers: bool = False) -> None:  # fmt: skip
    """Diagnose one record, print a line."""
    begun, at = processor_time(), time.monotonic()
    try:
        found = diagnose(*files)
    except OrchestratorError as error:
        print(f"{kind:8s}{label} ERROR {error}", flush=True)
        tally.counts.setdefault(kind, {}).setdefault("error", 0)
        tally.counts[kind]["error"] += 1
        return
    o = found.outcome
    tally.passed.append((time.monotonic() - at, o.problem.runner.step_cost))
    if delivers and found.effects:
        before = processor_time()
        tally.delivered.append(deliver(files[0].with_name("corrected.ssp"), o).difference)
        begun += processor_time() - before
    found.close()
    tally.seconds.append(processor_time() - begun)
    verdict = right(kind, names, found)
    tally.take(kind, verdict, names, sizes, parameters, found, told)
    level = found.trust.level.word
    shown = ", ".join(
        f"{f.effect.label}={f.estimates[0].value:.5g} +- {f.estimates[0].standard_error:.2g}" for f in found.effects
    )
    print(
        f"{kind:8s}{label} {verdict:7s}{found.verdict:10s} {level:5s} {shown} "
        f"true {', '.join(f'{s:.5g}' for s in sizes)} "
        f"misfit {max(m.corrected for m in o.misfit):.3f} {tally.seconds[-1]:.1f} s {tally.passed[-1][0]:.1f} s passed "
        f"{o.runs} runs of {1e6 * tally.passed[-1][1]:.2g} us a step "
        f"{f'ssp {tally.delivered[-1]:.2g} ' if delivers and found.effects else ''}"
        f"{[f.family for f in found.effects if f.family] or ''} {o.suspects or ''} "
        f"{'' if verdict == 'right' else o.rest.reasons}",
        flush=True,
    )


def given_records(folder: Path, tally: Tally) -> None:
    """Judge the records of a folder: FMUs under ``fmus``, what is hidden in ``*.truth.json``."""
    with tempfile.TemporaryDirectory() as name:
        for path in sorted((folder / "records").glob("*.truth.json")):
            truth = json.loads(path.read_text(encoding="utf-8"))
            plant = next(p for p in PLANTS if p.name == truth["fmu"])
            case = truth["case"]
            kind = "clean" if case is None else "unknown" if case.startswith("unknown") else "single"
            hidden = truth["truth"]
            record_ = path.with_name(path.name.replace(".truth.json", ".csv"))
            files = (record_, folder / "fmus" / plant.name, plant.map(Path(name) / "map.toml"))
            names, sizes = ((case,), (hidden["size"],)) if kind == "single" else ((), ())
            judged(tally, kind, f"{record_.stem:40s}", names, sizes, tuple(hidden["p"]), files)


def made_records(args: argparse.Namespace, tally: Tally) -> None:
    """Make records and judge them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fmus = {p.number: path for p in PLANTS if (path := p.fmu(folder, args.foreign)) is not None}
        plants = [p for p in PLANTS if p.number in fmus and (not args.plants or p.number in args.plants)]
        print(f"{len(plants)} FMUs of {sorted({p.exporter for p in plants})}, {sorted({p.domain for p in plants})}")
        for kind, case in cases(args, plants):
            files = (case.write(folder / "record.csv"), fmus[case.plant.number], case.plant.map(folder / "map.toml"))
            label = (f"{case.plant.name[:14]:15s}{'closed' if case.closed else 'open':7s}{'+'.join(case.names):42s}"
                     f"{case.ratio:7.1f} {case.told:6.2f}")  # fmt: skip
            judged(tally, kind, label, case.names, case.sizes, case.parameters, files, case.told, args.deliver)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    counts = {"singles": 40, "clean": 16, "doubles": 8, "unknown": 12, "rows": 1200, "seed": 20000}
    for name, count in counts.items():
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--foreign", type=Path, metavar="DIR", help="FMUs of others, by the names of their plants")
    parser.add_argument("--records", type=Path, metavar="DIR", help="judge the records of a folder")
    parser.add_argument("--disturbance", type=float, default=0.0, help="coloured noise at the port, over the drive")
    parser.add_argument("--deliver", action="store_true", help="write and run corrected.ssp, compare it to the fit")
    parser.add_argument("--plants", type=int, nargs="*", default=[], help="numbers of the plants that take part")
    parser.add_argument("--write", type=Path, metavar="DIR", help="write the examples of the documentation, and stop")
    args = parser.parse_args()
    if args.write is not None:
        write_examples(args.write)
        return
    tally = Tally()
    if args.records is not None:
        given_records(args.records, tally)
    else:
        made_records(args, tally)
    tally.show()


if __name__ == "__main__":
    main()
