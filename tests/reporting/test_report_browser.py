"""Pages in a real browser: no console message, no request, sorting, hovering, zooming, keys, themes, paper."""

import base64
import json
from xml.etree import ElementTree

import numpy as np
import pytest

from orchestrator.reporting import Facts, Plot, Report, ReportTable, Series, TableColumn, render, write_report
from orchestrator.shared.output import write_result
from tests.support import browser as browsers
from tests.support.page_results import PAGES
from tests.support.report import example

pytestmark = pytest.mark.skipif(bool(browsers.missing()), reason=browsers.missing() or "never")


@pytest.fixture(scope="module")
def driver():
    with browsers.browser(requests=True) as started:
        yield started


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    directory = tmp_path_factory.mktemp("page")
    path = directory / "report.html"
    path.write_text(render(example(directory)))
    return path


@pytest.fixture
def opened(driver, page):
    """The page, freshly opened at desktop width; whatever it logs fails the test."""
    driver.get_log("browser")
    driver.get_log("performance")
    browsers.set_screen(driver, 1280, 900, "light")
    browsers.open_page(driver, page.as_uri())
    yield driver
    assert driver.get_log("browser") == []


def keys(driver, selector, *presses):
    from selenium.webdriver.common.by import By

    driver.find_element(By.CSS_SELECTOR, selector).send_keys(*presses)


