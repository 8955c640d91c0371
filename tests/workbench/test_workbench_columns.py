"""Columns that are named by clicks in the tab Log: no choice is a dead end, and commands of other tabs get them."""

from collections.abc import Iterator
from typing import Any

import pytest

from orchestrator.records.model_file import read_model
from tests.support.browser import browser, missing, set_screen
from tests.support.workbench import HANGS, Served, workbench

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytestmark = [pytest.mark.slow(shares="columns"), pytest.mark.skipif(bool(missing()), reason=missing())]

MODEL = """fmu = "Drivetrain"
[columns.u]
name = "Strom [A]"
torque_constant = 0.5
[columns.theta_m]
name = "Achse A [deg]"
"""


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("columns") / "session"
    (folder / "files").mkdir(parents=True)
    rows = "".join(f"{n / 100},{n % 7},{n},{n / 9}\n" for n in range(9))  # too short: jobs fail at once
    (folder / "files" / "axis.csv").write_text(f"A rig\nt [s],Strom [A],Achse A [deg],Achse B [deg]\n{rows}")
    (folder / "files" / "timeless.csv").write_text(
        "u [N.m],theta_m [rad]\n" + "".join(f"1,{n / 7:.4f}\n" for n in range(60))
    )
    (folder / "files" / "model.toml").write_text(MODEL)
    with workbench(folder) as found:
        yield found


@pytest.fixture(scope="module")
def page() -> Iterator[Any]:
    with browser() as driver:
        yield driver


def wait_for(driver: Any, tab: str, text: str) -> None:
    from selenium.webdriver.support.wait import WebDriverWait

    script = "return document.getElementById(arguments[0])?.textContent.includes(arguments[1])"
    WebDriverWait(driver, HANGS, 0.1).until(lambda d: d.execute_script(script, f"panel-{tab}", text))


def act(driver: Any, find: str, *words: str) -> None:
    """Do something to an element of the page as soon as it is there."""
    from selenium.webdriver.support.wait import WebDriverWait

    script = f"const one = {find}; if (!one) return false; {words[0]}; return true"
    WebDriverWait(driver, HANGS, 0.1).until(lambda d: d.execute_script(script, *words[1:]))


def press(driver: Any, tab: str, text: str) -> None:
    act(driver, f"[...document.querySelectorAll('#panel-{tab} button')].find((b) => b.textContent === arguments[0])",
        "one.click()", text)  # fmt: skip


def put(driver: Any, css: str, value: str) -> None:
    changed = "one.value = arguments[1]; one.dispatchEvent(new Event('change'))"
    act(driver, "document.querySelector(arguments[0])", changed, css, value)


def open_tab(driver: Any, served: Served, tab: str, log: str, **chosen: Any) -> None:
    set_screen(driver, 1280, 900, "light")
    driver.get(f"{served.address}state")  # of no page, which would keep its own choices
    said = {"columns": chosen.pop("columns", {}), "header": chosen.pop("header", None)}
    notes = {"log": f"files/{log}", "logs": {f"files/{log}": said}, "model": "", **chosen}
    assert served.ask("POST", "notes", notes)[0] == 200
    driver.get(f"{served.address}#{tab}")


def test_a_wrong_line_of_names_can_be_put_right(page: Any, served: Served) -> None:
    open_tab(page, served, "log", "axis.csv", header=1)
    wait_for(page, "log", "must have 4 names like the rows below it, but “A rig” has 1")
    wait_for(page, "log", "The line of the names can be chosen below")
    assert "model`" not in page.find_element("id", "panel-log").text
    put(page, "[data-key=header]", "2")
    wait_for(page, "log", "The names are in line 2")
    wait_for(page, "log", "Torque asked for needs a number")
    put(page, "[data-key=header]", "")
    wait_for(page, "log", "1 line besides the names")


def test_a_log_without_time_asks_for_its_rate(page: Any, served: Served) -> None:
    open_tab(page, served, "log", "timeless.csv")
    wait_for(page, "log", "Time: the channel that holds it, or samples per second")
    asked = "document.querySelector('[data-key=rate-time]')"
    act(page, f"({asked}?.checkVisibility() ? {asked} : null)", "one.focus()")  # it is in the open
    put(page, "[data-key=rate-time]", "100")
    wait_for(page, "log", "Time: nothing → the rows' number (0 to 0.59 s)")


def test_a_channel_that_is_known_by_its_name_is_not_left_out_silently(page: Any, served: Served) -> None:
    open_tab(page, served, "log", "timeless.csv", columns={"time": {"rate": 100}})
    put(page, "[data-key=use-1]", "")
    wait_for(page, "log", "It is recognised by its name: give “Motor angle” another channel")


def test_what_was_clicked_reaches_the_commands_of_other_tabs(page: Any, served: Served) -> None:
    said = {"theta_l": {"name": "Achse B [deg]"}, "u": {"torque_constant": 0.72}}
    open_tab(page, served, "gap", "axis.csv", columns=said, model="")
    wait_for(page, "gap", "Without a model file the machine is the default one")
    press(page, "gap", "Estimate the gap")
    wait_for(page, "gap", "press “Look at this log” in the tab Log first")

    open_tab(page, served, "gap", "axis.csv", columns=said, model="files/model.toml")
    press(page, "gap", "Estimate the gap")
    wait_for(page, "gap", "estimate-1")
    job = served.wait("estimate-1")
    assert job["asked"]["options"] == {"model": "files/model-columns.toml"}
    columns = read_model(served.folder / "files" / "model-columns.toml").columns
    named = {name: (column.name, column.torque_constant) for name, column in columns.items()}
    stated = {"u": ("Strom [A]", 0.72), "theta_m": ("Achse A [deg]", None), "theta_l": ("Achse B [deg]", None)}
    assert named == stated
    press(page, "gap", "Estimate the gap")  # nothing new was said: no further file
    wait_for(page, "gap", "estimate-2")
    assert served.wait("estimate-2")["asked"]["options"] == {"model": "files/model-columns.toml"}

    known = {"files/model-columns.toml": {"log": "files/axis.csv", "columns": said, "header": None}}
    fewer = {"u": {"torque_constant": 0.72}}
    chosen = {"columns": fewer, "model": "files/model-columns.toml", "saidIn": known}
    open_tab(page, served, "diagnosis", "axis.csv", **chosen)
    press(page, "diagnosis", "Diagnose")
    wait_for(page, "diagnosis", "diagnose-1")
    assert served.wait("diagnose-1")["asked"]["options"] == {"model": "files/model-columns-2.toml"}
    columns = read_model(served.folder / "files" / "model-columns-2.toml").columns
    assert set(columns) == {"u", "theta_m"}


def test_what_the_machine_has_not_saved_is_told_where_it_is_not_used(page: Any, served: Served) -> None:
    open_tab(page, served, "machine", "axis.csv", model="files/model.toml")
    put(page, "#panel-machine input[aria-label='J_m, value in kg.m2']", "0.5")
    for tab in ("gap", "diagnosis"):
        wait_for(page, tab, "Changed in the tab Machine and not saved: J_m")
