"""A station whose database does not answer yet waits for it, and says so to whoever asks.

Without its settings it can open no link; robots keep what it has not acknowledged.
"""

import asyncio
import html
import logging
import socket
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

import uvicorn
from sqlalchemy.exc import DBAPIError
from starlette.responses import HTMLResponse
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocketClose

from db.engine import check_url, is_sqlite, is_storage_fault, opening_sentence, write_engine
from server.base.problem import problem_response

log = logging.getLogger(__name__)
TRY_PERIOD_S: Final = 2.0
_TRY_AGAIN_LATER: Final = 1013
"""Code of a WebSocket that is closed because the server cannot serve it now."""
_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>The station waits</title>
<meta http-equiv="refresh" content="5"></head>
<body><h1>The station waits for its database</h1><p>{}</p></body></html>
"""


class WaitingPage:
    """The application of a station that waits: one sentence, whatever is asked for."""

    def __init__(self) -> None:
        self.since = datetime.now(UTC)

    @property
    def sentence(self) -> str:
        """What is told; why, the station's own console says."""
        return (
            f"The database does not answer since {self.since:%Y-%m-%d %H:%M:%S} UTC. The station "
            f"tries again every {TRY_PERIOD_S:g} s and begins to work when it does. Robots keep "
            "their samples meanwhile."
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer 503."""
        headers = {"Retry-After": "5", "Cache-Control": "no-store"}
        if scope["type"] == "websocket":
            await WebSocketClose(_TRY_AGAIN_LATER)(scope, receive, send)
        elif scope["path"].startswith("/api"):
            await problem_response(503, self.sentence, headers=headers)(scope, receive, send)
        else:
            page = HTMLResponse(_PAGE.format(html.escape(self.sentence)), 503, headers)
            await page(scope, receive, send)


async def wait_for_database(
    url: str, server: uvicorn.Server, listener: socket.socket, on_try: Callable[[], None]
) -> bool:
    """Return once the database answers; tell whether it does, and nobody stopped the server.

    Args:
        url: SQLAlchemy URL. A SQLite file is not waited for: no server brings it back.
        server: Answers meanwhile, with a ``WaitingPage``.
        listener: Where; it is left open.
        on_try: Called before each try but the first.

    Raises:
        DatabaseUrlError: If the URL names no database of a station.
    """
    check_url(url)
    if (fault := await asyncio.to_thread(_fault, url)) is None:
        return True
    listener.listen()
    serving = asyncio.create_task(server.serve(sockets=[listener.dup()]), name="waiting page")
    told = ""
    try:
        while fault is not None and not serving.done():
            if fault != told:
                log.warning("The station waits: %s", fault)
                told = fault
            on_try()
            await asyncio.wait([serving], timeout=TRY_PERIOD_S)
            fault = await asyncio.to_thread(_fault, url)
        return fault is None and not serving.done()
    finally:
        server.should_exit = True
        await serving


def _fault(url: str) -> str | None:
    """Say what is wrong with the server of a database, ``None`` if it answers."""
    engine = write_engine(url)
    try:
        if not is_sqlite(engine):
            with engine.connect():
                pass
    except DBAPIError as error:
        if not is_storage_fault(error):
            raise
        return opening_sentence(error)
    else:
        return None
    finally:
        engine.dispose()
