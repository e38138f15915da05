"""Run the server at a free port of this machine, and open the browser."""

import asyncio
import socket
import threading
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType

from fleet2d.errors import InputError, extra

with extra("view", "watching needs a server"):
    import starlette  # noqa: F401 - the server needs it, too
    import uvicorn

from fleet2d.viewer.facts.page_data import PageData
from fleet2d.viewer.server.application import LiveRoutes, ServedRuns, page_app
from fleet2d.viewer.server.guard import new_token

HOST = "127.0.0.1"
MOST_RUNS = 4


class _Server(uvicorn.Server):
    """A server that ends the streams of a running simulation, which else would keep it open."""

    def __init__(self, config: uvicorn.Config, live: LiveRoutes | None) -> None:
        super().__init__(config)
        self._live = live

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End the server on a signal."""
        if self._live is not None:
            self._live.end_streams()
        super().handle_exit(sig, frame)


class PageServer:
    """The server of the page, with its port.

    Attributes:
        address: The address of the page, with its token.
        listens_at: Host and port.
    """

    def __init__(
        self, sources: Sequence[Path | PageData], *, port: int = 0, live: LiveRoutes | None = None
    ) -> None:
        """Bind a port of this machine.

        Args:
            sources: Run directories, or data of runs.
            port: The port; 0: a free one.
            live: A running simulation.

        Raises:
            InputError: The port is in use.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((HOST, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise InputError(f"port {port} can't be used: {error}; choose another --port") from None
        host, self._port = self._socket.getsockname()[:2]
        self.listens_at: tuple[str, int] = (str(host), int(self._port))
        token = new_token()
        self.address = f"http://{HOST}:{self._port}/{token}/"
        self._runs = ServedRuns(sources)
        app = page_app(self._runs, token, self._port, live)
        # Quiet: a page that is open when the server ends is no error.
        config = uvicorn.Config(
            app, log_level="critical", lifespan="off", ws="none", timeout_graceful_shutdown=1
        )
        self._server = _Server(config, live)

    def show(self, *, open_browser: bool, announce: Callable[[str], None]) -> None:
        """Announce the address of the page, open a browser if requested, serve until Ctrl-C."""
        announce(self.address)
        if open_browser:
            webbrowser.open(self.address)
        with suppress(KeyboardInterrupt):
            self.run()

    def run(self) -> None:
        """Serve until Ctrl-C."""
        threading.Thread(target=self._runs.preload, daemon=True, name="fleet2d-preload").start()
        asyncio.run(self._server.serve(sockets=[self._socket]))

    def close(self) -> None:
        """Free the port of a server that was never run."""
        self._socket.close()

    def start(self) -> Callable[[], None]:
        """Serve in a thread; return a function that stops it."""
        thread = threading.Thread(target=self.run, daemon=True, name="fleet2d-view")
        thread.start()

        def stop() -> None:
            self._server.should_exit = True
            thread.join(timeout=5)

        return stop
