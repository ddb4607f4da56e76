"""The command that opens the page."""

from __future__ import annotations

import importlib.util
import secrets
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from expdesign.errors import InputError

NEEDED = ("nicegui", "tomlkit")
"""Packages of the extra `web`."""


def web(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Scenarios and results; nothing else is touched.")
    ] = Path(),
    port: Annotated[
        int, typer.Option("--port", metavar="N", min=0, max=65535, help="Of the address; 0 for any.")
    ] = 8120,
    host: Annotated[
        str,
        typer.Option(
            "--host", metavar="ADDRESS", help="Address to be bound to. Other than this machine needs a token."
        ),
    ] = "127.0.0.1",
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
) -> None:
    """Open a page on a folder of scenarios: draw the area, choose manoeuvres, plan, play, import and diagnose.

    The page runs the commands of this program and shows each of them; files stay the truth. It can be opened on this
    machine only, unless --host says otherwise; then the address that is printed holds a token. Ctrl-C ends it.

    Example: expdesign web mytrial
    """
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"the page needs {' and '.join(missing)}: pip install 'expdesign[web]'")
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder, expected one with scenarios, or an empty one")
    from expdesign.web.server import LOOPBACK, serve

    token = None if host in LOOPBACK else secrets.token_urlsafe(24)

    def ready(address: str) -> None:
        typer.echo(f"Open {address} in a browser. Ctrl-C ends it.")
        if not no_browser:
            webbrowser.open(address)

    serve(folder, host=host, port=port, token=token, ready=ready)
