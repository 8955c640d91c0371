"""The workbench in Chromium: from a dropped log to a verdict, with the mouse or with the keyboard alone."""

import json
from pathlib import Path
from typing import Any

import pytest

from orchestrator.building.build import ensure_built
from orchestrator.master.algorithms import Adaptive
from orchestrator.scenarios.scenario import load_scenario
from orchestrator.scenarios.ssp.write import write_ssp
from tests.support.browser import browser, draw, missing, set_screen
from tests.support.workbench import Served, drive_log, workbench

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytestmark = [pytest.mark.slow(shares="page"), pytest.mark.skipif(bool(missing()), reason=missing())]


NEVER = 240.0  # s, after which the page does not show what is waited for: no job of these tests takes half of that


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("browser")
    with workbench(folder / "session") as found:
        yield found


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return drive_log(tmp_path_factory.mktemp("log") / "drive.csv", 1500)


@pytest.fixture(scope="module")
def page(served: Served):
    with browser() as driver:
        yield driver


def wait(driver: Any, condition: Any) -> Any:
    """Return what the condition gives once it is true; what a redraw takes away or moves is looked up again."""
    from selenium.common.exceptions import (
        ElementClickInterceptedException,
        ElementNotInteractableException,
        StaleElementReferenceException,
    )
    from selenium.webdriver.support.wait import WebDriverWait

    moved = (ElementClickInterceptedException, ElementNotInteractableException, StaleElementReferenceException)
    return WebDriverWait(driver, NEVER, 0.1, ignored_exceptions=moved).until(condition)


def wait_for_text(driver: Any, place: str, text: str) -> None:
    wait(driver, lambda d: text in d.find_element("id", place).text)


def open_workbench(driver: Any, served: Served, width: int = 1280, scheme: str = "light") -> None:
    set_screen(driver, width, 900, scheme)
    driver.get("about:blank")
    driver.get(f"{served.address}#log")
    wait(driver, lambda d: d.execute_script("return document.getElementById('folder')?.textContent"))


def find(driver: Any, css: str) -> Any:
    return wait(driver, lambda d: next(iter(d.find_elements("css selector", css)), None))


def press(driver: Any, text: str) -> None:
    """Bring the focus to a button as Tab does, and press Enter."""

    def is_pressed(driver: Any) -> bool:
        buttons = driver.find_elements("xpath", f"//button[normalize-space()='{text}']")
        found = next((button for button in buttons if button.is_displayed()), None)
        if found is not None:
            driver.execute_script("arguments[0].focus()", found)
            found.send_keys("\n")
        return found is not None

    wait(driver, is_pressed)


def press_named(driver: Any, name: str) -> None:
    """Press a button by its whole name."""
    wait(driver, lambda d: find(d, f"[role=tabpanel]:not([hidden]) button[aria-label='{name}']").click() is None)


def pick(driver: Any, css: str, text: str) -> None:
    from selenium.webdriver.support.select import Select

    def is_picked(driver: Any) -> bool:
        Select(find(driver, css)).select_by_visible_text(text)
        return True

    wait(driver, is_picked)


def labelled(driver: Any, text: str) -> str:
    """Return the id of the control that a label of the tab in sight belongs to."""
    label = f"//*[@role='tabpanel'][not(@hidden)]//label[normalize-space()='{text}']"
    return str(wait(driver, lambda d: d.find_element("xpath", label).get_attribute("for")))


def choose_tab(driver: Any, name: str) -> None:
    def click(driver: Any) -> bool:
        driver.execute_script("scrollTo({ top: 0, behavior: 'instant' })")
        driver.find_element("id", f"tab-{name}").click()
        return driver.find_element("id", f"panel-{name}").is_displayed()

    wait(driver, click)


def severe(driver: Any) -> list[str]:
    return [entry["message"] for entry in driver.get_log("browser") if entry["level"] == "SEVERE"]


