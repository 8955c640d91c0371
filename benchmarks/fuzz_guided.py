"""Coverage-guided fuzz of everything that reads files: records, models, maps, scenarios, SSP, SSV, FMU archives.

    python -m benchmarks.fuzz_guided record --seconds 600 --corpus corpus   # needs atheris
    python -m benchmarks.fuzz_guided record --measure --corpus corpus       # needs coverage

Targets are those of ``tests/support/fuzz_targets.py``. Any exception that is not one of the project's errors with one
line of text, and any case beyond ``SLOW`` seconds of processor time, is a finding: kept as ``findings/TARGET-*``, each
place in the code once. ``--measure`` reads the corpus that a fuzz has left, and prints which share of the lines of the
rooms concerned it reaches.
"""

import argparse
import hashlib
import os
import random
import sys
import time
import traceback
from collections import Counter
from pathlib import Path

ROOMS = {
    "record": ("records",),
    "model": ("records/model_file.py", "records/columns.py"),
    "map_file": ("diagnosis/fmu/mapping.py",),
    "scenario": ("scenarios/scenario.py", "scenarios/definition.py"),
    "ssp": ("scenarios/ssp/read.py", "scenarios/ssp/common.py", "shared/isolation/archives.py"),
    "ssd": ("scenarios/ssp/read.py", "scenarios/ssp/common.py"),
    "ssv": ("scenarios/ssp/parameters.py", "scenarios/ssp/common.py"),
    "archive": ("checking", "shared/isolation/archives.py", "fmi/model_description.py"),
    "description": ("checking", "fmi/model_description.py"),
}
SLOW = 10.0


class Findings:
    """What went wrong, each place once."""

    def __init__(self, target: str, folder: Path) -> None:
        self.target, self.folder = target, folder
        self.places: Counter[str] = Counter()
        self.cases = self.accepted = 0
        self.began = time.process_time()

    def run(self, function, data: bytes) -> None:
        """Run one case."""
        self.cases += 1
        began = time.process_time()
        try:
            self.accepted += function(data)
        except Exception as error:
            frames = [f for f in traceback.extract_tb(error.__traceback__) if "/orchestrator/" in f.filename]
            where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"
            self._keep(f"{type(error).__name__} at {where}: {str(error)[:200]}", data)
        if time.process_time() - began > SLOW:
            self._keep("slow", data)

    def _keep(self, place: str, data: bytes) -> None:
        key = place.partition(": ")[0]
        self.places[key] += 1
        if self.places[key] == 1:
            self.folder.mkdir(exist_ok=True)
            name = f"{self.target}-{hashlib.sha256(data).hexdigest()[:12]}"
            (self.folder / name).write_bytes(data)
            print(f"FINDING {place} ({name})", flush=True)

    def summary(self) -> str:
        """One line."""
        minutes = (time.process_time() - self.began) / 60.0
        found = ", ".join(f"{k} ({n})" for k, n in self.places.items()) or "none"
        done = f"{self.cases} inputs in {minutes:.1f} min of processor time, {self.accepted} accepted"
        return f"{self.target}: {done}; findings: {found}"


def guided(arguments: argparse.Namespace) -> None:
    """Let atheris look for inputs that reach new lines."""
    import atheris

    with atheris.instrument_imports(include=["orchestrator"], enable_loader_override=False):
        from tests.support import fuzz_targets
    function = fuzz_targets.TARGETS[arguments.target]
    corpus = arguments.corpus / arguments.target
    corpus.mkdir(parents=True, exist_ok=True)
    for name, data in fuzz_targets.seeds(arguments.target).items():
        (corpus / f"seed-{name}").write_bytes(data)
    findings = Findings(arguments.target, arguments.corpus / "findings")
    end = time.process_time() + arguments.seconds

    def run_input(data: bytes) -> None:
        findings.run(function, data)
        if time.process_time() > end:
            print(findings.summary(), flush=True)
            os._exit(0)  # atheris knows no other end

    options = [sys.argv[0], str(corpus), "-max_len=60000", "-timeout=120", "-rss_limit_mb=3000", "-verbosity=0",
               f"-seed={arguments.seed}"]  # fmt: skip
    atheris.Setup(options, run_input)
    atheris.Fuzz()


def measured(arguments: argparse.Namespace) -> None:
    """Run the corpus once under coverage and print the share of lines it reaches."""
    import coverage

    root = Path(__file__).parents[1] / "orchestrator"
    include = [str(root / r) + ("" if r.endswith(".py") else "/*") for r in ROOMS[arguments.target]]
    measure = coverage.Coverage(data_file=None, branch=True, include=include, config_file=False)
    measure.start()
    from tests.support import fuzz_targets

    findings = Findings(arguments.target, arguments.corpus / "findings")
    files = sorted((arguments.corpus / arguments.target).iterdir())
    random.Random(1).shuffle(files)
    for path in files[: arguments.most]:
        findings.run(fuzz_targets.TARGETS[arguments.target], path.read_bytes())
    measure.stop()
    print(findings.summary())
    print(f"{arguments.target}: {len(files)} files in the corpus")
    measure.report(show_missing=False, skip_covered=False)


def main() -> None:
    """Fuzz or measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", choices=ROOMS)
    parser.add_argument("--seconds", type=float, default=600.0, help="processor time")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--corpus", type=Path, default=Path("corpus"))
    parser.add_argument("--measure", action="store_true")
    parser.add_argument("--most", type=int, default=3000, help="files of the corpus that are measured")
    arguments = parser.parse_args()
    (measured if arguments.measure else guided)(arguments)


if __name__ == "__main__":
    main()
