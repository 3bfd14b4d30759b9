from datetime import UTC, datetime, timedelta

import pytest

from autonomy.site import LAKE, TANK
from db.query.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.messages import LogId, RobotId, RobotMode, Sample, StateReport, SystemId

START = datetime(2026, 11, 21, 4, 0, tzinfo=UTC)


def robot_record(name="mini-1", system_id=1, kind="simulated"):
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


def report(second, depth_m=0.5, robot="mini-1", **changes):
    at = START + timedelta(seconds=second)
    values = {
        "robot": RobotId(robot),
        "measured_at": at,
        "received_at": at + timedelta(milliseconds=80),
        "position_ned": (1.0, 0.5, depth_m),
        "position_std_m": 0.02,
        "velocity_ned": (0.03, 0.0, 0.04),
        "roll_rad": 0.0,
        "pitch_rad": -0.4,
        "heading_rad": 1.0,
        "net_buoyancy_kg": 0.01,
        "mass_position_m": 0.002,
        "tail_rad": 0.0,
        "battery_fraction": 0.9,
        "battery_v": 11.1,
        "mode": RobotMode.GLIDING,
        "has_fix": False,
        "energy_used": 1.5,
    }
    return StateReport(**{**values, **changes})


def sample(sequence, value=3.0, robot="mini-1", log=7, variable="blue_light"):
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


@pytest.fixture
def url(tmp_path):
    return f"sqlite:///{tmp_path / 'station.sqlite3'}"


@pytest.fixture
def store(url):
    store = Store.open(url)
    store.change(lambda session: add_robot(session, robot_record())).result(60)
    yield store
    store.close()
