"""Fuzzing of ``check``: damaged FMUs must give findings; never a traceback, a hang or half a result.

    python -m benchmarks.fuzz_check --seconds 600

With ``--version 3.0`` FMUs of FMI 3.0. FMUs whose library is damaged are checked with ``--static`` only: what a random
machine program does is no business of a test.
"""

import argparse
import contextlib
import io
import json
import random
import shutil
import tempfile
import time
from collections import Counter
from pathlib import Path

from orchestrator.cli import main as run
from tests.support.fuzz_fmu import damaged

SLOW = 60.0


def one_case(
    rng: random.Random, folder: Path, run_share: float = 0.25, version: str = "2.0"
) -> tuple[int, set[str], float]:
    """Check one damaged FMU as the command line does.

    Returns:
        Exit code, rules named and duration in s.
    """
    path, out = folder / "damaged.fmu", folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    may_run = damaged(rng, path, version)
    words = ["check", str(path), "--out", str(out), "--json", str(folder / "f.json"), "--junit", str(folder / "f.xml")]
    if not (may_run and rng.random() < run_share):
        words.append("--static")
    began = time.monotonic()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as errors:
        code = run([*words, "--time-limit", "10"])
    duration = time.monotonic() - began
    assert code in (0, 1), f"exit code {code}: {errors.getvalue()}"
    results = json.loads((out / "check.json").read_text(encoding="utf-8"))["results"]
    rules = {f["rule"] for fmu in results["fmus"] for f in fmu["findings"]}
    assert code == int(results["counts"]["error"] > 0)
    assert "run.failed" not in rules, results
    assert sorted(p.name for p in out.iterdir()) == ["check.json", "report.html"]
    return code, rules, duration


def main() -> None:
    """Fuzz for a while and print what came of it; the first failure stops it and keeps the FMU."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--version", choices=("2.0", "3.0"), default="2.0", help="of FMI")
    parser.add_argument("--count", type=int, default=10**9, help="FMUs at most")
    parser.add_argument("--run-share", type=float, default=0.25, help="share of FMUs that are run, where they may")
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    named: Counter[str] = Counter()
    codes: Counter[int] = Counter()
    slowest = 0.0
    end = time.monotonic() + arguments.seconds
    folder = Path(tempfile.mkdtemp(prefix="fuzz-check-"))
    while time.monotonic() < end and codes.total() < arguments.count:
        code, rules, duration = one_case(rng, folder, arguments.run_share, arguments.version)
        assert duration < SLOW, f"took {duration:.0f} s"
        codes[code] += 1
        named.update(rules)
        slowest = max(slowest, duration)
    shutil.rmtree(folder)
    print(f"{codes.total()} damaged FMUs in {arguments.seconds:g} s: {codes[1]} with errors, {codes[0]} without")
    print(f"slowest {slowest:.2f} s; {len(named)} rules named; no traceback, no hang, no partial output")
    for rule, count in named.most_common():
        print(f"{count:7d} {rule}")


if __name__ == "__main__":
    main()
