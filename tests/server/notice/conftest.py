import asyncio
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partialmethod
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from sqlalchemy.orm import Session

from db.query.station.people import add_person
from robot_link.clock import SystemClock
from server.access.role import Role
from server.base.foundation import Foundation
from server.base.settings import Settings
from server.notice import contact, heartbeat
from server.notice.outbox import Notices
from server.notice.sender import Sender
from server.station import Station, run_station
from tests.server.conftest import application
from tests.server.fake_link import World
from tests.server.notice.receiver import Taken
from tests.server.station_app import bearer, token_of

ORIGIN = "http://127.0.0.1:8000"
PATIENCE_S = 200.0
PATIENT = partialmethod(Sender.__init__, patience_s=PATIENCE_S)
TIME_LIMITS = {"cto": "60", "rto": "200"}


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no answer come too late, however busy the machine is: it would be asked for twice."""
    monkeypatch.setattr(Sender, "__init__", PATIENT)
    monkeypatch.setattr(contact, "TIME_LIMITS", TIME_LIMITS)
    monkeypatch.setattr(heartbeat, "PATIENCE_S", 60.0)


@dataclass
class NoticeStation:
    """A station with people, and an admin's client."""

    foundation: Foundation
    client: httpx.AsyncClient

    @property
    def alarms(self) -> Any:
        return self.foundation.alarms

    @property
    def notices(self) -> Notices:
        return self.foundation.services.get(Notices)

    async def person(self, name: str, role: Role = Role.PILOT) -> None:
        def write(session: Session) -> None:
            add_person(session, name, role, None, self.foundation.clock.now())

        await self.foundation.store.write(write)

    async def contact(self, person: str, url: str, title: str = "phone") -> str:
        body = {"title": title, "form": "webhook", "address": url}
        answer = await self.client.post(f"/api/notices/people/{person}/contacts", json=body)
        assert answer.status_code == 201, answer.text
        return answer.json()["id"]

    async def wish(self, person: str, **wishes: Any) -> None:
        answer = await self.client.put(f"/api/notices/people/{person}", json=wishes)
        assert answer.status_code == 200, answer.text

    async def set_up(self, **settings: Any) -> None:
        answer = await self.client.put("/api/notices/station", json=settings)
        assert answer.status_code == 200, answer.text

    async def told_states(self, states: list[str]) -> bool:
        return [one["state"] for one in await self.told()] == states

    async def told(self) -> list[dict[str, Any]]:
        answer = await self.client.get("/api/notices")
        return answer.json()["notices"]


@asynccontextmanager
async def notice_station(
    tmp_path: Path, world: World, **settings: Any
) -> AsyncGenerator[NoticeStation]:
    given = {"data_dir": tmp_path, "simulation": True, "worker_processes": 1, **settings}
    given.setdefault("public_origins", (ORIGIN,))
    async with run_station(
        Settings.model_validate(given), lambda foundation: Station(foundation, world.make_link)
    ) as running:
        app = application()
        app.state.foundation = running.foundation
        token = await token_of(app, Role.ADMIN)
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url=ORIGIN, headers=bearer(token)
        ) as client:
            yield NoticeStation(running.foundation, client)


@pytest_asyncio.fixture
async def here(tmp_path: Path, world: World) -> AsyncIterator[NoticeStation]:
    async with notice_station(tmp_path, world) as station:
        await station.person("ann")
        await station.person("ben")
        yield station


@pytest.fixture
def moving(monkeypatch: pytest.MonkeyPatch) -> list[timedelta]:
    """Let a test move every station's clock forward."""
    ahead = [timedelta()]
    now = SystemClock().now

    class Moved:
        speed = 1.0

        def now(self) -> datetime:
            return now() + ahead[0]

    def moved(_: object) -> Moved:
        return Moved()

    monkeypatch.setattr("server.base.foundation.read_clock", moved)
    return ahead


def words(taken: Taken) -> str:
    return taken.json["message"]


async def move(here: NoticeStation, moving: list[timedelta], minutes: float) -> None:
    """Let time pass once the past is dealt with, and wait until what is due now is, too."""
    await settled(here)
    moving[0] += timedelta(minutes=minutes)
    await settled(here)


async def settled(here: NoticeStation) -> None:
    """Wait until all that the station knows has gone through one whole round of its notices."""
    wakeups = here.notices._wakeups  # pyright: ignore[reportPrivateUsage]
    seen = wakeups.next
    begun = asyncio.Semaphore(0)

    async def watch() -> list[str]:
        begun.release()
        return await seen()

    wakeups.next = watch
    async with asyncio.timeout(120.0):
        for _ in range(2):  # the first ends a round that may have begun before
            wakeups.wake()
            await begun.acquire()
    wakeups.next = seen
