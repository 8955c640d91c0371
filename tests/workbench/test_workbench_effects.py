"""Effects that are ticked on and off below a diagnosis: what the page asks for, and what it shows then."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.browser import browser, missing, set_screen
from tests.support.workbench import HANGS, Served, workbench

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytestmark = [pytest.mark.slow(shares="effects"), pytest.mark.skipif(bool(missing()), reason=missing())]

PLAY, RIPPLE, FRICTION = "backlash@shaft", "torque_ripple@motor", "coulomb_friction@motor"
WORDS = {PLAY: "backlash in the shaft", RIPPLE: "torque ripple at the motor", FRICTION: "Coulomb friction at the motor"}


def write_diagnosis(folder: Path, name: str, misfit: float, has: set[str]) -> None:
    """Write a diagnosis that has ended, as a workbench leaves it."""
    result = folder / "results" / name
    result.mkdir(parents=True)
    signal = {"nominal": 0.02, "parameters": 0.018, "final": misfit, "noise": 0.0004, "unit": "rad"}
    play = {
        "name": "backlash", "site": "shaft", "grade": "certain", "family": [RIPPLE, "constant_torque@load"],
        "parameters": {"alpha": {"value": 0.013698, "interval": [0.0136921, 0.0137041], "unit": "rad"}},
    }  # fmt: skip
    lead = {"value": 0.00097, "interval": [0.0002, 0.0017], "unit": "s"}
    found = {
        "verdict": "effects", "effects": [play],
        "summary": ["Verdict: effects. The model lacks backlash in the shaft. `u` is late.", "  Backlash: ..."],
        "nuisances": [{"name": "early_torque", "grade": "possible", "parameters": {"lead": lead}}],
        "trust": {"level": "amber", "reasons": []}, "angle_unit": "rad",
        "test": [{"source": "axis.csv", "rows": 100, "misfit": {"theta_m": signal}, "worse": False}],
        "library": {label: {"words": words, "in_model": label in has} for label, words in WORDS.items()},
        "candidates": [{"on_top_of": [], "taken": "", "tried": [{"effect": RIPPLE, "gain": 0.012, "t": 1.0}]}],
    }  # fmt: skip
    (result / "diagnose.json").write_text(json.dumps({"command": "diagnose", "results": found}))
    asked = {"inputs": ["files/axis.csv"], "options": {"rate": 250, "time_limit": 9, "no_search": True}}
    words = ["diagnose", "files/axis.csv", "--out", f"results/{name}"]
    note = {
        "command": "diagnose", "asked": asked, "words": words, "state": "done", "exit_code": 0, "messages": [],
        "begun": 1.0, "ended": 2.0,
    }  # fmt: skip
    (result / "job.json").write_text(json.dumps(note))


@pytest.fixture
def served(tmp_path: Path):
    folder = tmp_path / "session"
    (folder / "files").mkdir(parents=True)
    (folder / "files" / "axis.csv").write_text("time,u,theta_m\n0,0,0\n")  # too short: the job that is started fails
    write_diagnosis(folder, "diagnose-1", 0.001, {PLAY, FRICTION})
    write_diagnosis(folder, "diagnose-2", 0.0007, {PLAY, RIPPLE, FRICTION})
    with workbench(folder) as found:
        yield found


def wait(driver: Any, condition: Any) -> Any:
    from selenium.webdriver.support.wait import WebDriverWait

    return WebDriverWait(driver, HANGS, 0.1).until(condition)


def boxes(driver: Any) -> dict[str, bool]:
    """Return what each box says, and whether it is ticked."""
    return driver.execute_script("""return Object.fromEntries([...document.querySelectorAll(
        '#panel-diagnosis fieldset input[type=checkbox]')].map((box) => [box.labels[0].textContent, box.checked]))""")


def tick(driver: Any, text: str) -> None:
    script = """const box = [...document.querySelectorAll('#panel-diagnosis fieldset input')].find(
        (one) => one.labels[0].textContent.startsWith(arguments[0])); box.closest('details')?.setAttribute('open', '');
        box.click()"""
    driver.execute_script(script, text)


def press(driver: Any, text: str) -> None:
    wait(driver, lambda d: d.execute_script(
        "const b = [...document.querySelectorAll('#panel-diagnosis button')].find("
        "(one) => one.textContent === arguments[0]); b?.click(); return Boolean(b)", text))  # fmt: skip


def open_diagnosis(driver: Any, served: Served, name: str, before: dict[str, str]) -> None:
    """Open the page with a diagnosis on it."""
    set_screen(driver, 1280, 900, "light")
    driver.get("about:blank")  # no page that follows the notes
    assert served.ask("POST", "notes", {"shown": {"diagnosis": name}, "before": before})[0] == 200
    driver.get(f"{served.address}#diagnosis")
    wait(driver, boxes)


def said(driver: Any) -> str:
    return driver.find_element("id", "panel-diagnosis").text


def test_effects_are_ticked_on_and_off(served: Served) -> None:
    with browser() as page:
        open_diagnosis(page, served, "diagnose-1", {})
        gain = " (1.2 % of what is left)"
        assert boxes(page) == {WORDS[PLAY]: True, WORDS[FRICTION]: True, WORDS[RIPPLE] + gain: False}
        assert "Misfit" not in said(page)
        tick(page, WORDS[RIPPLE])
        tick(page, WORDS[FRICTION])
        press(page, "Fit the model again with what is ticked")
        job = served.wait("diagnose-3")
        options = {"rate": 250, "effects": [PLAY, RIPPLE]}
        assert job["asked"] == {"inputs": ["files/axis.csv"], "options": options}
        assert f"--effects={PLAY},{RIPPLE} files/axis.csv" in job["line"]
        assert job["state"] == "failed"
        # Where it cannot be fitted, the boxes stay, and the way back.
        wait(page, lambda d: "Back to diagnose-1" in said(d) and boxes(d))
        press(page, "Back to diagnose-1")
        wait(page, lambda d: "Back to" not in said(d) and boxes(d))

        open_diagnosis(page, served, "diagnose-2", {"diagnose-2": "diagnose-1"})
        wait(page, lambda d: "Back to diagnose-1" in said(d))
        assert "Misfit on test data (rms): motor angle 0.001 → 0.0007 rad" in said(page)
        severe = [entry["message"] for entry in page.get_log("browser") if entry["level"] == "SEVERE"]
        assert [text for text in severe if "favicon" not in text] == []  # a browser asks for it beside JSON