def test_nothing_is_asked_of_the_network(opened, page):
    messages = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    asked = [m["params"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    urls = [a["request"]["url"] for a in asked if a["documentURL"] == page.as_uri()]
    assert [url for url in urls if not url.startswith("data:")] == [page.as_uri()]


@pytest.mark.parametrize("width", [1280, 390, 320])
def test_the_page_is_never_wider_than_the_screen(opened, width):
    browsers.set_screen(opened, width, 800, "light")
    assert opened.execute_script("return document.documentElement.scrollWidth") <= width
    for selector in (".plot svg", ".tools", "h1"):
        edges = f"[...document.querySelectorAll('{selector}')].map(e => e.getBoundingClientRect().right)"
        script = f"return Math.max(...{edges})"
        assert opened.execute_script(script) <= width


def test_every_plot_draws_its_marks_inside_its_frame(opened):
    script = """
    return [...document.querySelectorAll("figure.plot svg")].map(svg => {
      const paths = [...svg.querySelectorAll("path")];
      const values = [...svg.querySelectorAll("*")].flatMap(e => [...e.attributes].map(a => a.value));
      const broken = values.some(value => /NaN|Infinity|undefined/.test(value));
      return [paths.length, broken, svg.querySelectorAll("text").length];
    });
    """
    for marks, broken, texts in opened.execute_script(script):
        assert marks > 0
        assert not broken
        assert texts > 6


def test_tables_sort_by_number_and_by_word_with_keys_only(opened):
    column = "return [...document.querySelectorAll('tbody tr')].map(r => r.cells[{}].dataset.key)"
    keys(opened, "th:nth-child(2) button", "\n")
    values = [float(v) for v in opened.execute_script(column.format(1))]
    assert values == sorted(values)
    assert opened.execute_script("return document.querySelectorAll('th')[1].getAttribute('aria-sort')") == "ascending"
    keys(opened, "th:nth-child(2) button", "\n")
    assert [float(v) for v in opened.execute_script(column.format(1))] == sorted(values, reverse=True)
    keys(opened, "th:nth-child(3) button", " ")
    words = opened.execute_script(column.format(2))
    assert words == sorted(words)
    assert opened.execute_script("return document.querySelectorAll('th[aria-sort]').length") == 1


def test_arrow_keys_read_the_points_and_change_the_series(opened):
    from selenium.webdriver.common.keys import Keys

    plot = "#section-4 figure"
    keys(opened, f"{plot} svg", Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    said = opened.execute_script(f"return document.querySelector('{plot} [aria-live]').textContent")
    assert said.startswith("time [s]: 0.01, with backlash: 0.0099")
    keys(opened, f"{plot} svg", Keys.ARROW_DOWN)
    assert opened.execute_script(f"return !document.querySelector('{plot} .tip').hidden")
    keys(opened, f"{plot} svg", Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    said = opened.execute_script(f"return document.querySelector('{plot} [aria-live]').textContent")
    assert said.startswith("time [s]: 20,")


def ticks(driver, plot):
    return driver.execute_script(f"return [...document.querySelectorAll('{plot} svg text')].map(t => t.textContent)")


def test_plus_zooms_and_zero_shows_everything_again(opened):
    plot = "#section-4 figure"
    before = ticks(opened, plot)
    keys(opened, f"{plot} svg", "+", "+")
    assert ticks(opened, plot) != before
    keys(opened, f"{plot} svg", "0")
    assert ticks(opened, plot) == before


def test_the_mouse_reads_values_zooms_and_resets(opened):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    svg = opened.find_element(By.CSS_SELECTOR, "#section-3 figure svg")
    before = ticks(opened, "#section-3")
    chain = ActionChains(opened)
    chain.move_to_element(svg).perform()
    tip = opened.find_element(By.CSS_SELECTOR, "#section-3 .tip")
    assert "estimate:" in tip.text
    assert "case " in tip.text
    frame, box = svg.rect, tip.rect
    assert frame["x"] <= box["x"]
    assert box["x"] + box["width"] <= frame["x"] + frame["width"]
    assert frame["y"] <= box["y"]
    assert box["y"] + box["height"] <= frame["y"] + frame["height"]
    chain.move_to_element_with_offset(svg, -100, 0).click_and_hold().move_by_offset(150, 60).release().perform()
    assert ticks(opened, "#section-3") != before
    chain.double_click(svg).perform()
    assert ticks(opened, "#section-3") == before


def touch(driver, kind, *places):
    points = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(places)]
    driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def test_one_finger_moves_a_plot_and_two_stretch_it(opened):
    browsers.set_screen(opened, 390, 800, "light")
    opened.execute_script("Plot.all[1].svg.scrollIntoView({ block: 'center', behavior: 'instant' })")
    found = "const plot = Plot.all[1], box = plot.svg.getBoundingClientRect(); "
    left, top, width = opened.execute_script(
        f"{found} return [box.left + plot.x.from, box.top + 60, plot.x.to - plot.x.from]"
    )
    shown = f"{found} return [...plot.range.x, ...plot.range.y]"
    low, high, bottom, most = opened.execute_script(shown)
    opened.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
    try:
        touch(opened, "touchStart", (left + 0.75 * width, top))
        for share in (0.7, 0.6, 0.5):
            touch(opened, "touchMove", (left + share * width, top))
        touch(opened, "touchEnd")
        moved = opened.execute_script(shown)
        touch(opened, "touchStart", (left + 0.4 * width, top), (left + 0.6 * width, top))
        for share in (0.35, 0.3):
            touch(opened, "touchMove", (left + share * width, top), (left + (1 - share) * width, top))
        touch(opened, "touchEnd")
        stretched = opened.execute_script(shown)
    finally:
        opened.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
    span = high - low
    assert moved == pytest.approx([low + 0.25 * span, high + 0.25 * span, bottom, most], abs=0.02 * span)
    assert stretched[1] - stretched[0] == pytest.approx(0.5 * span, rel=0.05)
    assert sum(stretched[:2]) == pytest.approx(sum(moved[:2]), abs=0.05 * span)


def saved(driver, number, name):
    """What a plot's button saves."""
    driver.execute_script(
        "URL.createObjectURL = (blob) => { window.saved = blob; return '#'; };"
        "HTMLAnchorElement.prototype.click = () => {};"
        "const all = document.querySelectorAll('figure.plot')[arguments[0]].querySelectorAll('.buttons button');"
        "[...all].find((one) => one.textContent === arguments[1]).click()", number, name)  # fmt: skip
    return driver.execute_async_script("window.saved.text().then(arguments[0])")


def test_a_plot_saves_its_picture_and_the_numbers_in_view(opened):
    opened.execute_script(
        "const p = Plot.all[1]; p.legend.querySelectorAll('button')[2].click(); p.go([1.0, 1.05], p.range.y)"
    )
    lines = saved(opened, 1, "CSV").splitlines()
    assert lines[0] == '"curve","time [s]","position [rad]","low","high"'
    assert [line.split(",")[:2] for line in lines[1:]] == [
        [f'"{name}"', f"{1 + n / 100:.12g}"] for name in ("with backlash", "without") for n in range(6)
    ]
    picture = ElementTree.fromstring(saved(opened, 1, "SVG"))
    texts = ["".join(one.itertext()) for one in picture.iter("{http://www.w3.org/2000/svg}text")]
    assert texts[:3] == ["Load position", "with backlash", "without"]
    assert "var(" not in ElementTree.tostring(picture, encoding="unicode").replace("clip-path", "")
    curves = [one for one in picture.iter("{http://www.w3.org/2000/svg}path") if one.get("class") == "curve"]
    assert len(curves) == 2
    assert all("stroke: rgb(" in one.get("style") for one in curves)


def test_the_legend_hides_a_curve(opened):
    count = "return document.querySelectorAll('#section-4 svg path.curve').length"
    assert opened.execute_script(count) == 3
    keys(opened, "#section-4 .legend button", " ")
    assert opened.execute_script(count) == 2
    assert opened.execute_script("return document.querySelector('#section-4 .legend button').ariaPressed") == "false"


def test_the_theme_follows_the_system(opened):
    paper = "return getComputedStyle(document.body).backgroundColor"
    light, dark = "rgb(255, 255, 255)", "rgb(20, 24, 29)"
    assert opened.execute_script(paper) == light
    browsers.set_screen(opened, 1280, 900, "dark")
    assert opened.execute_script(paper) == dark
    browsers.set_screen(opened, 1280, 900, "light")
    assert opened.execute_script(paper) == light


CONTRAST = """
const rgb = (text) => text.match(/[\\d.]+/g).slice(0, 3).map(Number);
const light = (c) => rgb(c).map(v => v / 255).map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
  .reduce((sum, v, n) => sum + v * [0.2126, 0.7152, 0.0722][n], 0);
const behind = (e) => { for (; e; e = e.parentElement) {
  const c = getComputedStyle(e).backgroundColor; if (!/, 0\\)$|transparent/.test(c)) return c; }
  return "rgb(255,255,255)"; };
const poor = [];
for (const e of document.querySelectorAll("h1,h2,p,a,button,td,th,dt,dd,li,small,strong,code,text")) {
  if (!e.textContent.trim() || e.classList.contains("skip")) continue;
  const style = getComputedStyle(e);
  const [a, b] = [light(e.tagName === "text" ? style.fill : style.color), light(behind(e))].sort((m, n) => n - m);
  if ((a + 0.05) / (b + 0.05) < 4.5) poor.push(`${e.tagName} ${e.textContent.slice(0, 20)} ${(a + 0.05) / (b + 0.05)}`);
}
return poor;
"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_text_stands_out_from_what_is_behind_it(opened, scheme):
    browsers.set_screen(opened, 1280, 900, scheme)
    assert opened.execute_script(CONTRAST) == []


def test_every_control_can_be_reached_by_tab_and_has_a_name(opened):
    script = """
    return [...document.querySelectorAll("button, a[href], [tabindex]")]
      .filter(e => e.tabIndex < 0 || !(e.textContent.trim() || e.getAttribute("aria-label"))).map(e => e.outerHTML);
    """
    assert opened.execute_script(script) == []


def test_the_data_can_be_downloaded_from_the_page_alone(opened):
    href = opened.execute_script("return document.querySelector('.downloads a').href")
    assert base64.b64decode(href.partition("base64,")[2]) == b"time,u\n0.0,1.5\n"


def test_it_prints_in_light_on_white_without_buttons(opened):
    browsers.set_screen(opened, 1280, 900, "dark")
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        assert opened.execute_script("return getComputedStyle(document.querySelector('nav')).display") == "none"
        assert opened.execute_script("return getComputedStyle(document.body).color") == "rgb(27, 31, 36)"
        pdf = opened.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})["data"]
        assert base64.b64decode(pdf).startswith(b"%PDF")
    finally:
        opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


ROWS = 160_000  # of three curves: a page holds them whole
PEAK = 123_457


@pytest.fixture(scope="module")
def long_page(tmp_path_factory):
    """Two long curves over one time, the first with one row far above all others, a gap, and angles in a table."""
    time = 1e-3 * np.arange(ROWS)
    y = np.sin(time)
    y[PEAK] = 5.0
    y[130_000:140_000] = np.nan
    plots = (
        Plot("First", "time [s]", "angle [rad]", (Series("a", time, y), Series("b", time, 0.5 * y, "steps"))),
        Plot("Second", "time [s]", "torque [N.m]", (Series("c", time + 1e-5 * np.sin(time), np.cos(time)),)),
        Plot("Apart", "alpha [rad]", "error [%]", (Series("d", [0.1, 0.2], [1.0, 2.0], "points"),)),
    )
    table = ReportTable(
        "Sizes", (TableColumn("half-gap", "rad"), TableColumn("as text")), ((0.02, "0.02 rad (0.01 to 0.03)"),)
    )
    facts = Facts("Facts", (("gap [rad]", 0.02), ("stiffness", "3300 N.m/rad")))
    path = tmp_path_factory.mktemp("long") / "report.html"
    summary = "The half-gap is 0.02 rad, with 95 % confidence between 0.01 and 0.03 rad."
    path.write_text(render(Report("Long", summary, (facts, table, *plots), angle_unit="deg")))
    return path


@pytest.fixture
def long_opened(driver, long_page):
    driver.get_log("browser")
    browsers.set_screen(driver, 1280, 900, "light")
    browsers.open_page(driver, long_page.as_uri())
    yield driver
    assert driver.get_log("browser") == []


def test_a_long_curve_is_drawn_from_few_points_and_loses_no_peak_and_no_gap(long_opened):
    drawn = """
    const plot = Plot.all[0], path = plot.svg.querySelector("path.curve").getAttribute("d");
    const top = plot.y.pixel(5), pens = path.split("M").length - 1;
    const numbers = path.match(/[-\\d.]+/g).map(Number);
    return [path.length, pens, Math.min(...numbers.map((v) => Math.abs(v - top)))];
    """
    length, pens, off = long_opened.execute_script(drawn)
    assert length < 60_000
    assert pens == 2  # before and behind the gap
    assert off <= 0.1
    held = "return Plot.all[0].svg.querySelectorAll('path.curve')[1].getAttribute('d').length"
    assert long_opened.execute_script(held) < 60_000


def test_zoomed_far_in_every_row_is_drawn_where_it_is(long_opened):
    script = f"""
    const plot = Plot.all[0];
    plot.go([{PEAK - 2}e-3, {PEAK + 2}e-3]);
    const at = plot.svg.querySelector("path.curve").getAttribute("d").match(/[-\\d.]+/g).map(Number);
    const places = at.filter((_, n) => n % 2 === 0);
    return [places.length, Math.abs(at[2 * 3 + 1] - plot.y.pixel(5))];
    """
    rows, off = long_opened.execute_script(script)
    assert rows == 6  # five in view and one beside, to which the line goes on
    assert off < 0.1


def test_plots_over_time_move_together_and_others_stay(long_opened):
    from selenium.webdriver.common.keys import Keys

    keys(long_opened, "#section-3 svg", "+", "+", Keys.SHIFT + Keys.ARROW_RIGHT)
    ranges = "return Plot.all.map((plot) => plot.range.x)"
    first, second, apart = long_opened.execute_script(ranges)
    assert first == second
    assert first[1] - first[0] == pytest.approx(0.27 * ROWS * 1e-3, rel=0.01)
    assert apart == pytest.approx([0.096, 0.204])
    keys(long_opened, "#section-4 svg", "0")
    first, second, _ = long_opened.execute_script(ranges)
    assert first[1] == pytest.approx(second[1], rel=1e-4)
    assert first[1] > 1e-3 * ROWS


def test_the_cursor_of_one_plot_shows_the_values_of_the_linked_one(long_opened):
    from selenium.webdriver.common.keys import Keys

    browsers.set_screen(long_opened, 1280, 2500, "light")  # both plots in view
    seen = "const d = arguments[0], w = () => Plot.all.every((p) => p.onScreen) ? d() : setTimeout(w, 10); w();"
    long_opened.execute_async_script(seen)
    keys(long_opened, "#section-3 svg", Keys.ARROW_RIGHT, Keys.PAGE_DOWN)
    said = long_opened.execute_script("return document.querySelector('#section-3 [aria-live]').textContent")
    assert said.startswith("time [s]: 8,")
    tips = "return Plot.all.map((plot) => plot.tip.hidden ? '' : plot.tip.innerText)"
    first, second, apart = long_opened.execute_script(tips)
    assert "a:" in first
    assert "b:" in first
    assert second.startswith("time [s]: 8\nc:")
    assert apart == ""


def shown_texts(driver):
    script = """
    const text = (selector) => document.querySelector(selector).textContent;
    return [text(".summary"), text("dd"), text("dt"), text("th"), text("td"), text("td:nth-child(2)"),
      Plot.all[0].svg.textContent.includes("angle [deg]"), text("dd:last-of-type"),
      document.querySelector("td").dataset.label, text("div:nth-child(2) > dd")];
    """
    return driver.execute_script(script)


def test_numbers_below_a_million_have_no_exponent(opened):
    numbers = [[88799, 4], [-150000, 3], [0.00012345, 3], [2.5, 5], [1234567, 3], [0.00001, 2]]
    assert opened.execute_script("return arguments[0].map((one) => number(...one))", numbers) == [
        "88800",
        "-150000",
        "0.000123",
        "2.5",
        "1.23e6",
        "1e-5",
    ]
    assert opened.execute_script("return tickText(-100000, 50000, 0)") == "-100000"


def test_a_converted_number_has_no_digit_that_its_rounding_has_spoilt(opened):
    script = "return arguments[0].map((text) => number(Number(text) * 10800 / Math.PI, converted(text)))"
    # of 0.00600098240, whose table says 20.6299
    assert opened.execute_script(script, ["0.00600098", "0.006001", "0.02", "5e-05"]) == [
        "20.63",
        "20.63",
        "69",
        "0.17",
    ]


def test_angles_are_shown_in_the_log_s_unit_until_another_is_chosen(long_opened):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import Select

    summary, fact, name, head, cell, words, axis, _, tag, stiffness = shown_texts(long_opened)
    assert summary == "The half-gap is 1.1 deg, with 95 % confidence between 0.57 and 1.7 deg."
    assert (fact, name, cell, words) == ("1.14592", "gap [deg]", "1.146", "1.1 deg (0.57 to 1.7)")
    assert (head.strip(), tag, axis, stiffness) == ("half-gap [deg]", "half-gap [deg]", True, "3300 N.m/rad")
    ticks_in_degrees = ticks(long_opened, "#section-3")
    Select(long_opened.find_element(By.ID, "units")).select_by_value("rad")
    summary, fact, name, head, cell, words, axis, *_ = shown_texts(long_opened)
    assert summary == "The half-gap is 0.02 rad, with 95 % confidence between 0.01 and 0.03 rad."
    assert (fact, name, cell, words, axis) == ("0.02", "gap [rad]", "0.02", "0.02 rad (0.01 to 0.03)", False)
    assert ticks(long_opened, "#section-3") != ticks_in_degrees


def test_a_page_without_angles_has_no_switch(driver, tmp_path):
    page = tmp_path / "report.html"
    page.write_text(render(Report("None", "2 N.m.", (Plot("p", "x [s]", "y [N.m]", (Series("a", [0, 1], [0, 1]),)),))))
    browsers.open_page(driver, page.as_uri())
    assert not driver.execute_script("return document.getElementById('units').checkVisibility()")


def test_a_plot_can_be_made_from_data_of_another_program(long_opened):
    """As the workbench does: plain lists, typed arrays, and new series later."""
    script = """
    const figure = document.createElement("figure");
    figure.className = "plot";
    document.querySelector("main").append(figure);
    const series = [{name: "a", x: [0, 1, 2], y: [1, null, 3]}];
    const data = {title: "Own", xLabel: "time [s]", yLabel: "u [N.m]", series};
    const plot = new Plot(figure, data), before = figure.querySelector("path.curve").getAttribute("d");
    plot.show([{name: "b", x: new Float64Array([0, 5]), y: Float32Array.of(7, 9)}]);
    return [before.split("M").length - 1, figure.querySelector(".legend").textContent, plot.range.x, plot.range.y];
    """
    pens, legend, x, y = long_opened.execute_script(script)
    assert (pens, legend) == (2, "b")
    assert x == pytest.approx([-0.2, 5.2])
    assert y == pytest.approx([6.92, 9.08])


CUT = """
const cut = [...document.querySelectorAll("svg")].flatMap((svg) => {
  const box = svg.getBoundingClientRect();
  return [...svg.querySelectorAll("text")].filter((text) => {
    const own = text.getBoundingClientRect();
    const across = own.left < box.left - 1 || own.right > box.right + 1;
    return own.width && (across || own.top < box.top - 1 || own.bottom > box.bottom + 1);
  }).map((text) => text.textContent);
});
const wide = [...document.querySelectorAll("main *, header *")].filter((e) =>
  e.checkVisibility() && !e.closest(".quiet, svg, .scroll thead") && e.getBoundingClientRect().right > innerWidth + 1);
return [cut, wide.map((e) => e.outerHTML.slice(0, 60))];
"""


@pytest.fixture(scope="module")
def diagnosis_page(tmp_path_factory):
    """A diagnosis with all that one may have, words in backticks included."""
    folder = tmp_path_factory.mktemp("diagnosis")
    command, arguments, results, files = PAGES["diagnose"]
    summary = [
        "Verdict: effects. The model lacks backlash in the shaft.", "  It explains 99 %.",
        "Next: log with `--rate 500`, the half-gap being 0.02 rad.",
    ]  # fmt: skip
    write_result(folder, command, arguments, 5, results | {"summary": summary, "angle_unit": "arcmin"})
    for name, text in files.items():
        (folder / name).write_text(text)
    return write_report(folder)


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_diagnosis_says_the_answer_first_and_cuts_nothing(driver, diagnosis_page, width, scheme):
    driver.get_log("browser")
    browsers.set_screen(driver, width, 900, scheme)
    browsers.open_page(driver, diagnosis_page.as_uri())
    shown = driver.execute_script("return document.body.innerText")
    assert "The model lacks backlash in the shaft." in shown
    assert "Log with --rate 500, the half-gap being 69 arcmin." in shown
    assert "What was tried" not in shown  # folded
    seen = "return [...document.querySelectorAll('svg')].map((svg) => svg.checkVisibility())"
    assert driver.execute_script(seen).count(True) == 1
    assert driver.execute_script(seen).count(False) > 1
    keys(driver, "details.fold:last-of-type summary", " ")
    assert "What was tried" in driver.execute_script("return document.body.innerText")
    driver.execute_script("document.querySelectorAll('details').forEach((fold) => (fold.open = true))")
    driver.execute_async_script("const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done))")
    assert driver.execute_script(CUT) == [[], []]
    whole = driver.execute_script("return document.body.innerText")
    assert "`" not in whole
    assert driver.execute_script(CONTRAST) == []
    assert driver.get_log("browser") == []


def test_what_is_folded_is_printed_and_reached_by_links(driver, diagnosis_page):
    browsers.set_screen(driver, 1280, 900, "light")
    browsers.open_page(driver, diagnosis_page.as_uri())
    closed = "return [...document.querySelectorAll('details.fold')].filter((fold) => !fold.open).length"
    folds = driver.execute_script(closed)
    driver.execute_script("dispatchEvent(new Event('beforeprint'))")
    assert driver.execute_script(closed) == 0
    driver.execute_script("dispatchEvent(new Event('afterprint'))")
    assert driver.execute_script(closed) == folds > 3
    inside = driver.execute_script("return document.querySelector('details.fold section').id")
    driver.execute_async_script(
        "const [id, done] = arguments; addEventListener('hashchange', () => setTimeout(done)); location.hash = id",
        inside,
    )
    assert driver.execute_script(closed) == folds - 1
