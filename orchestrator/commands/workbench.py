"""``workbench``: all of it in the browser, on this machine alone."""

import argparse
import sys
import webbrowser

from filelock import FileLock, Timeout

from orchestrator.errors import InputError
from orchestrator.workbench.session import open_session


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("--port", type=int, default=0, metavar="N", help="port on 127.0.0.1 (default: a free one)")
    parser.add_argument("--no-browser", action="store_true", help="print the address without opening a browser")


def run(args: argparse.Namespace) -> int:
    """Serve the session in ``--out`` until Ctrl-C."""
    if not 0 <= args.port <= 65535:
        raise InputError(f"`port` must be between 0 and 65535, but is {args.port}", "port")
    try:
        from orchestrator.workbench.server import serve
    except ImportError as error:
        raise InputError(
            f"`workbench` needs starlette and uvicorn, but {error.name} is missing: "
            "pip install 'backlash-cosim[workbench]'"
        ) from None
    session = open_session(args.out)

    def tell(address: str) -> None:
        sys.stdout.write(f"Workbench: {address}\nSession: {session.folder} (files and results stay there)\n")
        sys.stdout.write("Ctrl-C ends it and all of its jobs\n")
        sys.stdout.flush()
        if not args.no_browser:
            webbrowser.open(address)

    try:
        with FileLock(session.folder / ".lock", timeout=0):
            serve(session, args.port, tell)
    except Timeout:
        raise InputError(
            f"`out` must be a directory that no other workbench uses, but {session.folder} is in use", "out"
        ) from None
    return 0
