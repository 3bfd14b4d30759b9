"""People with browsers, and scripts with tokens, at a station in this process."""

from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from datetime import UTC, datetime, timedelta
from typing import Any

import httpx
import pytest
import pytest_asyncio
from sqlalchemy.orm import Session

from db.query.station.grants import GrantRecord, Holder, set_grants
from db.query.station.people import add_person, add_session, find_person
from robot_link.clock import Clock
from server.access import presence as presence_module
from server.access.role import Role
from server.access.secret import new_secret, secret_hash
from tests.server.conftest import MINI, application
from tests.server.station_app import bearer, token_of
from tests.server.station_parts import OpenStation

Open = Callable[..., Awaitable[httpx.AsyncClient]]


@asynccontextmanager
async def person_at(
    station: OpenStation, name: str, role: Role = Role.PILOT
) -> AsyncGenerator[httpx.AsyncClient]:
    """A browser in which somebody is signed in, without the slow password."""
    app = application()
    app.state.foundation = station.foundation
    secret, csrf = new_secret(), new_secret()

    def write(session: Session) -> None:
        now = datetime.now(UTC)
        person = find_person(session, name) or add_person(session, name, role, None, now)
        digest, end = secret_hash(secret), now + timedelta(hours=8)
        holder = Holder(person=person.key)
        add_session(session, holder, secret_hash=digest, csrf_token=csrf, at=now, expires_at=end)

    await station.foundation.store.write(write)
    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(app),
        base_url="http://127.0.0.1",
        headers={"X-CSRF-Token": csrf},
        cookies={"grace_session_default": secret},
    ) as client:
        yield client


@asynccontextmanager
async def script_at(
    station: OpenStation, name: str, role: Role = Role.PILOT
) -> AsyncGenerator[httpx.AsyncClient]:
    """A program with a bearer token."""
    app = application()
    app.state.foundation = station.foundation
    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(app),
        base_url="http://127.0.0.1",
        headers=bearer(await token_of(app, role, name)),
    ) as client:
        yield client


async def let_pilot(station: OpenStation, name: str, *robots: str) -> None:
    """Let somebody pilot these robots, and no others by a grant."""

    def give(session: Session) -> None:
        person = find_person(session, name)
        assert person is not None
        holder = Holder(person=person.key)
        set_grants(session, holder, [GrantRecord(Role.PILOT, robot=robot) for robot in robots])

    await station.foundation.store.write(give)


@pytest_asyncio.fixture
async def person(station: OpenStation) -> AsyncGenerator[Open]:
    """Sign somebody in: ``await person("ann")``."""
    async with AsyncExitStack() as stack:

        async def sign_in(name: str, role: Role = Role.PILOT) -> httpx.AsyncClient:
            return await stack.enter_async_context(person_at(station, name, role))

        yield sign_in


@pytest_asyncio.fixture
async def script(station: OpenStation) -> AsyncGenerator[Open]:
    """Let a script begin: ``await script("planner")``."""
    async with AsyncExitStack() as stack:

        async def begin(name: str, role: Role = Role.PILOT) -> httpx.AsyncClient:
            return await stack.enter_async_context(script_at(station, name, role))

        yield begin


class Hours:
    """The hours of the station's wall, which a test lets pass."""

    def __init__(self) -> None:
        self.passed_s = 0.0


@pytest.fixture
def hours(station: OpenStation, monkeypatch: pytest.MonkeyPatch) -> Hours:
    """Let hours pass for who is silent and what is asked, while the machine waits for nothing.

    For who is silent no other time passes, however slow the machine is.
    """
    hours, begun_s = Hours(), presence_module.monotonic_s()
    clock = type(station.foundation.clock)
    now = clock.now
    monkeypatch.setattr(presence_module, "monotonic_s", lambda: begun_s + hours.passed_s)

    def later(self: Clock) -> datetime:
        return now(self) + timedelta(seconds=hours.passed_s)

    monkeypatch.setattr(clock, "now", later)
    return hours


async def act(client: httpx.AsyncClient, do: str, robot: str = MINI, **more: str) -> httpx.Response:
    """Do something with a lease."""
    return await client.post(f"/api/robots/{robot}/lease", json={"act": do, **more})


async def lease_of(client: httpx.AsyncClient, robot: str = MINI) -> dict[str, Any]:
    """What is said of who is in charge."""
    return (await client.get(f"/api/robots/{robot}/lease")).json()