@pytest.fixture(scope="module")
def inspected(page: Any, served: Served, log: Path) -> Any:
    """The page after a log was dropped, its columns named by clicks, and looked at."""
    open_workbench(page, served)
    find(page, "#panel-log input[type=file]").send_keys(str(log))
    find(page, "#panel-log .card")
    wait_for_text(page, "panel-log", "Not used: Achse B [deg]")
    alert = "#panel-log [role=alert].message:not(:empty)"
    wait(page, lambda d: "torque constant" in d.find_element("css selector", alert).text)
    pick(page, "select[aria-label='Use Achse B [deg] as']", "Load angle")
    wait_for_text(page, "panel-log", "Load angle: nothing → Achse B [deg]")
    find(page, "[data-key=torque_constant-u]").send_keys("0.5\t")  # Tab goes on to the next control, which is made anew
    wait_for_text(page, "panel-log", "can be read")
    wait(page, lambda d: d.switch_to.active_element.text == "More")
    press(page, "Look at this log")
    find(page, "#panel-log iframe")
    return page


def test_the_default_machine_is_shown_before_any_file_is_there(page: Any, served: Served) -> None:
    open_workbench(page, served)
    choose_tab(page, "machine")
    fields = {
        name: find(page, f"#panel-machine input[aria-label='{name}']")
        for name in ("J_m, value in kg.m2", "J_m, off by at most, in percent", "alpha, off by at most, in percent")
    }
    value, off, off_of_nothing = fields.values()
    assert float(value.get_attribute("value")) > 0.0
    assert off.is_enabled()
    assert not off_of_nothing.is_enabled()  # no share of a value of 0


CALL = """const [file, name, given, done] = arguments;
    import(new URL(`static/${file}`, location)).then((module) => done(module[name](given) ?? null))"""


def call(driver: Any, file: str, name: str, given: Any) -> Any:
    """Return what a function of the page's own modules gives."""
    return driver.execute_async_script(CALL, file, name, given)


def test_a_line_that_names_no_unit_becomes_no_button(page: Any, served: Served, tmp_path: Path) -> None:
    log = tmp_path / "ink.csv"
    log.write_text("time [s],u [N.m],theta_m [Ink]\n" + "".join(f"{n / 100},{n % 7},{n}\n" for n in range(50)))
    status, found = served.ask("POST", "columns", {"file": served.upload(log), "columns": {}})
    assert (status, "[columns.theta_m] unit" in found["problem"]) == (200, True)
    open_workbench(page, served)
    advice = call(page, "advice.js", "adviceOf", found["problem"])
    assert (advice["column"], advice["key"], advice.get("value")) == ("theta_m", "unit", None)
    line = 'say `[columns.theta_m] unit = "deg"` (`model`)'
    assert call(page, "advice.js", "adviceOf", line)["value"] == "deg"


CROSSED = """const done = arguments[arguments.length - 1];
    import(new URL("static/graph.js", location)).then(({ Graph }) => {
      const ports = (name) => [{ name, causality: "input" }, { name: `${name}_out`, causality: "output" }];
      const variables = ["a", "b"].flatMap(ports);
      const names = ["one", "two", "three", "four", "five"], graph = new Graph();
      const wire = (m, n) => ["a", "b"].map((port) => ({ from: `${m}.${port}_out`, to: `${n}.${port}` }));
      const connections = names.flatMap((m) => names.flatMap((n) => wire(m, n)));
      document.body.append(graph.svg);
      graph.draw(Object.fromEntries(names.map((name) => [name, { variables }])), connections);
      const boxes = [...graph.svg.querySelectorAll(".node")].map((node) => node.getBoundingClientRect());
      const within = (x, from, to) => x > from + 1 && x < to - 1;
      const inside = ({ x, y }) => boxes.some((b) => within(x, b.left, b.right) && within(y, b.top, b.bottom));
      const wires = [...graph.svg.querySelectorAll(".wire")];
      const crossed = wires.filter((wire) => Array.from({ length: 401 }, (_, n) =>
        wire.getPointAtLength((n / 400) * wire.getTotalLength()).matrixTransform(wire.getScreenCTM())).some(inside));
      graph.svg.remove();
      done([wires.length, crossed.length]);
    })"""


def test_no_wire_of_a_scenario_runs_through_a_box(page: Any, served: Served) -> None:
    """Each FMU to each other and to itself, over two rows of boxes."""
    open_workbench(page, served)
    assert page.execute_async_script(CROSSED) == [50, 0]


