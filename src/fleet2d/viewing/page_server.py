"""The server of the page: it serves the page and some runs on this machine, and nothing else."""

import asyncio
import html
import re
import secrets
import signal
import socket
import threading
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from http import HTTPStatus
from pathlib import Path
from types import FrameType
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from fleet2d import __version__
from fleet2d.bounds import one_line
from fleet2d.errors import InputError, end_by_signal
from fleet2d.runs.run import Run
from fleet2d.storage.secret_files import UnusableSecretError, user_secret
from fleet2d.viewing.contract import SessionFacts
from fleet2d.viewing.live import LiveRun
from fleet2d.viewing.live_runs import LiveRuns
from fleet2d.viewing.page_data import PageData
from fleet2d.viewing.served_runs import ServedRuns, json_answer, problem

HOSTS = ("127.0.0.1", "localhost", "[::1]")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:;"
    " connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def new_token() -> str:
    """Return a token that can't be guessed."""
    return secrets.token_urlsafe(24)


def kept_token() -> str:
    """Return the token of this user, so that links stay valid; a new one where none can be kept."""
    with suppress(UnusableSecretError):
        return user_secret("view-token").decode()
    return new_token()


class Guard:
    """Refuses requests of other web pages, for other host names, and without the token.

    Another web page can make a browser send requests here, but it doesn't know the token, and the
    browser adds the origin of the request (`Origin`, `Sec-Fetch-Site`). A foreign name that points
    at this machine is visible in `Host`.
    """

    def __init__(self, app: ASGIApp, token: str, port: int, seen_at: str = "") -> None:
        """Guard an application.

        Args:
            app: The application that serves allowed requests, whose paths have no token.
            token: The first part of every allowed path.
            port: The port of the server.
            seen_at: Another address under which browsers reach it, such as that of a proxy.
        """
        self._app = app
        self._token = token
        self._hosts = {f"{host}:{port}" for host in HOSTS}
        self._origins = {f"http://{host}" for host in self._hosts}
        if seen_at:
            scheme, host = urlsplit(seen_at)[:2]
            self._hosts.add(host)
            self._origins.add(f"{scheme}://{host}")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        reason = self._refusal(scope)
        if reason:
            response = _refused(reason, Headers(scope=scope).get("accept", ""))
            await response(scope, receive, _with_headers(send))
            return
        path = scope["path"].removeprefix(f"/{self._token}") or "/"
        inner = {**scope, "path": path, "raw_path": path.encode(), "root_path": ""}
        await self._app(inner, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> str:
        """Return why a request is refused; empty if it is allowed."""
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self._hosts:
            return (
                "this server answers under 127.0.0.1 and localhost and its own port only; start it"
                " with --seen-at and the address of your tunnel or proxy"
            )
        origin = headers.get("origin")
        if origin is not None and origin not in self._origins:
            return "this request comes from another web page"
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return "this request comes from another web page"
        is_change = scope["method"] not in ("GET", "HEAD")
        if is_change and origin is None:
            return "this request does not say which page it comes from"
        token = scope["path"].lstrip("/").split("/", 1)[0]
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return "the address lacks its token: open the address that fleet2d view printed"
        return ""


def _refused(reason: str, accepted: str) -> Response:
    """Return a refusal: a page for somebody who follows an old link, else JSON."""
    if "text/html" not in accepted:
        return JSONResponse({"message": reason}, HTTPStatus.FORBIDDEN)
    title = "This can't be shown"
    page = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title} – Fleet2D</title>'
        f"<h1>{title}</h1><p>{html.escape(reason)}</p></html>"
    )
    return HTMLResponse(page, HTTPStatus.FORBIDDEN)


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers[name] = value
        await send(message)

    return send_with_headers


PAGE = Path(__file__).parent / "page"
MEDIA = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
}


