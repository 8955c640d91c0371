"""The pictures of docs/workbench.md: a session in Chromium, from a dropped log to a verdict.

Run ``python -m tools.workbench_pictures`` from a clone with Chromium and ``[test]``.
"""

import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image

from orchestrator.building.build import ensure_built
from tests.support.browser import browser, set_screen
from tests.support.workbench import Served, drive_log, workbench
from tools import refuse_arguments

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
WIDTH, HEIGHT = 1100, 900
COLOURS = 64


def main() -> None:
    """Make the pictures."""
    with tempfile.TemporaryDirectory() as folder, workbench(Path(folder) / "backlash") as served, browser() as driver:
        log = served.upload(drive_log(Path(folder) / "axis7.csv"))
        columns = {"u": {"torque_constant": 0.5}, "theta_l": {"name": "Achse B [deg]"}}
        model = served.ask("POST", "models", {"name": "axis7-columns.toml", "columns": columns})[1]["file"]
        inspected = served.wait(served.start("inspect", [log], model=model))["name"]
        machine = f"results/{inspected}/model.toml"
        set_screen(driver, WIDTH, HEIGHT, "light")
        said = {"columns": columns, "header": None}
        served.ask("POST", "notes", {"log": log, "model": machine, "logs": {log: said}, "given": inspected})
        driver.get(f"{served.address}#log")
        _wait(driver, "#panel-log .card")
        _save(driver, "log", 980)
        _tab(driver, "machine", "#panel-machine td")
        _save(driver, "machine", 980)
        _run(driver, served, "gap", "Estimate the gap")
        _save(driver, "gap", 1100)
        _run(driver, served, "diagnosis", "Diagnose")
        _save(driver, "diagnosis", 1300)
        served.wait(served.start("estimate", [log], model=machine, rate=100))
        _show_comparison(driver)
        _show_scenario(driver, served)


def _show_comparison(driver: Any) -> None:
    _tab(driver, "compare", "#panel-compare option[value='estimate-2']")
    picked = "const s = document.querySelector('#panel-compare select'); s.value = 'estimate-1'; "
    driver.execute_script(f"{picked}s.dispatchEvent(new Event('change'))")
    _press(driver, "Compare them")
    _wait(driver, "#panel-compare iframe")
    _save(driver, "compare", 1000)


def _show_scenario(driver: Any, served: Served) -> None:
    """Add our three FMUs to a scenario and connect some of them."""
    fmus = ensure_built()
    for name in ("LqrController", "Drivetrain", "KalmanEstimator"):
        file = served.upload(fmus[name])
        _tab(driver, "fmus", f"#panel-fmus option[value='{file}']")
        picked = "const s = [...document.querySelectorAll('#panel-fmus select')][0]; s.value = arguments[0]; "
        driver.execute_script(f"{picked}s.dispatchEvent(new Event('change'))", file)
        _wait(driver, "#panel-fmus table")
        time.sleep(1.0)  # the variables of this one
        _press(driver, "Add it to the scenario")
        _wait(driver, f"[data-port^='{name.lower()}.']")
    _press(driver, "Connect what has the same name")
    _save(driver, "fmus", 900, "#panel-fmus > h2:last-of-type")


def _wait(driver: Any, css: str) -> Any:
    end = time.monotonic() + 600.0
    while not (found := driver.find_elements("css selector", css)):
        if time.monotonic() > end:
            raise TimeoutError(css)
        time.sleep(0.1)
    return found[0]


def _tab(driver: Any, name: str, shown: str) -> None:
    driver.execute_script("document.getElementById(arguments[0]).click()", f"tab-{name}")
    _wait(driver, shown)


def _press(driver: Any, text: str) -> None:
    for button in driver.find_elements("xpath", f"//button[normalize-space()='{text}']"):
        if button.is_displayed():
            driver.execute_script("arguments[0].click()", button)
            return


def _run(driver: Any, served: Served, tab: str, text: str) -> None:
    """Press a tab's button and wait for the page of the result."""
    _tab(driver, tab, f"#panel-{tab} select")
    _press(driver, text)
    _wait(driver, f"#panel-{tab} iframe")


def _save(driver: Any, name: str, height: int, top: str = "header") -> None:
    set_screen(driver, WIDTH, height, "light")
    scroll = (
        "document.querySelector(arguments[0]).scrollIntoView({ behavior: 'instant' }); document.activeElement.blur()"
    )
    driver.execute_script(scroll, top)
    time.sleep(2.0)  # a frame's page draws its plots
    path = IMAGES / f"workbench-{name}.png"
    driver.save_screenshot(str(path))
    Image.open(path).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    refuse_arguments(__doc__)
    main()
