"""A headless browser for tests of pages: Chromium through Selenium, where both are installed."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--force-color-profile=srgb",
)


def missing() -> str:
    """Return what is not installed, empty when a browser can be used."""
    try:
        import selenium  # noqa: F401
    except ImportError:
        return "selenium is not installed"
    lacking = [name for name in ("chromium", "chromedriver") if not shutil.which(name)]
    return f"{' and '.join(lacking)} not installed" if lacking else ""


@contextmanager
def browser(requests: bool = False) -> Iterator[Any]:
    """Yield a Selenium driver with a fresh profile that records what the page logs; asked to, what it requests too."""
    os.environ["SE_OFFLINE"] = "true"
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    with tempfile.TemporaryDirectory() as profile:
        for flag in (*FLAGS, f"--user-data-dir={profile}"):
            options.add_argument(flag)
        logs = ("browser", "performance") if requests else ("browser",)
        options.set_capability("goog:loggingPrefs", dict.fromkeys(logs, "ALL"))
        driver = webdriver.Chrome(options=options, service=Service(str(shutil.which("chromedriver"))))
        try:
            yield driver
        finally:
            driver.quit()


def set_screen(driver: Any, width: int, height: int, scheme: str) -> None:
    """Give the page a screen of this size in CSS pixels, and a system theme ("light" or "dark"), and have it drawn."""
    mobile = width < 600
    metrics = {"width": width, "height": height, "deviceScaleFactor": 2 if mobile else 1, "mobile": mobile}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    draw(driver)


def draw(driver: Any) -> None:
    """Wait until the page shows what it has drawn for its size: it draws with the next frame."""
    driver.execute_async_script("const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done))")


def whole_page(driver: Any, path: Path, width: int, scheme: str) -> None:
    """Save a screenshot of the whole page."""
    set_screen(driver, width, 900, scheme)
    height = int(driver.execute_script("return document.documentElement.scrollHeight"))
    set_screen(driver, width, height, scheme)
    driver.save_screenshot(str(path))


def open_page(driver: Any, address: str) -> None:
    """Open a page and wait until its program has run."""
    from selenium.webdriver.support.wait import WebDriverWait

    driver.get(address)
    ready = "return document.readyState === 'complete'"
    WebDriverWait(driver, 600).until(lambda opened: opened.execute_script(ready))
