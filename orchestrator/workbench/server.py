"""The server: files in, jobs, results out. Every path stands behind the guard's token."""

import asyncio
import json
import math
import re
import secrets
import socket
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from orchestrator.errors import InputError, OrchestratorError, RecordError
from orchestrator.fmi.preview import FmuPreview
from orchestrator.records.model_file import read_model
from orchestrator.records.preview import LogPreview
from orchestrator.reporting import render
from orchestrator.scenarios.ssp.preview import SystemPreview
from orchestrator.shared.output import write_whole
from orchestrator.workbench.command_lines import command_line
from orchestrator.workbench.compare import compare_results
from orchestrator.workbench.curves import CurvesAsked, CurvesShown, InterfaceAsked, LookAsked
from orchestrator.workbench.guard import Guard
from orchestrator.workbench.jobs import Jobs
from orchestrator.workbench.log_readers import LogReaders
from orchestrator.workbench.model_fields import model_fields, model_text
from orchestrator.workbench.notes import Notes
from orchestrator.workbench.scenario_text import scenario_text
from orchestrator.workbench.session import SessionFolder, kind_of
from orchestrator.workbench.settings import WorkbenchSettings
from orchestrator.workbench.simulation import SliderModel, SliderModels
from orchestrator.workbench.uploads import UploadTooLargeError, save_upload

# What a browser shows; all else is handed out as a download.
_SHOWN = {".html": "text/html; charset=utf-8", ".png": "image/png", ".json": "application/json",
          ".txt": "text/plain; charset=utf-8", ".toml": "text/plain; charset=utf-8"}  # fmt: skip
_RESULT_POLICY = "sandbox allow-scripts allow-downloads allow-popups; frame-ancestors 'self'"
_OPTION_IN_ADVICE = re.compile(r"\s*\(`(--)?model`\)")
# The status of an answer that is an error's own line; the first kind that it is counts.
_STATUS = {UploadTooLargeError: 413, RecordError: 422, InputError: 400, OrchestratorError: 500, OSError: 507}
_PLOTS = ("orchestrator.reporting", "templates")  # styles and plots are the reports' own
_OWN_PAGE = Path(__file__).parent / "static" / "index.html"


