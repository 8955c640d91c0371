"""TOML files of users: models, settings, scenarios."""

import re
import tomllib
from pathlib import Path
from typing import Any

from orchestrator.errors import ScenarioError

MOST_PARTS = 100  # of a dotted key: what reading costs grows with their square
_PART = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY = re.compile(rf"(?<![\w.\"'-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{MOST_PARTS},}}")


def read_toml(path: Path, most: int) -> dict[str, Any]:
    """Return the tables of a TOML file of at most ``most`` bytes."""
    try:
        if path.stat().st_size > most:
            raise ScenarioError(f"{path}: must be at most {most >> 20} MB, but is larger")
        text = path.read_bytes().decode("utf-8-sig")
        if _LONG_KEY.search(text):
            raise RecursionError
        return tomllib.loads(text)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: must be UTF-8 text, but byte {error.start} is not") from None
    except RecursionError:
        raise ScenarioError(f"{path}: must be TOML, but is nested too deeply") from None
    except ValueError as error:  # of which TOMLDecodeError is one
        raise ScenarioError(f"{path}: must be TOML, but is not: {error}") from None