def page_app(
    runs: ServedRuns, token: str, port: int, live: LiveRuns | None = None, seen_at: str = ""
) -> ASGIApp:
    """Return the application that serves the page and some runs.

    Args:
        runs: The runs.
        token: The first part of every path.
        port: The port of the server.
        live: Running simulations, beside or instead of runs; None: there are none yet.
        seen_at: Another address under which browsers reach it.
    """
    live = LiveRuns(runs) if live is None else live

    async def session(_: Request) -> Response:
        facts = SessionFacts(runs=runs.titles, live=live.sessions(), version=__version__)
        return json_answer(facts)

    async def file(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        path = PAGE / name
        if path.suffix not in MEDIA or not path.is_file():
            return problem(f"there is no page {name}", 404)
        return FileResponse(path, media_type=MEDIA[path.suffix])

    routes = [
        Route("/", file),
        Route("/session.json", session),
        *runs.routes(),
        *live.routes(),
        Route("/{name}", file),
    ]
    return Guard(Starlette(routes=routes), token, port, seen_at)


HOST = "127.0.0.1"
MAX_RUNS = 4


class _Server(uvicorn.Server):
    """A server that ends the streams of a running simulation, which would keep it open."""

    def __init__(self, config: uvicorn.Config, live: LiveRuns) -> None:
        super().__init__(config)
        self._live = live

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End the server on a signal."""
        self._live.end_streams()
        super().handle_exit(sig, frame)


UNTIL = "shown until you press Ctrl-C; the address works on this machine only"
NO_BROWSER = (
    "no browser could be opened: open the address in one, forward its port if this machine is"
    " another one (ssh -L PORT:127.0.0.1:PORT), or write a file: `fleet2d export RUN_DIR run.html`"
)


class PageServer:
    """The server of the page, with its port.

    Attributes:
        address: The address of the page, with its token.
        listens_at: Host and port.
    """

    def __init__(
        self,
        sources: Sequence[Path | PageData],
        *,
        port: int = 0,
        live: LiveRun | None = None,
        seen_at: str = "",
    ) -> None:
        """Bind a port of this machine.

        Args:
            sources: Run directories, or data of runs.
            port: The port; 0: a free one.
            live: A running simulation.
            seen_at: The address under which browsers reach it, if not by this port: of a tunnel
                (`ssh -L`) or a proxy.

        Raises:
            InputError: The port is in use, or `seen_at` isn't an address.
        """
        if seen_at and not re.fullmatch(r"https?://[\w.:\[\]-]+(/[\w./~-]*)?", seen_at):
            raise InputError(
                f"--seen-at {one_line(seen_at, 80)!r} is not the address of a page: give one like"
                " http://localhost:9000 or https://robots.example/fleet2d"
            )
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((HOST, port))
            self._socket.listen()  # now, as the browser may ask before the server runs
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise InputError(f"port {port} can't be used: {error}; choose another --port") from None
        host, self._port = self._socket.getsockname()[:2]
        self.listens_at: tuple[str, int] = (str(host), int(self._port))
        token = kept_token()
        base = seen_at.rstrip("/") or f"http://{HOST}:{self._port}"
        self.address = f"{base}/{token}/"
        self._runs = ServedRuns(sources)
        self._live = LiveRuns(self._runs, live)
        app = page_app(self._runs, token, self._port, self._live, seen_at=seen_at)
        # Uvicorn would report a page that is open when the server ends as an error.
        config = uvicorn.Config(
            app, log_level="critical", lifespan="off", ws="none", timeout_graceful_shutdown=1
        )
        self._server = _Server(config, self._live)

    def show(self, *, open_browser: bool, announce: Callable[[str], None]) -> None:
        """Announce the address, open a browser if requested, serve until Ctrl-C or SIGTERM."""
        announce(f"{self.address}\n{UNTIL}")
        if open_browser and not webbrowser.open(self.address):
            announce(NO_BROWSER)
        # The server raises a signal again when it has ended: whoever called it still has to close.
        before = signal.signal(signal.SIGTERM, end_by_signal)
        try:
            with suppress(KeyboardInterrupt):
                self.run()
        finally:
            signal.signal(signal.SIGTERM, before)

    def run(self) -> None:
        """Serve until Ctrl-C."""
        threading.Thread(target=self._runs.preload, daemon=True, name="fleet2d-preload").start()
        asyncio.run(self._server.serve(sockets=[self._socket]))

    def close(self) -> None:
        """Free the port of a server that was never run."""
        self._socket.close()

    def end_branches(self) -> list[Run]:
        """End the branches that pages began, and return their runs."""
        return self._live.end_branches()

    def start(self) -> Callable[[], None]:
        """Serve in a thread; return a function that stops it."""
        thread = threading.Thread(target=self.run, daemon=True, name="fleet2d-view")
        thread.start()

        def stop() -> None:
            self._server.should_exit = True
            thread.join(timeout=5)

        return stop