@dataclass
class Workbench:
    """What the routes share: the session, its jobs, and limits."""

    session: SessionFolder
    settings: WorkbenchSettings
    jobs: Jobs
    models: SliderModels
    notes: Notes
    readers: LogReaders

    async def state(self, request: Request) -> Response:
        """Return files and jobs of the session, and the notes where the page has those of another version."""
        uploads = [
            {"file": self.session.reference_of(path), "name": path.name, "kind": kind_of(path)}
            for path in sorted(self.session.files.iterdir(), key=lambda path: path.stat().st_mtime)
            if path.is_file() and not path.name.startswith(".")
        ]
        jobs = [job.as_plain() for job in self.jobs.all.values()]
        notes = {} if request.query_params.get("notes") == str(self.notes.version) else {"notes": self.notes.all}
        found = {"folder": str(self.session.folder), "files": uploads, "jobs": jobs, "version": self.notes.version}
        return JSONResponse(found | notes)

    async def keep(self, request: Request) -> Response:
        """Take what a page keeps of its work."""
        self.notes.change(await self._asked(request))
        return JSONResponse({"version": self.notes.version})

    async def upload(self, request: Request) -> Response:
        """Take a file."""
        stated = request.headers.get("content-length", "")
        path = await save_upload(
            self.session, request.path_params["name"], request.stream(), int(stated) if stated.isdigit() else None,
            self.settings,
        )  # fmt: skip
        return self._written(path)

    async def columns(self, request: Request) -> Response:
        """Return what a log holds and what its columns would be taken from, with the choices of the page."""
        asked = await self._asked(request)
        log = self._log(asked)
        with self._draft(
            model_text(None, {key: asked[key] for key in ("columns", "header") if key in asked})
        ) as chosen:
            model = await run_in_threadpool(read_model, chosen)
        return await self._read(log, LookAsked(model.columns, model.header), LogPreview)

    async def curves(self, request: Request) -> Response:
        """Return channels of a log by level of detail, as far as they were read."""
        asked = await self._asked(request)
        try:
            wanted = msgspec.convert(asked, CurvesAsked)
        except msgspec.ValidationError as error:
            raise InputError(f"curves must be asked for by places of channels and rows, but: {error}") from None
        return await self._read(self._log(asked), wanted, CurvesShown)

    def _log(self, asked: Mapping[str, Any]) -> Path:
        """Return the log that a page speaks of."""
        log = self.session.path_of(str(asked.get("file")))
        if kind_of(log) == "fmu":
            raise InputError(f"`file` must be a log, but {self.session.reference_of(log)} is an FMU or SSP file")
        return log

    async def _read(self, log: Path, asked: LookAsked | CurvesAsked | InterfaceAsked, answer: type[Any]) -> Response:
        found = await self.readers.ask(log, asked, answer)
        return Response(msgspec.json.encode(found), media_type="application/json")

    async def read_fields(self, request: Request) -> Response:
        """Return a model file as fields; of no file the default model."""
        reference = request.query_params.get("file", "")
        path = self.session.path_of(reference) if reference else None
        try:
            return JSONResponse(await run_in_threadpool(model_fields, path))
        except OrchestratorError as error:
            raise InputError(str(error).replace(f"{self.session.folder}/", "")) from None

    async def write_model(self, request: Request) -> Response:
        """Write a model file of changed fields, once the command's own reader takes it."""
        asked = await self._asked(request)
        base = self.session.path_of(asked["base"]) if asked.get("base") else None
        text = await run_in_threadpool(model_text, base, asked)
        with self._draft(text) as draft:
            await run_in_threadpool(model_fields, draft)
        return self._written(self.session.write_file(str(asked.get("name") or "machine.toml"), text))

    async def start(self, request: Request) -> Response:
        """Start a command."""
        asked = await self._asked(request)
        inputs, options = asked.get("inputs"), asked.get("options", {})
        words = command_line(self.session, asked.get("command"), inputs, options)
        job = self.jobs.start(words[0], words, {"inputs": inputs, "options": options})
        return JSONResponse(job.as_plain(), 201)

    async def stop(self, request: Request) -> Response:
        """Stop a job."""
        return JSONResponse(self.jobs.stop(request.path_params["name"]).as_plain())

    async def remove(self, request: Request) -> Response:
        """Remove a job that has ended, with its results."""
        job = self.jobs.named(request.path_params["name"])
        await run_in_threadpool(self.models.forget, job.folder)
        await self.jobs.remove(job.name)
        return JSONResponse({})

    async def file(self, request: Request) -> Response:
        """Hand out a file of the session: pages and pictures of results to look at, all else to save."""
        path = self.session.path_of(request.path_params["reference"])
        kind = _SHOWN.get(path.suffix) if path.is_relative_to(self.session.results) else None
        headers = {"content-security-policy": _RESULT_POLICY if kind else "sandbox"}
        if kind is None:
            return FileResponse(path, filename=path.name, media_type="application/octet-stream", headers=headers)
        return FileResponse(path, media_type=kind, headers=headers)

    async def variables(self, request: Request) -> Response:
        """Return the interface of an FMU."""
        path = self.session.path_of(request.query_params.get("file", ""))
        if kind_of(path) != "fmu":
            raise InputError(f"`file` must be an FMU or SSP file, but is {self.session.reference_of(path)}")
        answer = SystemPreview if path.suffix.lower() == ".ssp" else FmuPreview
        return await self._read(path, InterfaceAsked(), answer)

    async def write_scenario(self, request: Request) -> Response:
        """Write a scenario that was drawn; whether it fits, its run says."""
        asked = await self._asked(request)
        text = scenario_text(self.session, asked)
        return self._written(self.session.write_file(str(asked.get("name") or "scenario.toml"), text))

    async def sliders(self, request: Request) -> Response:
        """Return the sliders of a result's model, and what was measured."""
        folder = self.jobs.named(request.query_params.get("job", "")).folder
        return JSONResponse(await run_in_threadpool(lambda: self.models.use(folder, SliderModel.describe)))

    async def simulate(self, request: Request) -> Response:
        """Run a result's model with the values of the sliders."""
        asked = await self._asked(request)
        folder, values = self.jobs.named(asked.get("job")).folder, asked.get("values", {})
        if not isinstance(values, Mapping):
            raise InputError("`values` must be numbers by name, but is none")
        return JSONResponse(await run_in_threadpool(lambda: self.models.use(folder, lambda model: model.run(values))))

    async def compare(self, request: Request) -> Response:
        """Return the page on two results of one command."""
        folders = [self.jobs.named(request.query_params.get(name, "")).folder for name in ("first", "second")]
        page = await run_in_threadpool(lambda: render(compare_results(*folders)))
        return Response(page, media_type="text/html", headers={"content-security-policy": _RESULT_POLICY})

    async def _asked(self, request: Request) -> dict[str, Any]:
        """Return what a page asks for: a JSON object of a sensible size."""
        if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
            raise InputError("the request must be JSON (content type application/json), but is not")
        body = b""
        async for chunk in request.stream():
            body += chunk
            if len(body) > self.settings.largest_request:
                raise UploadTooLargeError(f"a request must have at most {self.settings.largest_request} bytes")
        try:
            asked = json.loads(body, parse_constant=_finite, parse_float=_finite, parse_int=_finite)
            json.dumps(asked, ensure_ascii=False).encode("utf-8")  # half a character can be escaped, and be no text
        except (ValueError, RecursionError):
            raise InputError("the request must be JSON of finite numbers and Unicode text, but is not") from None
        if not isinstance(asked, dict):
            raise InputError("the request must be a JSON object, but is not")
        return asked

    def _written(self, path: Path) -> Response:
        return JSONResponse({"file": self.session.reference_of(path), "name": path.name}, 201)

    @contextmanager
    def _draft(self, text: str) -> Iterator[Path]:
        """Give a model file for one look; an error about it does not name it, for nobody has written it."""
        path = self.session.folder / f".look-{secrets.token_hex(8)}.toml"
        write_whole(path, text)
        try:
            yield path
        except OrchestratorError as error:
            raise InputError(str(error).replace(f" in {path}", "")) from None
        finally:
            path.unlink(missing_ok=True)


