"""Screenshots of reports at desktop and phone width, in light and dark, to be looked at.

    python -m tests.support.screenshots --out shots results/sweep results/estimate ...

Exit code 1 when a page logs anything to the browser's console, or is wider than the screen.
"""

import argparse
import sys
from pathlib import Path

from tests.support.browser import browser, missing, set_screen, whole_page

WIDTHS = {"desktop": 1280, "phone": 390}


def main() -> int:
    """Take the pictures and print their names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directories", nargs="+", type=Path, metavar="DIR", help="with a report.html each")
    parser.add_argument("--out", type=Path, default=Path("screenshots"))
    args = parser.parse_args()
    if missing():
        raise SystemExit(missing())
    args.out.mkdir(parents=True, exist_ok=True)
    bad = 0
    with browser() as driver:
        for directory in args.directories:
            for device, width in WIDTHS.items():
                for scheme in ("light", "dark"):
                    set_screen(driver, width, 900, scheme)
                    driver.get((directory / "report.html").resolve().as_uri())
                    picture = args.out / f"{directory.name}-{device}-{scheme}.png"
                    whole_page(driver, picture, width, scheme)
                    wide = driver.execute_script("return document.documentElement.scrollWidth") > width
                    logged = driver.get_log("browser")
                    bad += wide or bool(logged)
                    print(picture, "too wide" if wide else "", *(entry["message"] for entry in logged))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
