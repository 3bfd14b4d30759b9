import asyncio
import shutil
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Coroutine, Iterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from functools import cache, partialmethod
from pathlib import Path
from typing import TypeVar, overload

import httpx
import pytest
import pytest_asyncio
import uvicorn
from fastapi import FastAPI
from sqlalchemy.orm import Session

from autonomy.site import LAKE, TANK, Site
from db.query.fleet.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import RobotId, SystemId
from server.access.register import IssuedToken, create_token
from server.access.role import Role
from server.app import create_app
from server.base.foundation import Foundation
from server.base.settings import Settings
from server.base.worker import WorkerPool
from server.command import commands
from server.plan import install as plan
from server.plan.dry_run import DryRuns
from server.station import Station, run_station
from tests.server.fake_link import World, current_report, state_report
from tests.server.fake_worker import FakeWorkers
from tests.server.in_thread import run_in_thread
from tests.server.station_app import AT_WILL
from tests.server.station_parts import OpenStation

T = TypeVar("T")
MINI = RobotId("mini-1")
GRACE = RobotId("grace-1")
DATABASE = "station.sqlite3"
FAST = {
    "planning_time_s": 30.0,
    "total_budget": 24.0,
    "round_budget": 12.0,
    "search": {"iterations_max": 100},
    "mission": {"draft_distance_m": 1.0},
}
"""A survey of two short rounds; the search ends by its iterations on a machine of any speed."""


@overload
async def until(
    condition: Callable[[], Coroutine[object, object, T | None]], timeout_s: float = 120.0
) -> T: ...


@overload
async def until(condition: Callable[[], T | None], timeout_s: float = 120.0) -> T: ...


async def until(condition: Callable[[], object], timeout_s: float = 120.0) -> object:
    """Wait for something to become true; a coroutine function is awaited each time."""
    async with asyncio.timeout(timeout_s):
        while True:
            found = condition()
            if asyncio.iscoroutine(found):
                found = await found
            if found:
                return found
            await asyncio.sleep(0.02)


def robot_record(robot: RobotId, system_id: int, model: str, site: Site) -> RobotRecord:
    return RobotRecord(
        id=robot,
        name=robot,
        model=model,
        kind="simulated",
        system_id=SystemId(system_id),
        links=("xbee://127.0.0.1:9",),
        site=site,
        created_at=datetime.now(UTC) - timedelta(hours=1),
    )


class StationClient(httpx.AsyncClient):
    """Speaks REST to a station in this process; knows the application and its own secret."""

    def __init__(self, app: FastAPI, secret: str) -> None:
        super().__init__(
            transport=httpx.ASGITransport(app),
            base_url="http://127.0.0.1",
            headers={"Authorization": f"Bearer {secret}"},
        )
        self.app, self.secret = app, secret


@asynccontextmanager
async def open_station(
    tmp_path: Path, world: World, **more: object
) -> AsyncGenerator[OpenStation, None]:
    """Run a station with two robots on a data folder; closing it is an orderly stop."""
    told = {"data_dir": tmp_path, "simulation": True, "worker_processes": 1, **AT_WILL, **more}
    settings = Settings.model_validate(told)
    async with run_station(
        settings, lambda foundation: Station(foundation, world.make_link)
    ) as running:
        yield OpenStation(running.foundation)


def _add_fleet(session: Session) -> None:
    add_robot(session, robot_record(MINI, 1, "miniglider", TANK))
    add_robot(session, robot_record(GRACE, 2, "grace3", LAKE))


@pytest.fixture(scope="session")
def prepared_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database that knows two robots, made once: laying out the tables takes its time."""
    folder = tmp_path_factory.mktemp("prepared")
    store = Store.open(Settings(data_dir=folder).resolved_database_url)
    store.change(_add_fleet).result()
    store.close()
    return folder / DATABASE


@pytest.fixture(scope="module")
def memory(prepared_database: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    """The station's memory alone, shared by the tests of a module."""
    path = shutil.copy(prepared_database, tmp_path_factory.mktemp("memory"))
    store = Store.open(f"sqlite:///{path}")
    yield store
    store.close()


@pytest.fixture(autouse=True)
def _known_fleet(prepared_database: Path, tmp_path: Path) -> None:
    shutil.copy(prepared_database, tmp_path / DATABASE)


@pytest.fixture(autouse=True)
def _cold_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few tests plan; the others need not pay for the planner's machine code."""

    async def stay_cold(*_: object) -> None:
        pass

    monkeypatch.setattr(plan, "warm_up", stay_cold)


@pytest.fixture(autouse=True)
def _written_orders(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an order to surface be written down before it leaves, however slow the disk is."""
    monkeypatch.setattr(commands, "_WRITE_PATIENCE_S", 30.0)


@pytest.fixture(autouse=True)
def _unrehearsed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few tests are about rehearsals; the others need not wait for the simulated robot."""

    def nothing(*_: object) -> None:
        return None

    monkeypatch.setattr(DryRuns, "before", nothing)


@pytest.fixture
def in_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let tasks run here: a process of its own takes a second to load its compiled code."""
    monkeypatch.setattr(WorkerPool, "run", run_in_thread)


@pytest_asyncio.fixture
async def workers(monkeypatch: pytest.MonkeyPatch) -> FakeWorkers:
    """Let plans be made at once, by nobody; everything else goes to worker processes."""
    fake = FakeWorkers()
    monkeypatch.setattr(WorkerPool, "run", partialmethod(FakeWorkers.run_for, fake))
    return fake


@pytest_asyncio.fixture
async def world() -> AsyncIterator[World]:
    world = World()
    yield world
    await world.close()


@pytest_asyncio.fixture
async def station(tmp_path: Path, world: World) -> AsyncIterator[OpenStation]:
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        yield station


@pytest.fixture
def foundation(station: OpenStation) -> Foundation:
    return station.foundation


@pytest.fixture
def still(station: OpenStation, monkeypatch: pytest.MonkeyPatch) -> datetime:
    """Let the station's clock stand, so that what is new stays new on a busy machine."""
    now = datetime.now(UTC)

    def stand(_: Clock) -> datetime:
        return now

    monkeypatch.setattr(type(station.foundation.clock), "now", stand)
    return now


@pytest_asyncio.fixture
async def client(station: OpenStation) -> AsyncIterator[StationClient]:
    """Speaks REST to the station as a pilot."""
    async with api_client(station, Role.ADMIN) as client:
        yield client


@cache
def application() -> FastAPI:
    """The routes, built once: all that they know of a station is in ``app.state``."""
    return create_app(Settings(simulation=True))


@asynccontextmanager
async def api_client(station: OpenStation, role: Role) -> AsyncGenerator[StationClient, None]:
    foundation = station.foundation
    app = application()
    app.state.foundation = foundation

    def write(session: Session) -> IssuedToken:
        hour = timedelta(hours=1)
        return create_token(session, f"test {role}", role, hour, at=datetime.now(UTC), by="test")

    issued = await foundation.store.write(write)
    async with StationClient(app, issued.secret) as client:
        yield client


@pytest_asyncio.fixture
async def address(client: StationClient) -> AsyncIterator[str]:
    """Serve the station's application over loopback."""
    config = uvicorn.Config(
        client.app,
        host="127.0.0.1",
        port=0,
        lifespan="off",
        log_level="error",
        ws_per_message_deflate=False,
    )
    server = uvicorn.Server(config)
    serving = asyncio.create_task(server.serve())
    await until(lambda: server.started)
    port = server.servers[0].sockets[0].getsockname()[1]
    yield f"127.0.0.1:{port}"
    server.should_exit = True
    await serving
