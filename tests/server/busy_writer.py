"""Keeps the only writer of a database in one transaction, as a large import does."""

import asyncio
import threading
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

from sqlalchemy.orm import Session

from db.store import Store


@asynccontextmanager
async def busy_writer(store: Store) -> AsyncGenerator[None]:
    """Let nothing be written while the block lasts."""
    begun, end = threading.Event(), threading.Event()

    def write(_: Session) -> None:
        begun.set()
        assert end.wait(120.0)

    writing = store.change(write)
    try:
        await asyncio.to_thread(begun.wait)
        yield
    finally:
        end.set()
        await asyncio.wrap_future(writing)