def _finite(text: str) -> int | float:
    """Return a number of JSON; NaN and what is too large are none."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return int(text) if text.removeprefix("-").isdigit() else value


def _problem(text: str, status: int) -> JSONResponse:
    return JSONResponse({"error": _OPTION_IN_ADVICE.sub("", text) or "the command gave no answer"}, status)


async def _in_words(request: Request, error: Exception) -> Response:
    """Return an error as a line that the page shows."""
    status = next((code for kind, code in _STATUS.items() if isinstance(error, kind)), 400)
    said = f"the session's directory cannot be used: {error.strerror}" if isinstance(error, OSError) else str(error)
    return _problem(said, status)


async def _page(request: Request) -> Response:
    """Hand out the workbench's own page."""
    return FileResponse(_OWN_PAGE)


def application(session: SessionFolder, settings: WorkbenchSettings) -> Starlette:
    """Return the application behind the guard; jobs end with it."""
    jobs = Jobs(session, settings)
    models = SliderModels(settings.slider_models)
    notes, readers = Notes(session.folder, settings.largest_notes), LogReaders(session.folder, settings)
    workbench = Workbench(session, settings, jobs, models, notes, readers)

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        readers.warm()
        yield
        readers.close()
        await jobs.close()
        models.close()

    routes = [
        Route("/", _page),
        Mount("/static", StaticFiles(packages=[("orchestrator.workbench", "static"), _PLOTS])),
        Route("/state", workbench.state),
        Route("/notes", workbench.keep, methods=["POST"]),
        Route("/upload/{name:path}", workbench.upload, methods=["PUT"]),
        Route("/columns", workbench.columns, methods=["POST"]),
        Route("/curves", workbench.curves, methods=["POST"]),
        Route("/model", workbench.read_fields),
        Route("/models", workbench.write_model, methods=["POST"]),
        Route("/jobs", workbench.start, methods=["POST"]),
        Route("/jobs/{name}/stop", workbench.stop, methods=["POST"]),
        Route("/jobs/{name}/remove", workbench.remove, methods=["POST"]),
        Route("/variables", workbench.variables),
        Route("/scenarios", workbench.write_scenario, methods=["POST"]),
        Route("/sliders", workbench.sliders),
        Route("/simulate", workbench.simulate, methods=["POST"]),
        Route("/compare", workbench.compare),
        Route("/file/{reference:path}", workbench.file),
    ]
    errors = dict.fromkeys((*_STATUS, ClientDisconnect), _in_words)
    return Starlette(routes=routes, lifespan=lifespan, exception_handlers=errors)


def serve(
    session: SessionFolder, port: int, tell: Callable[[str], None], settings: WorkbenchSettings | None = None
) -> None:
    """Serve a session on this machine alone until Ctrl-C; all jobs are stopped then.

    Args:
        port: of 127.0.0.1; 0: a free one.
        tell: called with the address, token included, once connections are taken.

    Raises:
        InputError: the port is taken.
    """
    inner = application(session, settings or WorkbenchSettings())
    listener = listen(port)
    token, bound = secrets.token_urlsafe(24), listener.getsockname()[1]
    app = Guard(inner, token, bound)
    config = uvicorn.Config(
        app, log_config=None, access_log=False, server_header=False, proxy_headers=False, date_header=False,
        lifespan="on", ws="none", limit_concurrency=200, timeout_graceful_shutdown=2,
    )  # fmt: skip
    server = uvicorn.Server(config)
    tell(f"http://127.0.0.1:{bound}/{token}/")
    with listener:
        asyncio.run(server.serve(sockets=[listener]))


def listen(port: int) -> socket.socket:
    """Return a socket that takes connections of this machine alone.

    It names its protocol: asyncio sets TCP_NODELAY for sockets that do, and without it each answer waits 40 ms.

    Raises:
        InputError: the port is taken.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise InputError(f"`port` must be free, but {port} is not: {error.strerror}", "port") from None
    return listener


__all__ = ["Workbench", "application", "listen", "serve"]