def test_advice_names_fields_and_names_keep_their_brackets(page: Any, served: Served) -> None:
    open_workbench(page, served)
    said = {
        'say `[columns.u] unit = "..."` (`model`)': "say “Unit in the file” of “Torque asked for”",
        "or state `[columns.time] rate = 500`": "or state “samples per second” of “Time”: 500",
        "reads with --rate 200 in 3 s": "reads with “Samples per second”: 200 in 3 s",
        "`k` must be positive": "“k” must be positive",
    }
    for line, words in said.items():
        assert call(page, "advice.js", "plain", line) == words
    names = {
        "a.b.c": ["a", "b", "c"], "der(a.b)": ["der(a.b)"], "der(der(a.b))": ["der(der(a.b))"],
        "a[1.2].b": ["a[1.2]", "b"], "a.'x.y'.z": ["a", "'x.y'", "z"], "u": ["u"], "...": ["..."],
    }  # fmt: skip
    for name, parts in names.items():
        assert call(page, "tree.js", "partsOf", name) == parts


def test_a_file_dropped_in_another_tab_is_told_where_it_goes(page: Any, served: Served, tmp_path: Path) -> None:
    open_workbench(page, served)
    for tab, name in (("log", "axis.toml"), ("log", "axis.fmu"), ("machine", "axis.trc"), ("fmus", "axis2.html")):
        (tmp_path / name).write_text("1")
        choose_tab(page, tab)
        find(page, f"#panel-{tab} input[type=file]").send_keys(str(tmp_path / name))
        wait_for_text(page, f"panel-{tab}", f"not taken {name}: logs go into the tab Log, model files (.toml) into")
        assert not (served.folder / "files" / name).exists()
    assert [call(page, "parts.js", "isLog", name) for name in ("a.trc", "a.CSV", "a.fmu")] == [True, True, False]


def test_back_goes_to_the_tab_before(page: Any, served: Served) -> None:
    open_workbench(page, served)
    for name in ("machine", "gap"):
        choose_tab(page, name)
    page.back()
    wait(page, lambda d: d.find_element("id", "panel-machine").is_displayed())
    page.back()
    wait(page, lambda d: d.find_element("id", "panel-log").is_displayed())
    page.forward()
    wait(page, lambda d: d.find_element("id", "panel-machine").is_displayed())


def test_a_log_goes_in_and_its_columns_are_named_by_clicks(inspected: Any, served: Served) -> None:
    found = json.loads((served.folder / "results" / "inspect-1" / "inspect.json").read_text())["results"]
    assert [channel["name"] for channel in found["channels"]] == ["u", "theta_m", "theta_l"]
    torque = next(channel for channel in found["channels"] if channel["name"] == "u")
    assert torque["unit"] == "N.m"
    assert torque["most"] < 2.0
    assert severe(inspected) == []


def test_every_channel_is_drawn_and_found_by_its_name(inspected: Any) -> None:
    drawn = """return [...document.querySelectorAll('#panel-log .curve')].map((one) =>
        [one.label, one.path.getAttribute('d')?.length > 100, one.words.textContent])"""
    find(inspected, "#panel-log .channels").location_once_scrolled_into_view  # noqa: B018 - scrolls
    wait(inspected, lambda d: all(one[1] for one in d.execute_script(drawn)))
    curves = inspected.execute_script(drawn)
    assert [one[0] for one in curves[:4]] == ["Time", "Torque asked for", "Motor angle", "Load angle"]
    assert len(curves) == 8  # beside the cards, and in the list
    assert curves[0][2] == "0 to 2998 ms"
    assert curves[1][2].endswith(" A")
    type_into = "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))"
    for text, count in (("achse", 1), ("load angle", 1), ("[deg]", 2), ("none", 0), ("", 4)):
        inspected.execute_script(type_into, find(inspected, "[data-key=find-channel]"), text)
        assert len(inspected.find_elements("css selector", "#panel-log .channel")) == count
    press(inspected, "Zoom in")
    wait_for_text(inspected, "panel-log", "rows 376 to 1,125")
    press(inspected, "All rows")
    wait_for_text(inspected, "panel-log", "rows 1 to 1,500")
    choose_tab(inspected, "start")
    wait_for_text(inspected, "panel-start", "✓ done drive.csv was looked at")
    wait_for_text(inspected, "panel-start", "to do press “Estimate the gap”")
    choose_tab(inspected, "log")


