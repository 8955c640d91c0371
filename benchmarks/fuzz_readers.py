"""Fuzz of the readers: damaged files of every format must give a record or a ``RecordError``, and nothing else.

::

    python -m benchmarks.fuzz_readers 60      # seconds

Each case takes one record in one of the twelve dialects, flips, cuts, repeats or inserts bytes, and reads it. What is
counted as a failure is any other exception, or a case that takes longer than ``LONGEST_CASE`` seconds.
"""

import argparse
import random
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

from orchestrator.errors import RecordError
from orchestrator.records.model_file import read_model
from orchestrator.records.record import read_record
from tests.support.dialects import DIALECTS
from tests.support.independent_plant import make_record

LONGEST_CASE = 10.0  # s


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Return the bytes with one to four kinds of damage."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        place = rng.randrange(len(out)) if rng.random() < 0.5 else rng.randrange(min(len(out), 2000))
        kind = rng.randrange(5)
        if kind == 0:
            out[place] = rng.randrange(256)
        elif kind == 1:
            del out[place : place + rng.choice((1, 8, 200, len(out)))]
        elif kind == 2:
            out[place:place] = out[place : place + rng.randint(1, 60)]
        elif kind == 3:
            out[place:place] = rng.choice(
                (b"\x00", b'"', b";", b",", b"\n", b"nan", b"1e999", b"\xff\xff\xff\x7f", b"-")
            )
        else:
            out[place : place + 8] = bytes(rng.randrange(256) for _ in range(8))
        if not out:
            return b""
    return bytes(out)


def main() -> None:
    """Fuzz for some seconds and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", type=float)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    warnings.simplefilter("ignore")
    columns = make_record({"alpha": 0.01}, seed=3, duration=2.0)[0]
    found: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        good = []
        for write in DIALECTS:
            path, text = write(folder, columns)
            model = folder / f"{path.stem}.toml"
            model.write_text(text)
            good.append((write.__name__, path.read_bytes(), read_model(model).columns))
        end = time.monotonic() + arguments.seconds
        while time.monotonic() < end:
            dialect, data, known = rng.choice(good)
            path = folder / "case"
            path.write_bytes(damaged(data, rng))
            begun = time.monotonic()
            try:
                read_record(path, known)
                found["read"] += 1
            except RecordError as error:
                found["refused" if "\n" not in str(error) else "FAILURE: two lines"] += 1
            except Exception as error:
                found[f"FAILURE: {dialect}: {type(error).__name__}"] += 1
                traceback.print_exc(limit=-3)
            if time.monotonic() - begun > LONGEST_CASE:
                found["FAILURE: slow"] += 1
    print(", ".join(f"{name} {count}" for name, count in sorted(found.items())))


if __name__ == "__main__":
    main()
