"""The server behind a page: started on an interface and the next free port, stopped at the end, and silent."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

from terrain.viewer.picture import ViewerMissing

LOOPBACK = "127.0.0.1"


@contextmanager
def page_server(port: int, host: str = LOOPBACK, label: str | None = None) -> Iterator[Any]:
    """Start a viser server and stop it afterwards.

    Raises
    ------
    ViewerMissing
        viser is not installed or cannot listen there.
    """
    try:
        import viser
    except ImportError as error:
        raise ViewerMissing(f"a page of a run needs viser: pip install 'mbf-flex[sim]' ({error})") from error
    try:
        with redirect_stdout(io.StringIO()):  # viser prints a banner, which is not for those who asked for JSON
            server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    except (OSError, RuntimeError) as error:
        raise ViewerMissing(f"viser cannot start a server on this machine: {error}") from error
    try:
        yield server
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()
