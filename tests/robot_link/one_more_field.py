# ruff: noqa: E402, T201 - the row must stand before whoever reads it is imported; words go to a pipe
"""Run by ``test_report_field``: the station and the robot with one channel more, by one row.

The row is put into a state report before anything else is imported, as if it stood there; the
argument is the dialect that has a field for it.
"""

import importlib.util
import io
import sys
import tempfile
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated

sys.path.insert(0, str(Path(__file__).parents[2]))

from robot_link import messages
from robot_link.report_field import Catalogue, Gauge, Octets, Possible, Recorded, ReportField, Wire

KEY = "hull_temperature_k"


@dataclass(frozen=True, slots=True, kw_only=True)
class StateReport(messages.StateReport):
    """A state with one number more."""

    hull_temperature_k: Annotated[
        float,
        ReportField(
            unit="K",
            wire=Wire("hull_temperature", 1e2),
            octets=Octets(15, 2, 1e2, signed=False),
            gauge=Gauge(12, "Hull", "Temperature of the hull.", 1, 60.0),
            possible=Possible(200.0, 400.0, "a hull at {:.0f} K"),
            recorded=Recorded(250.0, 350.0),
        ),
    ]


messages.StateReport = StateReport
messages.STATE = Catalogue(StateReport)
spec = importlib.util.spec_from_file_location("robot_link.mavlink.dialect.grace", sys.argv[1])
dialect = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = dialect
spec.loader.exec_module(dialect)
importlib.import_module("robot_link.mavlink.dialect").grace = dialect

from sqlalchemy import create_engine
from sqlalchemy.orm import Session

from autonomy.channel import CHANNELS
from autonomy.site import TANK
from db.ingest import append_telemetry
from db.query.fleet.robots import add_robot
from db.query.measured.telemetry import history, newest_state
from db.tables import Base
from onboard.log import FileLog
from robot_link.mavlink import telemetry
from robot_link.satellite.state_code import STATE_BYTES, packed_state, unpacked_state
from server.fleet.plausibility import fault_of_state
from server.recording.table import Policy, read_recording
from tests.db.conftest import robot_record

NOW = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)
NUMBERS = {"north_m": 1.0, "east_m": 0.5, "depth_m": 0.25, KEY: 281.5}
REPORT = StateReport(
    robot=messages.RobotId("mini-1"),
    measured_at=NOW,
    received_at=NOW,
    mode=messages.RobotMode.GLIDING,
    has_fix=False,
    **messages.STATE.fields(tuple(NUMBERS.get(key, 0.125) for key in messages.STATE.keys)),
)


def by_mavlink() -> None:
    sent = telemetry.state_message(REPORT)
    sent.pack(dialect.MAVLink(None))
    frame = bytes(sent.get_msgbuf())
    (message,) = dialect.MAVLink(None).parse_buffer(frame)
    assert telemetry.state_report(message, "mini-1", NOW).hull_temperature_k == 281.5


def by_satellite() -> None:
    data = packed_state(REPORT)
    assert len(data) == STATE_BYTES == 35
    assert unpacked_state(data, "mini-1", NOW, 0.0).hull_temperature_k == 281.5


def to_the_log() -> None:
    with tempfile.TemporaryDirectory() as folder:
        log = FileLog(Path(folder), NOW)
        log.track(REPORT)
        log.close()
        header, line = next(Path(folder).glob("track-*")).read_text().splitlines()
    assert dict(zip(header.split(","), line.split(","), strict=True))[KEY] == "281.5"


def to_the_database() -> None:
    engine = create_engine("sqlite://")
    Base.metadata.create_all(engine)
    with Session(engine) as session:
        add_robot(session, replace(robot_record(), site=TANK))
        append_telemetry(session, [REPORT])
        assert newest_state(session, "mini-1").hull_temperature_k == 281.5
        assert history(session, "mini-1", KEY).value == [281.5]


def through_the_check() -> None:
    assert fault_of_state(REPORT, TANK, NOW, 1.0) is None
    hot = replace(REPORT, **{KEY: 500.0})
    assert fault_of_state(hot, TANK, NOW + timedelta(seconds=1), 1.0) == "a hull at 500 K"


def to_a_gauge() -> None:
    assert messages.STATE.gauges[KEY].title == "Hull"
    assert messages.STATE.shown(REPORT)[KEY] == 281.5


def from_a_file() -> None:
    text = f"time,latitude,longitude,depth,{KEY}\n1.0,50.0,8.0,0.5,281.5\n".encode()
    found = read_recording(io.BytesIO(text), len(text), Policy.REFUSE, CHANNELS)
    assert found.flight[KEY].tolist() == [281.5]


if __name__ == "__main__":
    for name, check in (
        ("mavlink", by_mavlink),
        ("satellite", by_satellite),
        ("log", to_the_log),
        ("database", to_the_database),
        ("check", through_the_check),
        ("gauge", to_a_gauge),
        ("file", from_a_file),
    ):
        check()
        print(name)
