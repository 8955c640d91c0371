"""What the installation weighs: megabytes of each library, and those that go when one dependency goes.

    python -m tools.install_size

The environment that runs it must have the project's dependencies; extras are not counted.
"""

import re
import tomllib
from importlib import metadata
from pathlib import Path

from tools import refuse_arguments

PROJECT = Path(__file__).resolve().parents[1] / "pyproject.toml"
NAME = re.compile(r"[\w.-]+")
LARGEST = 12


def installed_sizes(dependencies: list[str]) -> dict[str, float]:
    """Return the size [MB] of each library that dependencies need, by its name."""
    sizes: dict[str, float] = {}
    waiting = list(dependencies)
    while waiting:
        match = NAME.match(waiting.pop())
        assert match
        library = metadata.distribution(match[0])
        name = re.sub(r"[-_.]+", "-", library.name).lower()
        if name not in sizes:
            paths = [Path(str(file.locate())) for file in library.files or []]
            sizes[name] = sum(path.stat().st_size for path in paths if path.exists()) / 1e6
            waiting += [text for text in library.requires or [] if _applies(text)]
    return sizes


def _applies(requirement: str) -> bool:
    """Return whether a requirement is of no extra, and its library is here: those of other systems are not."""
    if "extra ==" in requirement:
        return False
    match = NAME.match(requirement)
    return match is not None and any(True for _ in metadata.Distribution.discover(name=match[0]))


def main() -> None:
    """Print both tables."""
    dependencies = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["dependencies"]
    sizes = installed_sizes(dependencies)
    print(f"in all {sum(sizes.values()):.0f} MB")
    for name, size in sorted(sizes.items(), key=lambda entry: -entry[1])[:LARGEST]:
        print(f"  {name:<24}{size:7.1f} MB")
    for dependency in dependencies:
        rest = installed_sizes([other for other in dependencies if other != dependency])
        gone = {name: size for name, size in sizes.items() if name not in rest}
        print(f"without {dependency}: {sum(gone.values()):.1f} MB less ({', '.join(sorted(gone)) or 'nothing'})")


if __name__ == "__main__":
    refuse_arguments(__doc__)
    main()
