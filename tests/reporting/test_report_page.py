"""Pages as text: complete, safe, reproducible."""

import json
import math
import re
from html.parser import HTMLParser

import pytest

from orchestrator.reporting import Facts, Findings, Plot, Remark, Report, ReportTable, Series, TableColumn, Text, render
from orchestrator.reporting.numbers import in_words, thin_series
from tests.support.report import example


class Structure(HTMLParser):
    """Collects identifiers, links and whether every element is closed in order."""

    VOID = frozenset({"meta", "link", "br"})

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.sources = [], [], [], []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.ids += [given["id"]] if "id" in given else []
        self.links += [given["href"]] if "href" in given else []
        self.sources += [given["src"]] if "src" in given else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def parsed(page):
    structure = Structure()
    structure.feed(page)
    assert structure.open == []
    return structure


def test_the_page_is_well_formed_and_needs_no_network(tmp_path):
    structure = parsed(render(example(tmp_path)))
    assert len(structure.ids) == len(set(structure.ids))
    assert structure.sources == []
    for link in structure.links:
        assert link.startswith(("#", "data:")), link
        if link.startswith("#"):
            assert link[1:] in structure.ids


def test_the_same_report_gives_the_same_bytes(tmp_path):
    assert render(example(tmp_path)) == render(example(tmp_path))


def test_text_from_results_cannot_become_markup():
    evil = "</script><script>alert(1)</script><b>&"
    page = render(
        Report(
            evil,
            evil,
            (
                Text(evil, (evil,)),
                Facts(evil, ((evil, evil),)),
                ReportTable(evil, (TableColumn(evil, evil),), ((evil,),), evil),
                Plot(evil, evil, evil, (Series(evil, [0], [1], labels=[evil]),), note=evil, categories=(evil,)),
                Findings(evil, (Remark("error", evil, evil, evil),)),
            ),
            badge=("bad", evil),
            origin=((evil, evil),),
        )
    )
    assert "alert(1)</script>" not in page
    assert "<b>" not in page
    parsed(page)


def test_plots_travel_as_json_of_ten_digits():
    x = [0.1, 1 / 3, math.pi]
    page = render(Report("t", "s", (Plot("p", "x", "y", (Series("a", x, [1.0, None, 2.0]),)),)))
    data = json.loads(re.search(r'<script type="application/json">(.*?)</script>', page)[1])
    assert data["series"][0]["x"] == [0.1, 0.3333333333, 3.141592654]
    assert data["series"][0]["y"] == [1.0, None, 2.0]


def test_long_tables_say_what_they_leave_out():
    page = render(
        Report("t", "s", (ReportTable("cases", (TableColumn("n"),), tuple((i,) for i in range(30)), limit=20),))
    )
    assert "The first 20 of 30 rows" in page
    assert page.count("<tr>") == 21


def test_large_files_are_linked_and_small_ones_embedded(tmp_path):
    (tmp_path / "small.csv").write_text("a\n1\n")
    (tmp_path / "large.csv").write_text("a\n" * 600_000)
    page = render(Report("t", "s", (), downloads=(tmp_path / "small.csv", tmp_path / "large.csv")))
    assert 'href="data:text/csv;base64,YQoxCg=="' in page
    assert 'href="large.csv"' in page


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 4, "0"),
        (1234567.0, 4, "1.235e6"),
        (0.012345, 3, "0.0123"),
        (123.0, 4, "123"),
        (12345.0, 4, "12345"),
        (1.5e-9, 4, "1.5e-9"),
        (-2e-5, 4, "-2e-5"),
        (1e22, 1, "1e22"),
        (float("nan"), 4, "–"),
        (None, 4, "–"),
        (True, 4, "yes"),
        (12345678, 4, "12345678"),
        ("word", 4, "word"),
    ],
)
def test_numbers_in_words(value, digits, text):
    assert in_words(value, digits) == text


def test_a_thinned_curve_keeps_its_peaks_its_gaps_and_its_ends():
    count = 100_000
    y = [math.sin(i / 3000.0) for i in range(count)]
    y[54_321] = 9.0
    y[54_400] = -9.0
    y[70_000:80_000] = [None] * 10_000
    thin = thin_series(Series("a", list(range(count)), y, labels=[str(i) for i in range(count)]), 1000)
    assert len(thin.x) <= 1002
    assert (max(v for v in thin.y if v is not None), min(v for v in thin.y if v is not None)) == (9.0, -9.0)
    assert None in thin.y
    assert (thin.x[0], thin.x[-1]) == (0, count - 1)
    assert all(thin.labels[i] == str(x) for i, x in enumerate(thin.x))
    few = Series("c", [0, 1, 2, 3], [1.0, 2.0, 2.0, 1.0])
    assert thin_series(few, 4) is few
    cloud = thin_series(Series("b", list(range(count)), y, "points"), 1000)
    assert 900 <= len(cloud.x) <= 1000
