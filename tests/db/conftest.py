import shutil
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.orm import Session

from autonomy.site import LAKE, TANK
from db.query.fleet.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.messages import LogId, RobotId, RobotMode, Sample, StateReport, SystemId
from tests.postgresql_server import PostgresqlServer, postgresql_server

ON_SQLITE = pytest.mark.parametrize("url", ["sqlite"], indirect=True)
ON_POSTGRESQL = pytest.mark.parametrize("url", ["postgresql"], indirect=True)
"""For what only one of the engines has."""
START = datetime(2026, 11, 21, 4, 0, tzinfo=UTC)


def robot_record(
    name: str = "mini-1", system_id: int | None = 1, kind: str = "simulated"
) -> RobotRecord:
    return RobotRecord(
        id=RobotId(name),
        name=name,
        model="miniglider",
        kind=kind,
        system_id=None if system_id is None else SystemId(system_id),
        links=("xbee:///dev/ttyUSB0",),
        site=TANK if system_id == 1 else LAKE,
        created_at=START,
    )


def add_robot_as_of_old(session: Session) -> None:
    """Add a robot and its deployment as the first version of the schema kept them."""
    robot = robot_record()
    at = int(robot.created_at.timestamp() * 1e6)
    session.execute(
        text(
            "INSERT INTO robot (key, id, name, model, kind, system_id, links, site, created_at)"
            " VALUES (1, :id, :id, 'miniglider', 'simulated', 1, '[]', :site, :at)"
        ),
        {"id": robot.id, "site": robot.site.model_dump_json(), "at": at},
    )
    session.execute(
        text(
            "INSERT INTO deployment (key, robot_key, kind, title, started_at, rows, variables,"
            " document) VALUES (1, 1, 'live', 'mini-1', :at, 0, '[]', '{}')"
        ),
        {"at": at},
    )


def add_reports_as_of_old(session: Session, *reports: StateReport) -> None:
    """Add what the first robot said as the first version of the schema kept it."""
    for one in reports:
        at = int(one.measured_at.timestamp() * 1e6)
        north_m, east_m, depth_m = one.position_ned
        session.execute(
            text(
                "INSERT INTO state_report (robot_key, measured_at, received_at, north_m, east_m,"
                " depth_m, position_std_m, has_fix, mode) VALUES"
                " (1, :at, :at, :north_m, :east_m, :depth_m, :std_m, :has_fix, :mode)"
            ),
            {
                "at": at,
                "north_m": north_m,
                "east_m": east_m,
                "depth_m": depth_m,
                "std_m": one.position_std_m,
                "has_fix": one.has_fix,
                "mode": int(one.mode),
            },
        )


def report(
    second: float, depth_m: float = 0.5, robot: str = "mini-1", **changes: object
) -> StateReport:
    at = START + timedelta(seconds=second)
    value = StateReport(
        robot=RobotId(robot),
        measured_at=at,
        received_at=at + timedelta(milliseconds=80),
        position_ned=(1.0, 0.5, depth_m),
        position_std_m=0.02,
        velocity_ned=(0.03, 0.0, 0.04),
        roll_rad=0.0,
        pitch_rad=-0.4,
        heading_rad=1.0,
        net_buoyancy_kg=0.01,
        mass_position_m=0.002,
        tail_rad=0.0,
        battery_fraction=0.9,
        battery_v=11.1,
        mode=RobotMode.GLIDING,
        has_fix=False,
        energy_used=1.5,
    )
    return replace(value, **changes)


def sample(
    sequence: int,
    value: float = 3.0,
    robot: str = "mini-1",
    log: int = 7,
    variable: str = "blue_light",
) -> Sample:
    at = START + timedelta(seconds=sequence)
    return Sample(
        robot=RobotId(robot),
        log=LogId(log),
        sequence=sequence,
        variable=variable,
        value=value,
        position_ned=(1.0, 0.5, 0.2),
        position_std_m=0.03,
        measured_at=at,
        received_at=at,
    )


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgresqlServer]:
    """A server that runs for all tests of a process."""
    with postgresql_server() as server:
        if server is None:
            pytest.skip("this machine has no PostgreSQL server (apt-get install postgresql)")
        yield server


@pytest.fixture
def sqlite_url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'station.sqlite3'}"


@pytest.fixture
def postgresql_url(postgresql: PostgresqlServer, request: pytest.FixtureRequest) -> Iterator[str]:
    template = "template0"
    if "store" in request.fixturenames:
        template = request.getfixturevalue("prepared_postgresql")
    name = postgresql.database(template)
    yield postgresql.url(name)
    postgresql.drop(name)


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest) -> str:
    """The URL of a database of each engine in turn; empty, or as ``store`` wants it."""
    return request.getfixturevalue(f"{request.param}_url")


def _with_robot(session: Session) -> None:
    add_robot(session, robot_record())


@pytest.fixture(scope="session")
def prepared_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database that knows a robot, made once: laying out the tables takes its time."""
    file = tmp_path_factory.mktemp("prepared") / "station.sqlite3"
    _prepare(f"sqlite:///{file}")
    return file


@pytest.fixture(scope="session")
def prepared_postgresql(postgresql: PostgresqlServer) -> str:
    """The name of such a database of PostgreSQL."""
    name = postgresql.database()
    _prepare(postgresql.url(name))
    return name


def _prepare(url: str) -> None:
    store = Store.open(url)
    store.change(_with_robot).result(60)
    store.close()


@pytest.fixture
def store(url: str, request: pytest.FixtureRequest) -> Iterator[Store]:
    if url.startswith("sqlite"):
        prepared = request.getfixturevalue("prepared_database")
        shutil.copy(prepared, url.removeprefix("sqlite:///"))
    store = Store.open(url)
    yield store
    store.close()
