"""The stored runs that a page shows, as responses of the server."""

from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from fleet2d.errors import ArtifactError, Fleet2DError
from fleet2d.runs.run import open_run
from fleet2d.runtime.memory import release_memory
from fleet2d.viewer.contract import Problem
from fleet2d.viewer.page_data import PageData, compact_json
from fleet2d.viewer.run_notes import read_notes, write_notes

Endpoint = Callable[[Request], Awaitable[Response]]


def json_answer(content: bytes, status: int = 200) -> Response:
    """Return a response of JSON bytes."""
    return Response(content, status, media_type="application/json")


def problem(message: str, status: int = 422) -> Response:
    """Return a response with the reason why something can't be shown or done."""
    return json_answer(compact_json(Problem(message=message)), status)


class ServedRuns:
    """The runs that are served; each is opened when it is first requested."""

    def __init__(self, sources: Sequence[Path | PageData]) -> None:
        """Name run directories, or data of runs; nothing is opened."""
        self._sources = list(sources)
        self._data: dict[int, PageData] = {}

    def add(self, data: PageData) -> int:
        """Serve another run; return its number."""
        self._sources.append(data)
        return len(self._sources) - 1

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
                _ = data.tracks
                _ = data.sightings
        release_memory()  # the tables that were read

    async def _store_notes(self, request: Request) -> Response:
        body = await json_body(request)
        if isinstance(body, Response):
            return body
        store = _endpoint(
            self, lambda data, _: json_answer(compact_json(write_notes(data.run, body)))
        )
        return await store(request)

    def routes(self) -> list[Route]:
        """Return the routes of the data of all runs."""
        return [
            Route("/run/{number:int}/facts.json", _endpoint(self, _facts)),
            Route("/run/{number:int}/sightings.json", _endpoint(self, _sightings)),
            Route("/run/{number:int}/tracks.bin", _endpoint(self, _tracks)),
            Route("/run/{number:int}/notes.json", _endpoint(self, _notes)),
            Route("/run/{number:int}/notes", self._store_notes, methods=["POST"]),
            Route("/run/{number:int}/walls/{walls:int}.json", _endpoint(self, _walls)),
            Route("/run/{number:int}/film/{step:int}.mp4", _endpoint(self, _film)),
            Route("/run/{number:int}/tables/{table}.parquet", _endpoint(self, _table)),
        ]


def _notes(data: PageData, _: Request) -> Response:
    return json_answer(compact_json(read_notes(data.run)))


async def json_body(request: Request) -> bytes | Response:
    """Return the body of a request that must be JSON, or the refusal."""
    if request.headers.get("content-type", "").split(";")[0] != "application/json":
        return problem("a change must be requested as JSON", 415)
    return await request.body()


def endpoint(respond: Callable[[Request], Response]) -> Endpoint:
    """Return an endpoint that works in a thread; its response to errors is their message."""

    def work(request: Request) -> Response:
        try:
            return respond(request)
        except Fleet2DError as error:
            return problem(str(error))

    async def serve(request: Request) -> Response:
        return await run_in_threadpool(work, request)

    return serve


def _endpoint(runs: ServedRuns, respond: Callable[[PageData, Request], Response]) -> Endpoint:
    """Return the endpoint of data of a run."""

    def work(request: Request) -> Response:
        try:
            return respond(runs.data(request.path_params["number"]), request)
        except (OSError, ValueError, KeyError) as error:
            raise ArtifactError(
                f"the run can't be read: its files are damaged ({error!r})"
            ) from error

    return endpoint(work)


def _facts(data: PageData, _: Request) -> Response:
    return json_answer(data.facts_json)


def _tracks(data: PageData, _: Request) -> Response:
    return Response(data.tracks, media_type="application/octet-stream")


def _sightings(data: PageData, _: Request) -> Response:
    return json_answer(compact_json(data.sightings))


def _film(data: PageData, request: Request) -> Response:
    return FileResponse(data.film_path(request.path_params["step"]), media_type="video/mp4")


def _walls(data: PageData, request: Request) -> Response:
    return json_answer(compact_json(data.walls(request.path_params["walls"])))


def _table(data: PageData, request: Request) -> Response:
    path = data.table_path(request.path_params["table"])
    return FileResponse(path, media_type="application/vnd.apache.parquet")
