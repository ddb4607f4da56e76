"""The server of the page: who may ask, what is served, and the addresses of all pages.

It is bound to this machine unless told otherwise; from others it wants a token. Nothing is loaded from anywhere else,
which the browser is told to enforce.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import uvicorn
from fastapi import FastAPI
from fastapi.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from fastapi.staticfiles import StaticFiles
from nicegui import ui

from expdesign.errors import InputError
from expdesign.web import answers
from expdesign.web.folder import Folder
from expdesign.web.jobs import Jobs
from expdesign.web.pages import data, manoeuvres, plan, sea, trial, whatif
from expdesign.web.site import Site, warmed

LOOPBACK = ("127.0.0.1", "localhost", "::1")
COOKIE = "expdesign_token"
OWN = (
    "default-src 'self' data: blob:; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; connect-src 'self' ws: wss:; frame-ancestors 'self'"
)
"""Content policy of the pages: nothing from outside."""
RESULTS = (
    "sandbox allow-scripts allow-popups allow-downloads; default-src data: 'unsafe-inline'; frame-ancestors 'self'"
)
"""Content policy of files of the folder: they are shown, and reach nothing."""
Message = MutableMapping[str, Any]


class Gate:
    """Lets in who asks by the server's own name, from its own pages, and with the token if there is one."""

    def __init__(self, app: Callable[..., Awaitable[None]], *, hosts: tuple[str, ...], token: str | None) -> None:
        """`hosts` empty: any name."""
        self._app, self._hosts, self._token = app, hosts, token

    async def __call__(self, scope: Message, receive: Callable[..., Any], send: Callable[..., Any]) -> None:
        """An ASGI application."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode().lower(): value.decode("latin-1") for name, value in scope["headers"]}
        asked = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        if not self._allowed(headers, asked):
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": 1008})
            else:
                await PlainTextResponse("not allowed: use the address that expdesign web printed\n", 403)(
                    scope, receive, send
                )
            return

        async def policed(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = [name for name, _ in message["headers"]]
                rules = [(b"x-content-type-options", b"nosniff"), (b"referrer-policy", b"no-referrer")]
                rules += [(b"content-security-policy", OWN.encode())] if b"content-security-policy" not in own else []
                if self._token and asked:
                    rules += [(b"set-cookie", f"{COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/".encode())]
                message["headers"] = [*message["headers"], *rules]
            await send(message)

        await self._app(scope, receive, policed)

    def _allowed(self, headers: dict[str, str], asked: str) -> bool:
        host = headers.get("host", "")
        if self._hosts and urlsplit(f"//{host}").hostname not in self._hosts:
            return False
        origin = headers.get("origin", "")
        if origin and urlsplit(origin).netloc != host:
            return False
        if self._token is None:
            return True
        try:
            kept = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            kept = None
        return any(secrets.compare_digest(self._token, given) for given in (asked, kept.value if kept else ""))


def serve(
    folder: Path, *, host: str, port: int, token: str | None, ready: Callable[[str], None] = lambda address: None
) -> None:
    """Serve the pages of a folder until interrupted.

    Args:
        folder: which exists.
        host: address to be bound to.
        port: free port; 0 for any.
        token: that strangers must give; None where only this machine can ask.
        ready: is called with the address once the page can be opened.

    Raises:
        InputError: the port is taken, or the address is none of this machine.
    """
    with _bound(host, port) as bound:
        port = bound.getsockname()[1]
        where = f"[{host}]" if ":" in host else host
        address = f"http://{where}:{port}/" + (f"?token={token}" if token else "")
        app, site = _application(folder, hosts=LOOPBACK if token is None else (), token=token)
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=2))

        async def run() -> None:
            serving = asyncio.create_task(server.serve(sockets=[bound]))
            while not server.started and not serving.done():
                await asyncio.sleep(0.02)
            ready(address)
            site.workers.submit(warmed)
            try:
                await serving
            finally:
                await site.jobs.end()

        try:
            asyncio.run(run())
        except KeyboardInterrupt:
            pass
        finally:
            site.workers.shutdown(wait=False, cancel_futures=True)


def _bound(host: str, port: int) -> socket.socket:
    bound = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
    except OSError as error:
        bound.close()
        raise InputError(f"cannot listen at {host} port {port} ({error.strerror}), expected a free --port") from None
    return bound


def _application(folder: Path, *, hosts: tuple[str, ...], token: str | None) -> tuple[Any, Site]:
    site = Site(Folder(folder.resolve()), Jobs(folder.resolve()))
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    app.mount("/static", StaticFiles(directory=Path(__file__).parent / "static"))

    @app.get("/chart")
    def chart(area: str, draught_m: float) -> Response:
        return _checked(lambda: answers.chart_of(str(site.folder.path(area)), draught_m))

    @app.get("/track")
    def track(plan: str) -> Response:
        return _checked(lambda: answers.played(str(site.folder.path(plan))))

    @app.get("/folder/{name:path}")
    def shown(name: str) -> Response:
        try:
            path = site.folder.path(name)
        except InputError as error:
            return PlainTextResponse(f"{error}\n", 403)
        if not path.is_file():
            return PlainTextResponse(f"{name} does not exist\n", 404)
        return FileResponse(path, headers={"Content-Security-Policy": RESULTS, "Cache-Control": "no-store"})

    for page in (trial, sea, manoeuvres, plan, whatif, data):
        page.register(site)
    trial.register_ship(site)
    trial.register_files(site)
    ui.run_with(app, title="expdesign", show_welcome_message=False, tailwind=False, reconnect_timeout=30.0)
    return Gate(app, hosts=hosts, token=token), site


def _checked(answer: Callable[[], answers.Answer]) -> Response:
    try:
        return JSONResponse(answer(), headers={"Cache-Control": "no-store"})
    except InputError as error:
        return JSONResponse(answers.wrong(error), 403)
