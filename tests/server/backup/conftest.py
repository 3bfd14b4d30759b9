"""A station that does nothing but back itself up, at a wall clock that tests move."""

import os
import sqlite3
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager, closing
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest
import pytest_asyncio

from server.app import create_app
from server.backup.backups import Backups
from server.backup.install import install
from server.base.foundation import Foundation
from server.base.settings import Settings
from tests.server.station_app import NoService, signed_in


@pytest.fixture(autouse=True)
def _known_fleet():
    """Begin with an empty database."""


class Wall:
    """A wall clock."""

    def __init__(self) -> None:
        self.at = datetime(2026, 3, 1, 12, tzinfo=UTC)

    def __call__(self) -> datetime:
        return self.at


@dataclass
class BackedUp:
    """A station in this process."""

    foundation: Foundation
    backups: Backups
    client: httpx.AsyncClient
    wall: Wall
    data: Path
    folder: Path
    """Where its backups go."""

    async def change(self, **settings: object) -> httpx.Response:
        return await self.client.put("/api/backups/settings", json=settings)

    async def set_up(self, **settings: object) -> None:
        answer = await self.change(folder=str(self.folder), **settings)
        assert answer.status_code == 200, answer.text

    async def view(self) -> dict[str, object]:
        return (await self.client.get("/api/backups")).json()

    async def back_up(self) -> str:
        answer = await self.client.post("/api/backups")
        assert answer.status_code == 202, answer.text
        return answer.json()["id"]

    async def job(self, job: str) -> dict[str, object]:
        return (await self.client.get(f"/api/jobs/{job}")).json()

    def pass_by(self, **time: float) -> None:
        """Let time pass by the wall, and have the station notice."""
        self.wall.at += timedelta(**time)
        self.backups.look()

    def files(self) -> list[str]:
        return sorted(path.name for path in self.folder.iterdir())

    def alarms(self, cause: str) -> list[str]:
        return [
            alarm.text
            for alarm in self.foundation.alarms.open
            if alarm.cause == cause and alarm.cleared_at is None
        ]


@asynccontextmanager
async def backed_up(data: Path, folder: Path, wall: Wall) -> AsyncGenerator[BackedUp]:
    class Service(NoService):
        def __init__(self, foundation: Foundation) -> None:
            super().__init__(foundation)
            install(foundation, wall)

        async def start(self) -> None:
            await self.foundation.lifetime.start()

        async def stop(self) -> None:
            await self.foundation.lifetime.stop()

    app = create_app(Settings(data_dir=data), Service)
    async with app.router.lifespan_context(app), signed_in(app) as client:
        foundation: Foundation = app.state.foundation
        yield BackedUp(foundation, foundation.services.get(Backups), client, wall, data, folder)


@pytest_asyncio.fixture
async def apart(tmp_path: Path) -> AsyncGenerator[BackedUp]:
    """A station whose backups are made by processes of their own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    async with backed_up(tmp_path / "data", folder, Wall()) as station:
        yield station


@pytest.fixture
def here(in_threads: None, apart: BackedUp) -> BackedUp:
    """A station whose backups are made in threads, for what processes do not matter to."""
    del in_threads
    return apart


def fatten(database: Path, megabytes: int = 60) -> None:
    """Let a database be large enough that a backup of it takes its time."""
    with closing(sqlite3.connect(database)) as base, base:
        base.execute("CREATE TABLE ballast (content BLOB)")
        for _ in range(megabytes):
            base.execute("INSERT INTO ballast VALUES (?)", (os.urandom(1 << 20),))
