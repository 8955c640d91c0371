"""How often each grade of a name is right, and how many intervals hold the value, over the rows of other benchmarks.

    python -m benchmarks.calibration ROWS.jsonl ...

The rows are those that ``benchmarks.diagnosis``, ``outside_class`` and ``measured`` keep under ``--out``: one table for
each file, and one for all.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.judging import Row, grade_table, size_line
from benchmarks.rows import read_rows


def calibration_text(title: str, rows: Sequence[Row]) -> str:
    """Return the Markdown of one kind of records: their number, the table of grades, sizes.

    Args:
        title: what records they are.
        rows: of the records.

    Returns:
        The text.
    """
    return "\n".join(("", f"{title}: {len(rows)} records", "", grade_table(rows), "", size_line(rows)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="+", type=Path)
    args = parser.parse_args()
    files = {path: read_rows(path) for path in args.rows}
    for path, rows in files.items():
        print(calibration_text(str(path), rows))
    if len(files) > 1:
        print(calibration_text("all", [row for rows in files.values() for row in rows]))


if __name__ == "__main__":
    main()
