"""Who may speak to the workbench: a page that knows its token, from its own origin, under a name of this machine.

The token is the first part of every path, so that no cookie carries it: another site that posts here does not know it.
The host is compared because a foreign name may be made to point to this machine, and the origin because a page of
another origin must not act even if the address became known to it.
"""

import secrets

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "x-frame-options": "SAMEORIGIN",
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
        "connect-src 'self'; frame-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'self'"
    ),
}
"""Of every answer that does not say otherwise."""


class Guard:
    """An application behind a token; what does not know it, or comes from elsewhere, gets one line and no more.

    Args:
        app: the application; its routes have no token.
        token: what the first part of a path must be.
        port: that requests must name as the one they came to.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._hosts = tuple(f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]"))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return  # no other kind of connection is served
        if refusal := self._refusal(scope):
            refused = PlainTextResponse(f"refused: {refusal}\n", 403, {**HEADERS, "connection": "close"})
            await refused(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await self._app({**scope, "root_path": f"/{self._token}"}, receive, send_with_headers)

    def _refusal(self, scope: Scope) -> str:
        """Return why a request is not answered; empty: it is."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return "the host must be the one in the address that the console shows"
        if any(origin != f"http://{hosts[0]}" for origin in headers.getlist("origin")):
            return "the origin must be the workbench itself"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return "the request must come from the workbench itself"
        parts = scope["path"].split("/")
        if len(parts) < 3 or not secrets.compare_digest(parts[1].encode("utf-8", "replace"), self._token.encode()):
            return "the address must have the token that the console shows"
        return ""
