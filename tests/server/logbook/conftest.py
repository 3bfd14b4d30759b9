"""Two people who signed in to one station by their browsers."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime

import httpx
import pytest

from db.query.station.people import add_person
from server.access.role import Role
from server.access.secret import hash_password
from tests.server.conftest import application
from tests.server.station_parts import OpenStation

PASSWORD = "correct horse battery"


@asynccontextmanager
async def browser(station: OpenStation, name: str, role: Role) -> AsyncGenerator[httpx.AsyncClient]:
    """Somebody who signed in with a password."""
    hashed = hash_password(PASSWORD)
    at = datetime.now(UTC)
    await station.foundation.store.write(
        lambda session: add_person(session, name, role, hashed, at)
    )
    app = application()
    app.state.foundation = station.foundation
    base_url = "http://127.0.0.1"
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url=base_url) as client:
        answer = await client.post("/api/session", json={"name": name, "password": PASSWORD})
        assert answer.status_code in (200, 201, 204), answer.text
        session = (await client.get("/api/session")).json()
        client.headers["X-CSRF-Token"] = session["csrf_token"]
        yield client


@pytest.fixture
async def ann(station: OpenStation) -> AsyncIterator[httpx.AsyncClient]:
    async with browser(station, "ann", Role.PILOT) as client:
        yield client


@pytest.fixture
async def ben(station: OpenStation) -> AsyncIterator[httpx.AsyncClient]:
    async with browser(station, "ben", Role.PILOT) as client:
        yield client
