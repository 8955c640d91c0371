"""How large a page with a long record is, how soon it can be used, and how fast its plots move, in headless Chromium.

Run as ``python -m benchmarks.page_plots [ROWS]`` (default: 1,000,000 rows of a torque and two angles in three linked
plots, and the same on a phone). The record is moved and zoomed 120 times, one step a picture, all plots at once.
Printed: bytes, time until the plots stand, pictures per second, and two processor times per picture, which other load
does not touch: of the page's thread, and of all processes of the browser, which draw without a graphics card here.
"""

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.reporting import Plot, Report, Series, render
from tests.support.browser import browser, missing, open_page, set_screen

SCREENS = {"desktop": (1280, 900), "phone": (390, 844)}
FRAMES = 120
MOVES = """
const [frames, done] = arguments, plot = Plot.all[0], [low, high] = plot.home.x, times = [];
let n = 0;
const next = (now) => {
  times.push(now);
  if (n === frames) return done([times.at(-1) - times[0], Plot.all.filter(({ onScreen }) => onScreen).length]);
  const width = (high - low) * 10 ** (-3 * (n / frames)); // from the whole record to a thousandth of it
  const start = low + (high - low - width) * (0.5 + 0.5 * Math.sin(n / 20));
  plot.go([start, start + width], plot.range.y, false);
  n += 1;
  requestAnimationFrame(next);
};
requestAnimationFrame(next);
"""


def long_page(rows: int) -> str:
    """Return a page with a made-up record of so many rows."""
    dice = np.random.default_rng(1)
    seconds = np.arange(rows, dtype=float) * 1e-3
    torque = np.sin(2.0 * seconds) + 0.1 * dice.standard_normal(rows)
    motor = np.cumsum(np.cumsum(torque)) * 1e-6
    load = motor / 4.0 + 1e-3 * dice.standard_normal(rows)
    plots = (
        Plot("Torque", "time [s]", "torque [N.m]", (Series("torque", seconds, torque, "steps"),)),
        Plot("Motor", "time [s]", "angle [rad]", (Series("motor", seconds, motor),)),
        Plot("Load", "time [s]", "angle [rad]", (Series("load", seconds, load),)),
    )
    return render(Report("A long record", f"{rows} rows.", plots))


def measured(driver: Any, page: Path) -> str:
    """Return what was measured of a page on the screen that is set."""
    driver.set_script_timeout(300)
    driver.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
    began = time.monotonic()
    open_page(driver, page.resolve().as_uri())
    opened, before, all_before = time.monotonic() - began, _busy(driver), _busy_in_all(driver)
    took, seen = driver.execute_async_script(MOVES, FRAMES)
    busy, all_busy = (1e3 * used / FRAMES for used in (_busy(driver) - before, _busy_in_all(driver) - all_before))
    return (
        f"{page.stat().st_size / 1e6:.1f} MB, usable after {opened:.2f} s of the wall and {before:.2f} s of processor; "
        f"{seen} plots in view: {1e3 * FRAMES / took:.0f} pictures/s, {busy:.1f} ms of the page's thread "
        f"and {all_busy:.1f} ms of all of the browser for each"
    )


def _busy(driver: Any) -> float:
    metrics = driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return float(next(m["value"] for m in metrics if m["name"] == "TaskDuration"))


def _busy_in_all(driver: Any) -> float:
    """Return the processor time [s] of the driver's process and all below it; of Linux alone."""
    parents, used = {}, {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it has ended
        parents[int(stat.parent.name)] = int(words[1])
        used[int(stat.parent.name)] = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
    family = {driver.service.process.pid}
    while new := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= new
    return sum(used[pid] for pid in family if pid in used)


def main() -> None:
    """Measure and print."""
    if missing():
        raise SystemExit(missing())
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    with browser() as driver, tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        page.write_text(long_page(rows), encoding="utf-8")
        for name, (width, height) in SCREENS.items():
            set_screen(driver, width, height, "light")
            print(f"{rows} rows, {name}: {measured(driver, page)}")


if __name__ == "__main__":
    main()
