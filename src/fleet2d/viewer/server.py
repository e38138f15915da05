"""The server of the page: this machine only, the runs that it was given, and nothing else."""

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

from fleet2d.errors import ArtifactError, Fleet2DError
from fleet2d.runs.run import open_run
from fleet2d.version import __version__
from fleet2d.viewer.contract import SessionFacts
from fleet2d.viewer.guard import Guard
from fleet2d.viewer.responses import json_answer, problem
from fleet2d.viewer.shown_run import ShownRun, compact_json

PAGE = Path(__file__).parent / "page"
MEDIA = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
}

Answer = Callable[[Request], Awaitable[Response]]


class LiveRoutes(Protocol):
    """What a running simulation adds to the server."""

    def routes(self) -> list[Route]:
        """Return its routes."""


class Shelf:
    """The runs that are served, each opened when it is first asked for."""

    def __init__(self, sources: Sequence[Path | ShownRun]) -> None:
        """Open nothing yet."""
        self._sources = list(sources)
        self._opened: dict[int, ShownRun] = {}

    @property
    def titles(self) -> list[str]:
        """What the runs are called."""
        return [
            source.title if isinstance(source, ShownRun) else source.resolve().name
            for source in self._sources
        ]

    def run(self, number: int) -> ShownRun:
        """Return a run.

        Raises:
            ArtifactError: There is no such run.
            Fleet2DError: It can't be read.
        """
        if not 0 <= number < len(self._sources):
            raise ArtifactError(f"there is no run {number}")
        if number not in self._opened:
            source = self._sources[number]
            self._opened[number] = (
                source if isinstance(source, ShownRun) else ShownRun(open_run(source))
            )
        return self._opened[number]

    def warm(self) -> None:
        """Work out what the page asks for first; what is wrong is said when it is asked for."""
        for number in range(len(self._sources)):
            with suppress(Fleet2DError, OSError, ValueError, KeyError):
                shown = self.run(number)
                _ = shown.facts_json
                shown.walls(0)
                _ = shown.sightings


def page_app(
    shelf: Shelf, token: str, port: int, live: LiveRoutes | None = None, page: Path = PAGE
) -> ASGIApp:
    """Return the application that serves the page and some runs.

    Args:
        shelf: The runs.
        token: First part of every path.
        port: The port that it is served at.
        live: A running simulation, beside or instead of runs.
        page: The folder of the page's bundle.
    """

    async def session(_: Request) -> Response:
        facts = SessionFacts(runs=shelf.titles, live=live is not None, version=__version__)
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
        Route("/run/{number:int}/facts.json", _of_run(shelf, _facts)),
        Route("/run/{number:int}/sightings.json", _of_run(shelf, _sightings)),
        Route("/run/{number:int}/walls/{walls:int}.json", _of_run(shelf, _walls)),
        Route("/run/{number:int}/tables/{table}.parquet", _of_run(shelf, _table)),
        *(live.routes() if live else ()),
        Route("/{name}", file),
    ]
    return Guard(_below(token, Starlette(routes=routes)), token, port)


def _below(token: str, app: ASGIApp) -> ASGIApp:
    """Serve an application below the token; the guard has compared it."""

    async def served(scope, receive, send) -> None:  # type: ignore[no-untyped-def]
        path = scope.get("path", "")
        if scope["type"] == "http":
            rest = path.removeprefix(f"/{token}") or "/"
            scope = {**scope, "path": rest, "raw_path": rest.encode(), "root_path": ""}
        await app(scope, receive, send)

    return served


def _of_run(shelf: Shelf, answer: Callable[[ShownRun, Request], Response]) -> Answer:
    """Return a route that answers of a run, or says what is wrong with it."""

    def work(request: Request) -> Response:
        try:
            return answer(shelf.run(request.path_params["number"]), request)
        except Fleet2DError as error:
            return problem(str(error))
        except (OSError, ValueError, KeyError) as error:
            return problem(f"the run can't be read, its files are damaged ({error!r})")

    async def served(request: Request) -> Response:
        return await run_in_threadpool(work, request)

    return served


def _facts(shown: ShownRun, _: Request) -> Response:
    return json_answer(shown.facts_json)


def _sightings(shown: ShownRun, _: Request) -> Response:
    return json_answer(compact_json(shown.sightings))


def _walls(shown: ShownRun, request: Request) -> Response:
    return json_answer(compact_json(shown.walls(request.path_params["walls"])))


def _table(shown: ShownRun, request: Request) -> Response:
    path = shown.table_path(request.path_params["table"])
    return FileResponse(path, media_type="application/vnd.apache.parquet")
