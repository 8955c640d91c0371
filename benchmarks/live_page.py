"""How long a live page takes from a slider to its new curves, in headless Chromium.

Run as ``python -m benchmarks.live_page DIR ...`` with result directories of simulate, estimate or diagnose. Each slider
is moved to eleven places; a time is from the slider's event to the drawn curves. Printed: sizes, median, longest
and the processor time of the page's thread per move, layout and painting included, which other load does not touch.
"""

import statistics
import sys
from pathlib import Path
from typing import Any

from tests.support.browser import browser, missing, set_screen

MOVES = """
const done = arguments[0], live = document.querySelector(".live").live, times = [];
const places = live.sliders.flatMap(({ input }) => Array.from({ length: 11 }, (_, n) => [input, 100 * n]));
const next = () => {
  if (!places.length) return done([times, live.times.length, live.said.textContent]);
  const [input, place] = places.shift();
  input.value = place;
  input.dispatchEvent(new Event("input"));
  requestAnimationFrame(() => { times.push(live.took); setTimeout(next, 20); });
};
const ready = () => (live.took ? next() : setTimeout(ready, 10));
ready();
"""


def measured(driver: Any, folder: Path) -> tuple[list[float], int, float]:
    """Return the times [ms], the rows of a simulation, and the processor time of a move [ms]."""
    page = folder / "report.html"
    set_screen(driver, 1280, 900, "light")
    driver.set_script_timeout(120)
    driver.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
    driver.get(page.resolve().as_uri())
    driver.execute_async_script(MOVES)  # compiled and warm
    before = _busy(driver)
    times, rows, _ = driver.execute_async_script(MOVES)
    return times, rows, 1e3 * (_busy(driver) - before) / len(times)


def _busy(driver: Any) -> float:
    metrics = driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return float(next(m["value"] for m in metrics if m["name"] == "TaskDuration"))


def main() -> None:
    """Measure and print."""
    if missing():
        raise SystemExit(missing())
    with browser() as driver:
        for folder in map(Path, sys.argv[1:]):
            times, rows, busy = measured(driver, folder)
            size = (folder / "report.html").stat().st_size / 1e3
            print(
                f"{folder.name}: {size:.0f} kB, {rows} rows; {len(times)} moves, "
                f"median {statistics.median(times):.1f} ms, longest {max(times):.1f} ms; "
                f"processor {busy:.1f} ms"
            )


if __name__ == "__main__":
    main()
