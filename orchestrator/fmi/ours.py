"""Which FMUs are our own: those whose content is what a build of ours wrote on this machine.

What an FMU says of itself proves nothing, so every build leaves the hash of what it wrote in the user's cache. FMUs
that are not listed there run in a child process behind walls.
"""

import contextlib
from pathlib import Path

from orchestrator.errors import FmuError
from orchestrator.shared.cache import cache_directory
from orchestrator.shared.isolation.archives import content_hash

_known: set[str] = set()


def record(path: Path) -> None:
    """Remember the content of the FMU at ``path``, which has just been built, as our own."""
    digest = content_hash(path)
    _known.add(digest)
    with contextlib.suppress(OSError):
        (cache_directory("built") / digest).touch()


def is_ours(path: Path) -> bool:
    """Return whether the content of the FMU at ``path`` was built here; an unpacked FMU never counts."""
    try:
        digest = content_hash(path)
    except FmuError:
        return False
    return digest in _known or (cache_directory("built") / digest).is_file()
