"""The stored runs that a page shows, as responses of the server."""

from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from fleet2d.errors import ArtifactError, Fleet2DError
from fleet2d.runs.run import open_run
from fleet2d.runtime.memory import release_memory
from fleet2d.viewing.contract import Problem
from fleet2d.viewing.page_data import PageData, compact_json
from fleet2d.viewing.run_notes import read_notes, write_notes

Endpoint = Callable[[Request], Awaitable[Response]]


def json_answer(content: object, status: int = 200) -> Response:
    """Return a response of content as JSON."""
    return Response(compact_json(content), status, media_type="application/json")


def problem(message: str, status: int = 422) -> Response:
    """Return a response with the reason why something can't be shown or done."""
    return json_answer(Problem(message=message), status)


def endpoint(respond: Callable[[Request, bytes], Response]) -> Endpoint:
    """Return an endpoint that works in a thread, and answers an error with its message.

    Args:
        respond: Returns the response to a request and its body; only a POST has one, of JSON.
    """

    def work(request: Request, body: bytes) -> Response:
        try:
            return respond(request, body)
        except (Fleet2DError, ValueError) as error:
            return problem(str(error))

    async def serve(request: Request) -> Response:
        body = b""
        if request.method == "POST":
            if request.headers.get("content-type", "").split(";")[0] != "application/json":
                return problem("a change must be requested as JSON", 415)
            body = await request.body()
        return await run_in_threadpool(work, request, body)

    return serve


Respond = Callable[[PageData, dict[str, Any], bytes], Response]

RESPONSES: dict[str, Respond] = {
    "facts.json": lambda data, _, __: Response(data.facts_json, media_type="application/json"),
    "sightings.json": lambda data, _, __: json_answer(data.sightings),
    "postures.json": lambda data, _, __: json_answer(data.postures),
    "tracks.bin": lambda data, _, __: Response(data.tracks, media_type="application/octet-stream"),
    "notes.json": lambda data, _, __: json_answer(read_notes(data.run)),
    "notes": lambda data, _, body: json_answer(write_notes(data.run, body)),
    "walls/{walls:int}.json": lambda data, names, _: json_answer(data.walls(names["walls"])),
    "film/{step:int}.mp4": lambda data, names, _: FileResponse(
        data.film_path(names["step"]), media_type="video/mp4"
    ),
    "tables/{table}.parquet": lambda data, names, _: FileResponse(
        data.table_path(names["table"]), media_type="application/vnd.apache.parquet"
    ),
}
"""The responses to requests about a run, by path; `notes` stores them, the others only read."""


class ServedRuns:
    """The runs that are served; each is opened when it is first requested."""

    def __init__(self, sources: Sequence[Path | PageData]) -> None:
        """Name run directories, or data of runs; nothing is opened."""
        self._sources = list(sources)

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
        source = self._sources[number]
        if not isinstance(source, PageData):
            source = self._sources[number] = PageData(open_run(source))
        return source

    def preload(self) -> None:
        """Compute the data that the page requests first; errors are reported when it does."""
        for number in range(len(self._sources)):
            with suppress(Fleet2DError, OSError, ValueError, KeyError):
                data = self.data(number)
                _ = data.facts_json
                data.walls(0)
                _ = data.tracks
                _ = data.sightings
                _ = data.postures
        release_memory()  # tables that were read aren't needed again

    def routes(self) -> list[Route]:
        """Return the routes of the data of all runs."""
        return [
            Route(
                f"/run/{{number:int}}/{path}",
                endpoint(partial(self._answer, respond)),
                methods=["POST" if path == "notes" else "GET"],
            )
            for path, respond in RESPONSES.items()
        ]

    def _answer(self, respond: Respond, request: Request, body: bytes) -> Response:
        names = request.path_params
        try:
            return respond(self.data(names["number"]), names, body)
        except (OSError, ValueError, KeyError) as error:
            raise ArtifactError(
                f"the run can't be read: its files are damaged ({error!r})"
            ) from error
