"""Access control of the server: only the page that was opened with the token is served."""

import secrets
from collections.abc import Mapping
from http import HTTPStatus

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HOSTS = ("127.0.0.1", "localhost", "[::1]")
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data: blob:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
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


class Guard:
    """Refuses requests of other web pages, for other host names, and without the token.

    Another web page can make a browser send requests here, but it doesn't know the token, and the
    browser adds the origin of the request (`Origin`, `Sec-Fetch-Site`). A foreign name that points
    at this machine is visible in `Host`.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        """Guard an application.

        Args:
            app: The application that serves allowed requests.
            token: The first part of every allowed path.
            port: The port of the server.
        """
        self._app, self._token = app, token
        self._hosts = {f"{host}:{port}" for host in HOSTS}
        self._origins = {f"http://{host}" for host in self._hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        reason = self._refusal(scope)
        if reason:
            response = JSONResponse({"message": reason}, HTTPStatus.FORBIDDEN)
            await response(scope, receive, _with_headers(send))
            return
        await self._app(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> str:
        """Return why a request is refused; empty if it is allowed."""
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self._hosts:
            return "this server answers under 127.0.0.1 and localhost only"
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


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers[name] = value
        await send(message)

    return send_with_headers