def test_the_page_of_a_result_is_shown_in_a_sandbox(inspected: Any) -> None:
    inspected.switch_to.frame(find(inspected, "#panel-log iframe"))
    try:
        wait(inspected, lambda d: "record" in d.find_element("css selector", "h1").text.lower())
        assert inspected.execute_script("return window.origin") == "null"
    finally:
        inspected.switch_to.default_content()


def test_a_value_of_the_machine_becomes_the_users(inspected: Any, served: Served) -> None:
    press(inspected, "Go on to the machine")
    value = find(inspected, "input[aria-label='J_m, value in kg.m2']")
    value.clear()
    value.send_keys("0.003\t")
    wait_for_text(inspected, "panel-machine", "Changed and not saved: J_m")
    press(inspected, "Save as a new model file")
    wait(inspected, lambda d: (served.folder / "files" / "model-yours.toml").exists())
    wait_for_text(inspected, "panel-machine", "yours")
    assert "value = 0.003   # kg.m2: yours" in (served.folder / "files" / "model-yours.toml").read_text()


def test_no_action_runs_on_a_number_that_is_none(inspected: Any, served: Served) -> None:
    value = find(inspected, "input[aria-label='k, value in N.m/rad']")
    before = value.get_attribute("value")
    value.clear()
    value.send_keys("4OO\t")
    press(inspected, "Save as a new model file")
    wait_for_text(inspected, "panel-machine", "but is “4OO”")
    assert not (served.folder / "files" / "model-yours-2.toml").exists()
    value.clear()
    value.send_keys(f"{before}\t")


def test_results_of_a_tab_stand_there_after_a_reload(inspected: Any) -> None:
    inspected.refresh()
    choose_tab(inspected, "log")
    find(inspected, "#panel-log iframe")
    wait(inspected, lambda d: find(d, "[data-key=use-3]").get_attribute("value") == "theta_l")
    choose_tab(inspected, "machine")
    wait_for_text(inspected, "panel-machine", "model-yours.toml")


def test_a_diagnosis_is_stopped_from_the_page(inspected: Any, served: Served) -> None:
    choose_tab(inspected, "diagnosis")
    press(inspected, "Diagnose")
    wait_for_text(inspected, "running", "fitted")
    press(inspected, "Stop")
    wait_for_text(inspected, "panel-diagnosis", "stopped")
    job = served.job("diagnose-1")
    assert (job["state"], job["exit_code"]) == ("stopped", 130)
    wait(inspected, lambda d: d.switch_to.active_element.get_attribute("id") == "tab-diagnosis")


def test_outputs_are_connected_to_inputs_of_the_same_quantity(inspected: Any, served: Served) -> None:
    choose_tab(inspected, "fmus")
    fmus = ensure_built()
    for name in ("Drivetrain", "KalmanEstimator"):
        file = find(inspected, "#panel-fmus input[type=file]")
        file.send_keys(str(fmus[name]))
        wait(inspected, lambda d, name=name: f"{name}.fmu is here" in d.find_element("id", "panel-fmus").text)
        wait(inspected, lambda d, n=name: find(d, "#panel-fmus select").get_attribute("value") == f"files/{n}.fmu")
        press(inspected, "Add it to the scenario")
        find(inspected, f"[data-port^='{name.lower()}.']")
    targets = (
        "[...document.querySelectorAll('#panel-fmus label')].find((one) => one.textContent.startsWith('to an input'))"
    )
    found = f"return [...document.getElementById({targets}.htmlFor).options].map((one) => one.value)"
    assert "kalmanestimator.theta_m" in inspected.execute_script(found)
    assert "kalmanestimator.u" not in inspected.execute_script(found)  # a torque
    press(inspected, "Connect what has the same name")
    wait_for_text(inspected, "panel-fmus", "drivetrain.theta_m → kalmanestimator.theta_m")
    press(inspected, "Write it as TOML")
    written = served.folder / "files" / "scenario.toml"
    wait(inspected, lambda d: written.exists() and "scenario.toml" in d.find_element("id", "panel-fmus").text)
    scenario = load_scenario(written)
    connected = {str(one.source) for one in scenario.system.connections}
    assert connected == {"drivetrain.theta_m", "drivetrain.theta_l"}
    press(inspected, "Run the scenario")
    find(inspected, "#panel-fmus iframe")
    assert served.job("simulate-1")["state"] == "done"
    summaries = "[...document.querySelectorAll('#panel-fmus summary')]"
    inspected.execute_script(f"{summaries}.find((one) => one.textContent === 'Sweep a parameter').click()")
    pick(inspected, f"#{labelled(inspected, 'Parameter')}", "drivetrain.alpha")
    for text, value in (("from", "0"), ("to", "0,04"), ("runs", "2")):
        place = find(inspected, f"#{labelled(inspected, text)}")
        place.clear()
        place.send_keys(f"{value}\t")
    press(inspected, "Run the sweep")
    find(inspected, "#panel-fmus iframe[title='Page of sweep-1']")
    assert served.job("sweep-1")["line"].count("--vary=drivetrain.alpha=range:0:0.04:2") == 1
    rows = (served.folder / "results" / "sweep-1" / "sweep.csv").read_text().splitlines()
    assert len(rows) == 3
    assert severe(inspected) == []
    set_screen(inspected, 1280, 900, "light")


