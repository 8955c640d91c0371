"""Pages as a whole: every section, series and number, beside their outline in ``outlines/``.

After a change that is meant ``python -m tests.reporting.test_whole_pages`` writes the outlines anew: read what differs.
"""

import os
import tempfile
from pathlib import Path

import pytest

from orchestrator.reporting import report_from_directory
from orchestrator.shared.output import write_result
from tests.support.page_results import PAGES, outline

NOON = 1_000_036_800.0  # of 9 September 2001
FOLDER = Path(__file__).parent / "outlines"


def page_outline(name, folder):
    """The outline of a page."""
    command, arguments, results, files = PAGES[name]
    write_result(folder, command, arguments, 5, results)
    os.utime(folder / f"{command}.json", (NOON, NOON))
    for file, text in files.items():
        (folder / file).write_text(text)
    lines = [line for line in outline(report_from_directory(folder)) if "version" not in line]
    return "\n".join(lines) + "\n"


def place(name):
    return FOLDER / f"{name.replace(' ', '_')}.txt"


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_its_outline(name, tmp_path):
    assert page_outline(name, tmp_path) == place(name).read_text(encoding="utf-8")


def test_every_outline_is_that_of_a_page():
    assert set(FOLDER.iterdir()) == {place(name) for name in PAGES}


if __name__ == "__main__":
    for page in PAGES:
        with tempfile.TemporaryDirectory() as made:
            place(page).write_text(page_outline(page, Path(made)), encoding="utf-8")
