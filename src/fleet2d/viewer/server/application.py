"""The server of the page: it serves the page and some runs on this machine, and nothing else."""

from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from fleet2d import __version__
from fleet2d.errors import ArtifactError, Fleet2DError
from fleet2d.runs.run import open_run
from fleet2d.viewer.facts.contract import SessionFacts
from fleet2d.viewer.facts.page_data import PageData, compact_json
from fleet2d.viewer.server.guard import Guard
from fleet2d.viewer.server.responses import json_answer, problem

PAGE = Path(__file__).parents[1] / "page"
MEDIA = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
}

Endpoint = Callable[[Request], Awaitable[Response]]


class LiveRoutes(Protocol):
    """The routes that a running simulation adds to the server."""

    def routes(self) -> list[Route]:
        """Return its routes."""

    def end_streams(self) -> None:
        """End all open responses; called in the handler of a signal."""


class ServedRuns:
    """The runs that are served; each is opened when it is first requested."""

    def __init__(self, sources: Sequence[Path | PageData]) -> None:
        """Name run directories, or data of runs; nothing is opened."""
        self._sources = list(sources)
        self._data: dict[int, PageData] = {}

    @property
    def titles(self) -> list[str]:
        """The titles of the runs."""
        return [
            source.title if isinstance(source, PageData) else source.resolve().name
            for source in self._sources
        ]

    def data(self, number: int) -> PageData:
        """Return the data of a run.

        Raises:
            ArtifactError: There is no such run.
            Fleet2DError: It can't be read.
        """
        if not 0 <= number < len(self._sources):
            raise ArtifactError(f"there is no run {number}")
        if number not in self._data:
            source = self._sources[number]
            self._data[number] = (
                source if isinstance(source, PageData) else PageData(open_run(source))
            )
        return self._data[number]

    def preload(self) -> None:
        """Compute the data that the page requests first; errors are reported on its request."""
        for number in range(len(self._sources)):
            with suppress(Fleet2DError, OSError, ValueError, KeyError):
                data = self.data(number)
                _ = data.facts_json
                data.walls(0)
                _ = data.sightings


def page_app(
    runs: ServedRuns, token: str, port: int, live: LiveRoutes | None = None, page: Path = PAGE
) -> ASGIApp:
    """Return the application that serves the page and some runs.

    Args:
        runs: The runs.
        token: The first part of every path.
        port: The port of the server.
        live: A running simulation, beside or instead of runs.
        page: The folder of the page's bundle.
    """

    async def session(_: Request) -> Response:
        facts = SessionFacts(runs=runs.titles, live=live is not None, version=__version__)
        return json_answer(compact_json(facts))

    async def file(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        path = page / name
        if path.suffix not in MEDIA or not path.is_file():
            return problem(f"there is no page {name}", 404)
        return FileResponse(path, media_type=MEDIA[path.suffix])

    routes = [
        Route("/", file),
        Route("/session.json", session),
        Route("/run/{number:int}/facts.json", _endpoint(runs, _facts)),
        Route("/run/{number:int}/sightings.json", _endpoint(runs, _sightings)),
        Route("/run/{number:int}/walls/{walls:int}.json", _endpoint(runs, _walls)),
        Route("/run/{number:int}/tables/{table}.parquet", _endpoint(runs, _table)),
        *(live.routes() if live else ()),
        Route("/{name}", file),
    ]
    return Guard(_strip_token(token, Starlette(routes=routes)), token, port)


def _strip_token(token: str, app: ASGIApp) -> ASGIApp:
    """Remove the token from paths; the guard has compared it."""

    async def serve(scope, receive, send) -> None:  # type: ignore[no-untyped-def]
        path = scope.get("path", "")
        if scope["type"] == "http":
            path = path.removeprefix(f"/{token}") or "/"
            scope = {**scope, "path": path, "raw_path": path.encode(), "root_path": ""}
        await app(scope, receive, send)

    return serve


def _endpoint(runs: ServedRuns, respond: Callable[[PageData, Request], Response]) -> Endpoint:
    """Return the endpoint of data of a run; its response to errors is their message."""

    def work(request: Request) -> Response:
        try:
            return respond(runs.data(request.path_params["number"]), request)
        except Fleet2DError as error:
            return problem(str(error))
        except (OSError, ValueError, KeyError) as error:
            return problem(f"the run can't be read: its files are damaged ({error!r})")

    async def endpoint(request: Request) -> Response:
        return await run_in_threadpool(work, request)

    return endpoint


def _facts(data: PageData, _: Request) -> Response:
    return json_answer(data.facts_json)


def _sightings(data: PageData, _: Request) -> Response:
    return json_answer(compact_json(data.sightings))


def _walls(data: PageData, request: Request) -> Response:
    return json_answer(compact_json(data.walls(request.path_params["walls"])))


def _table(data: PageData, request: Request) -> Response:
    path = data.table_path(request.path_params["table"])
    return FileResponse(path, media_type="application/vnd.apache.parquet")