def test_an_fmu_runs_alone_with_one_click(inspected: Any, served: Served) -> None:
    wait_for_text(inspected, "panel-fmus", "Sampled-data Kalman filter of the drivetrain")
    wait_for_text(inspected, "panel-fmus", "backlash-cosim with PythonFMU")
    press(inspected, "Run this FMU")
    find(inspected, "#panel-fmus iframe[title='Page of simulate-2']")
    scenario = load_scenario(served.folder / "files" / "KalmanEstimator-alone.toml")
    assert (scenario.stop, [one.name for one in scenario.system.instances]) == (2.0, ["model"])


def renamed_log(served: Served, names: str) -> str:
    """Return the text of the dropped log with other names of its columns."""
    lines = (served.folder / "files" / "drive.csv").read_text().splitlines()
    lines[2] = names
    return "\n".join(lines) + "\n"


def pick_new_log(driver: Any, served: Served, tab: str, name: str, text: str) -> None:
    """Upload a log, and choose it in a tab."""
    (served.folder / name).write_text(text)
    uploaded = served.upload(served.folder / name)
    choose_tab(driver, tab)
    find(driver, f"#panel-{tab} option[value='{uploaded}']")
    pick(driver, f"#panel-{tab} select", name)


def test_a_log_chosen_in_another_tab_is_looked_at(inspected: Any, served: Served) -> None:
    names = "Time [ms];Current setpoint [A];Achse A [deg];Achse B [deg]"
    pick_new_log(inspected, served, "gap", "other.csv", renamed_log(served, names))
    choose_tab(inspected, "log")
    wait_for_text(inspected, "panel-log", "Not used: Achse A [deg], Achse B [deg]")
    wait_for_text(inspected, "panel-log", "Still needed. Motor angle: the channel that holds it")
    wait(inspected, lambda d: d.find_elements("css selector", "#panel-log iframe") == [])


def test_arrow_keys_take_nothing_from_other_channels_on_their_way(inspected: Any, served: Served) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    pick_new_log(inspected, served, "log", "third.csv", renamed_log(served, "Time [ms];Wert 1;Wert 2;Wert 3"))
    chosen = "const one = document.activeElement; return [one.ariaLabel, one.selectedOptions?.[0].textContent]"
    titles = {"Wert 1": "Torque asked for", "Wert 2": "Motor angle", "Wert 3": "Load angle"}
    for channel, title in titles.items():
        label = f"Use {channel} as"
        field = f"select[aria-label='{label}']"
        find(inspected, field)
        inspected.execute_script("document.querySelector(arguments[0]).focus()", field)  # which a drawing may renew
        for _ in range(8):
            if inspected.execute_script(chosen) == [label, title]:
                break
            ActionChains(inspected).send_keys(Keys.ARROW_DOWN).perform()
        assert inspected.execute_script(chosen) == [label, title]

    def uses(driver: Any) -> list[str]:
        script = "return [...document.querySelectorAll('[data-key^=use-]')].map((one) => one.value)"
        return driver.execute_script(script)

    wait_for_text(inspected, "panel-log", "Every channel is used.")
    wait(inspected, lambda d: uses(d) == ["time", "u", "theta_m", "theta_l"])
    # What was said of a log's columns stands there again when one comes back to it.
    pick(inspected, "#panel-log select", "drive.csv")
    wait_for_text(inspected, "panel-log", "Achse B [deg]: ")
    pick(inspected, "#panel-log select", "third.csv")
    wait_for_text(inspected, "panel-log", "Wert 1: ")
    wait(inspected, lambda d: uses(d) == ["time", "u", "theta_m", "theta_l"])


