"""The studio's routes. The page is `page/`; nothing has to be built for it."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Collection, Iterator
from contextlib import asynccontextmanager
from functools import cache
from io import BytesIO
from pathlib import Path
from random import randrange
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile

import numpy as np
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.exceptions import HTTPException

from evaps.domain import CHOSEN
from evaps.dsl import Program, UserError
from evaps.models import VERIFIED, Model, load_model, methods_in, model_folder
from evaps.models.checkpoint import CheckpointError
from evaps.robots.base import EngineError
from evaps.robots.world import world
from evaps.studio import forms
from evaps.studio.engines import Engines
from evaps.studio.facts import facts_of
from evaps.studio.guard import guard
from evaps.studio.search import Job, Searches, lines_of
from evaps.synthesis import Budget
from evaps.tasks.generate import unseen_task
from evaps.tasks.task import EXAMPLES, load_task, save_task
from evaps.viewer.film import look, record
from evaps.viewer.render import COLOURS

PAGE = Path(__file__).parent / "page"
PARTS = {path.name: path for path in (*PAGE.glob("*.js"), PAGE / "studio.css", COLOURS)}
MOST_SEEDS = 1_000_000  # of random tasks
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def create_app(
    tasks: Collection[Path] = (),
    model: str = CHOSEN.model,
    hosts: Collection[str] = LOOPBACK,
    everywhere: bool = False,
) -> FastAPI:
    """The studio as an application for an ASGI server.

    Args:
        tasks: task folders that can be loaded, by their names.
        model: a shipped set of checkpoints, a folder of them, or hub:OWNER/NAME.
        hosts: names that the server is called by; requests for others are refused.
        everywhere: whether it listens on all addresses, and may be called by any, and by the machine's name.
    """
    engines, searches = Engines(), Searches()
    folders: dict[str, Path] = {}
    for path in tasks:  # two may have one name
        folders[path.name if path.name not in folders else str(path)] = path

    @asynccontextmanager
    async def life(_: FastAPI) -> AsyncIterator[None]:
        yield
        searches.close()
        engines.close()

    app = FastAPI(title="evaps studio", lifespan=life, docs_url=None, redoc_url=None, openapi_url=None)
    app.state.searches = searches
    guard(app, hosts, everywhere)
    _tell_errors(app)

    @app.get("/")
    def page() -> FileResponse:
        return FileResponse(PAGE / "studio.html")

    @app.get("/{name}")
    def part(name: str) -> FileResponse:
        if name not in PARTS:
            raise HTTPException(404)
        return FileResponse(PARTS[name])

    @app.get("/api/facts")
    def facts() -> dict[str, Any]:
        methods = _methods(model)
        return {**facts_of(world()), "methods": methods, "examples": EXAMPLES, "tasks": sorted(folders)}

    @app.get("/api/health")
    def health() -> dict[str, int]:
        return {"engines_replaced": engines.replaced + searches.replaced}

    @app.post("/api/random-scene")
    def random() -> dict[str, Any]:
        return world().random_scene(np.random.default_rng()).to_json()

    @app.get("/api/tasks/{name:path}")
    def task(name: str) -> dict[str, Any]:
        if name not in folders:
            raise HTTPException(404, f"there is no task {name!r}")
        return forms.task_json(load_task(folders[name]))

    @app.post("/api/random-task")
    def random_task() -> dict[str, Any]:
        with engines.robot() as robot:
            return forms.task_json(unseen_task(randrange(MOST_SEEDS), robot))

    @app.post("/api/check")
    def check(form: forms.ProgramForm) -> dict[str, Any]:
        return forms.program_json(form.program)

    @app.post("/api/run")
    def run(form: forms.RunForm) -> dict[str, Any]:
        scene = forms.read_scene(form.scene)
        program = Program.parse(form.program) if form.program is not None else None
        with engines.robot() as robot:
            if program is not None:
                return forms.run_json(program, *record(program, scene, robot))
            robot.reset(scene)
            return {"moments": [{**forms.moment_json(look(robot)), "lines": []}]}

    @app.post("/api/task.zip")
    def folder(form: forms.TaskForm) -> Response:
        with engines.robot() as robot:
            content = forms.read_task(form, robot)
        headers = {"Content-Disposition": f'attachment; filename="{form.name}.zip"'}
        with TemporaryDirectory() as parent:
            path = Path(parent) / form.name
            save_task(content, path)
            return Response(_zipped(path), media_type="application/zip", headers=headers)

    @app.post("/api/synthesize")
    def synthesize(form: forms.SynthesisForm) -> StreamingResponse:
        solver = _model(model, form.method)
        with engines.robot() as robot:
            content = forms.read_task(form, robot)
        job = searches.begin(solver, content, Budget(form.actions, form.seconds))
        return StreamingResponse(_spoken(job), media_type="application/x-ndjson")

    @app.post("/api/stop/{job}")
    def stop(job: str) -> dict[str, bool]:
        return {"stopped": searches.stop(job)}

    @app.get("/api/report/{job}")
    def report(job: str) -> HTMLResponse:
        content = searches.pages.get(job)
        if content is None:
            raise HTTPException(404, "this report is not kept any longer; run the search again")
        policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
        return HTMLResponse(content, headers={"Content-Security-Policy": policy})

    return app


@cache
def _model(model: str, method: str) -> Model:
    return load_model(model, method)


def _methods(model: str) -> list[str]:
    """Who can answer; where nobody can, pressing the button tells why."""
    try:
        return methods_in(model_folder(model)) or [VERIFIED]
    except CheckpointError:
        return [VERIFIED]


def _spoken(job: Job) -> Iterator[str]:
    """Line after line as JSON; if nobody listens any longer, the search is stopped."""
    try:
        yield json.dumps({"job": job.id}) + "\n"
        for line in lines_of(job):
            yield json.dumps(line) + "\n"
    finally:
        job.stopped.set()


def _zipped(folder: Path) -> bytes:
    file = BytesIO()
    with ZipFile(file, "w") as archive:
        for path in sorted(folder.iterdir()):
            archive.write(path, f"{folder.name}/{path.name}")
    return file.getvalue()


def _tell_errors(app: FastAPI) -> None:
    """Whatever goes wrong is one line, ``{"error": ...}``."""

    @app.exception_handler(UserError)
    def wrong(_: Request, error: UserError) -> JSONResponse:
        return JSONResponse({"error": str(error)}, 422)

    @app.exception_handler(RequestValidationError)
    def malformed(_: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"] if part != "body")
        said = first["msg"].removeprefix("Value error, ")
        if first["type"] == "json_invalid":
            where, said = "", "what was sent is not JSON"
        return JSONResponse({"error": f"{where}: {said}" if where else said}, 422)

    @app.exception_handler(EngineError)
    def broken(_: Request, error: EngineError) -> JSONResponse:
        return JSONResponse({"error": str(error)}, 503)

    @app.exception_handler(Exception)
    def unexpected(_: Request, error: Exception) -> JSONResponse:
        return JSONResponse({"error": f"unexpected {type(error).__name__}: {error}"}, 500)

    @app.exception_handler(HTTPException)
    def refused(_: Request, error: HTTPException) -> JSONResponse:
        return JSONResponse({"error": error.detail}, error.status_code)
