"""Records as files of the format that is read."""

from pathlib import Path

from orchestrator.records.record import COLUMNS, Record


def write_record(path: Path, record: Record) -> None:
    """Write ``record`` as CSV with the columns of ``COLUMNS`` that it has; missing samples as empty cells."""
    names = [name for name in COLUMNS if getattr(record, name) is not None and (name != "u" or record.has_torque)]
    columns = [getattr(record, name).tolist() for name in names]
    lines = [",".join(names)]
    lines += [
        ",".join("" if value != value else f"{value:.9g}" for value in row)  # noqa: PLR0124
        for row in zip(*columns, strict=True)
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