def test_what_a_line_advises_is_done_by_a_click(inspected: Any, served: Served) -> None:
    rows = "\n".join(f"{n / 100},{(n % 40 - 20) / 10},{(n * n) % 65536}" for n in range(420))
    pick_new_log(inspected, served, "log", "counter.csv", f"time,u,theta_m [deg]\n{rows}\n")
    press(inspected, "Set “the counter starts again at” of “Motor angle” to 65536")
    wait_for_text(inspected, "panel-log", "can be read")
    wait(inspected, lambda d: find(d, "[data-key=modulo-theta_m]").get_attribute("value") == "65536")


def test_a_source_and_its_scenario_outlast_a_reload(inspected: Any, served: Served) -> None:
    choose_tab(inspected, "fmus")
    inspected.refresh()
    find(inspected, "[data-port='drivetrain.u']")
    wait_for_text(inspected, "panel-fmus", "drivetrain.theta_m → kalmanestimator.theta_m")
    press(inspected, "Feed an input")
    kind = "//label[normalize-space()='is']/following-sibling::select"
    inspected.find_element("xpath", kind).send_keys("step")
    value = "//label[normalize-space()='at [s]']/following-sibling::input"
    type_into = "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('change'))"
    inspected.execute_script(type_into, inspected.find_element("xpath", value), "1, 2")
    press(inspected, "Write it as TOML")
    wait_for_text(inspected, "panel-fmus", "must hold a number that makes sense there")
    inspected.execute_script(type_into, inspected.find_element("xpath", value), "0,5")
    pick(inspected, f"#{labelled(inspected, 'Master')}", "adaptive steps")
    press(inspected, "Write it as TOML")
    files = served.folder / "files"
    written = wait(
        inspected, lambda d: [path for path in files.glob("scenario*.toml") if "time = 0.5" in path.read_text()]
    )
    assert load_scenario(written[0]).algorithm == Adaptive(0.001)


def test_an_ssp_file_is_a_tree(inspected: Any, served: Served) -> None:
    choose_tab(inspected, "fmus")
    system = served.folder / "drawn.ssp"
    write_ssp(system, load_scenario(served.folder / "files" / "scenario.toml"))
    find(inspected, "#panel-fmus input[type=file]").send_keys(str(system))
    said = "System of 2 FMUs until 1 s: drivetrain (Drivetrain), kalmanestimator (KalmanEstimator)"
    wait_for_text(inspected, "panel-fmus", said)
    branches = wait(inspected, lambda d: [one.text for one in d.find_elements("css selector", "#panel-fmus summary")])
    assert "Connections (2)" in branches
    assert any(text.startswith("drivetrain (") for text in branches)


