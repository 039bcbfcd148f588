"""Who may talk to the studio: pages that it served itself, under a name of its own, in small portions."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Collection
from ipaddress import ip_address
from socket import gethostname
from urllib.parse import urlsplit

from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse

MOST_BYTES = 2_000_000  # of a request: ten goal pictures and some text
SCHEMES = ("http", "https")  # the second if something before the studio speaks it
POLICY = "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'"


def guard(app: FastAPI, hosts: Collection[str], everywhere: bool = False) -> None:
    """Refuse requests for other hosts (DNS rebinding), from other pages, and large ones.

    Args:
        app: to be guarded.
        hosts: names that this server is called by, without port.
        everywhere: whether it may be called by any address, too, and by the machine's name: a page that turns
            a name of its own into this address comes with that name.
    """
    names = {name.lower() for name in hosts}

    @app.middleware("http")
    async def check(request: Request, go_on: Callable[[Request], Awaitable[Response]]) -> Response:
        host = _name(request.headers.get("host", ""))
        if host not in names and not (everywhere and (_is_address(host) or host == gethostname().lower())):
            return _refused(421, f"this server is not called {host!r}")
        own = {f"{scheme}://{request.headers['host']}" for scheme in SCHEMES}
        if request.headers.get("origin") not in {None, *own}:
            return _refused(403, "only pages of this server may ask for this")
        if request.method == "POST":
            size = request.headers.get("content-length", "")
            if not size.isdigit() or int(size) > MOST_BYTES:
                return _refused(413, f"a request has at most {MOST_BYTES:,} bytes, and says how many")
        response = await go_on(request)
        response.headers.setdefault("Content-Security-Policy", POLICY)
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        return response


def _name(host: str) -> str:
    """The name in a Host header, without the port; nothing if it is more than name and port."""
    try:
        parts = urlsplit(f"//{host}")
        return (parts.hostname or "") if parts.netloc == host and "@" not in host else ""
    except ValueError:
        return ""


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True


def _refused(status: int, why: str) -> JSONResponse:
    return JSONResponse({"error": why}, status)