def test_an_action_that_ends_does_not_scroll_the_page(inspected: Any) -> None:
    choose_tab(inspected, "fmus")
    set_screen(inspected, 1280, 400, "light")
    written = inspected.find_element("xpath", "//*[@id='panel-fmus']//button[normalize-space()='Write it as TOML']")
    inspected.execute_script(
        "arguments[0].focus(); arguments[0].click(); scrollTo({ top: 0, behavior: 'instant' })", written
    )
    assert inspected.execute_script("return arguments[0].getBoundingClientRect().top", written) > 400, "out of sight"
    wait(inspected, lambda d: d.switch_to.active_element == written)
    assert inspected.execute_script("return scrollY") == 0
    set_screen(inspected, 1280, 900, "light")


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (390, "light"), (1280, "dark")])
def test_nothing_is_wider_than_the_screen(inspected: Any, served: Served, width: int, scheme: str) -> None:
    set_screen(inspected, width, 900, scheme)
    inspected.execute_script("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    for tab in inspected.find_elements("css selector", "[role=tab]"):
        inspected.execute_script("arguments[0].click()", tab)
        draw(inspected)
        assert inspected.execute_script("return document.documentElement.scrollWidth") <= width, tab.text
    set_screen(inspected, 1280, 900, "light")


def test_tabs_follow_the_arrow_keys_and_every_control_has_a_name(inspected: Any) -> None:
    from selenium.webdriver.common.keys import Keys

    choose_tab(inspected, "log")
    for name in ("machine", "gap"):
        inspected.switch_to.active_element.send_keys(Keys.ARROW_RIGHT)
        assert inspected.switch_to.active_element.get_attribute("id") == f"tab-{name}"
        assert inspected.find_element("id", f"panel-{name}").is_displayed()
    inspected.switch_to.active_element.send_keys(Keys.HOME)
    assert inspected.switch_to.active_element.get_attribute("id") == "tab-start"
    nameless = """return [...document.querySelectorAll('input, select, button')].filter(
        (e) => !(e.getAttribute('aria-label') || e.labels?.length || e.textContent.trim())).map((e) => e.outerHTML)"""
    assert inspected.execute_script(nameless) == []


def test_a_new_tab_shows_the_work_as_it_is(inspected: Any, served: Served) -> None:
    first = inspected.current_window_handle
    inspected.switch_to.new_window("tab")
    try:
        open_workbench(inspected, served)
        log = "return document.querySelector('#panel-log select').value"
        assert inspected.execute_script(log) == "files/counter.csv"
        choose_tab(inspected, "fmus")
        find(inspected, "[data-port='drivetrain.u']")
        find(inspected, "#panel-fmus iframe")  # what the scenario gave
        choose_tab(inspected, "compare")
        press_named(inspected, "Open: inspect-1")
        wait(inspected, lambda d: d.execute_script(log) == "files/drive.csv")
        find(inspected, "#panel-log iframe[title='Page of inspect-1']")
        wait(inspected, lambda d: find(d, "[data-key=use-3]").get_attribute("value") == "theta_l")
    finally:
        inspected.close()
        inspected.switch_to.window(first)
    wait(inspected, lambda d: d.execute_script(log) == "files/drive.csv")  # every open page follows


def test_results_are_no_logs_and_settings_no_models(inspected: Any, served: Served, tmp_path: Path) -> None:
    (tmp_path / "strict.toml").write_text("test_share = 0.2\n")
    choose_tab(inspected, "machine")
    find(inspected, "#panel-machine input[type=file]").send_keys(str(tmp_path / "strict.toml"))
    wait_for_text(inspected, "panel-machine", "it is chosen in the tab Diagnosis")
    script = """return [...document.querySelectorAll('#panel-diagnosis select')].map((select) =>
        [select.labels[0].textContent, [...select.options].map((option) => option.textContent)])"""
    offered = dict(inspected.execute_script(script))
    assert offered["Settings"] == ["the usual ones", "strict.toml"]
    assert "strict.toml" not in offered["Model file"]
    assert "inspect-1: model.toml" in offered["Model file"]
    assert not [name for name in offered["Log"] if ": " in name]


def test_a_past_result_runs_again_and_goes_for_good(inspected: Any, served: Served) -> None:
    choose_tab(inspected, "compare")
    press_named(inspected, "Run again: inspect-1")
    job = served.wait("inspect-2")
    assert job["asked"] == served.job("inspect-1")["asked"]
    find(inspected, "#panel-log iframe[title='Page of inspect-2']")
    choose_tab(inspected, "compare")
    press_named(inspected, "Remove: inspect-2")
    inspected.switch_to.alert.accept()
    wait(inspected, lambda d: not (served.folder / "results" / "inspect-2").exists())
    wait(inspected, lambda d: not d.find_elements("css selector", "#panel-log iframe"))
    assert served.job("inspect-2") == {}
