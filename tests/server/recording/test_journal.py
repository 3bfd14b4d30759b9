import asyncio
import math
import os
import random
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import common

from benchmarks.station.telemetry_fleet import Program, state
from db.query.fleet.robots import change_robot
from db.query.station.journal import JournalRange, iterate_frames
from db.store import Store
from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import RobotLink
from robot_link.clock import SystemClock
from robot_link.messages import LogId, RawFrame, RobotId, SystemId
from robot_link.sample_log import MemorySampleLog
from robot_link.transport.datagram import Address
from server.base.settings import Settings
from server.fleet.fleet import Fleet
from server.recording.replay import compare, replay_into
from server.recording.tlog import tlog_blocks
from server.station import Station, run_station
from simulator.xbee_network import AirConditions, XBeeNetwork
from tests.db.target import target_report
from tests.robot_link.test_actuator_report import REPORT as ACTUATORS
from tests.server.conftest import MINI, until

STATION_RADIO = Address(0x0013A200_41F000FF)
ROUGH = AirConditions(loss=0.1, duplication=0.3, delay_s=0.001, jitter_s=0.01)
SAMPLES = 60
KEY = bytes(32)


async def talk(link):
    """Report states and samples for a while, one of them impossible, as a real robot would."""
    for number in range(SAMPLES):
        link.report_state(state(1, float(number)))
        link.report_target(replace(target_report(number), measured_at=datetime.now(UTC)))
        link.report_actuators(replace(ACTUATORS, measured_at=datetime.now(UTC)))
        at = datetime.now(UTC)
        depth_m = 900.0 if number == 7 else 0.4
        link.record_sample("blue_light", 0.1 * number, (1.0, 0.5, depth_m), 0.05, at)
        link.report_health({"humidity": float(number)}, at)
        await asyncio.sleep(0.01)


@pytest.fixture
async def folder(tmp_path):
    """A data folder after a robot talked to a real station through bad air."""
    network = XBeeNetwork(random.Random(3), ROUGH)
    settings = Settings(data_dir=tmp_path, worker_processes=1)
    async with network.tcp(STATION_RADIO, "127.0.0.1") as port:
        store = Store.open(settings.resolved_database_url)
        uri = f"xbee://127.0.0.1:{port}"
        store.change(lambda session: change_robot(session, MINI, links=[uri])).result()
        store.close()
        robot = RobotLink(
            SystemId(1),
            network.robot_radio(Address(0x0013A200_41F00001)),
            SystemClock(),
            Program(),
            log=MemorySampleLog(LogId(1)),
            plans=MemoryPlanStore(),
        )
        async with run_station(settings, Station) as running:
            serving = asyncio.create_task(robot.run())
            # before it knows the station, only the newest of its reports waits, and may be lost
            await until(lambda: math.isfinite(robot.last_heard_station_s))
            await talk(robot)
            await until(lambda: not robot.unacknowledged_samples)
            fleet = running.foundation.services.get(Fleet)
            await until(lambda: fleet.status(MINI).plan_report)
            serving.cancel()
            with suppress(asyncio.CancelledError):
                await serving
    return tmp_path


def opened(folder):
    folder.mkdir(exist_ok=True)
    return Store.open(Settings(data_dir=folder).resolved_database_url)


async def test_a_replay_of_the_journal_gives_the_rows_that_are_stored(folder, tmp_path):
    store, rebuilt = opened(folder), opened(tmp_path / "rebuilt")
    with store.read() as session:
        packets = replay_into(session, rebuilt, 1.0, lambda robot: KEY)
        tables = {table.table: table for table in compare(session, rebuilt)}
    store.close()
    rebuilt.close()
    assert packets > 10
    assert tables["sample"].same == SAMPLES - 1
    assert tables["reading"].same > 0
    assert tables["state_report"].same > 0
    assert tables["plan_report"].same > 0
    assert tables["track_report"].same > 0
    assert tables["actuator_report"].same > 0
    assert all(table.only_stored == table.only_replayed == 0 for table in tables.values())


async def test_every_packet_of_the_robot_carries_its_own_clock(folder):
    store = opened(folder)
    with store.read() as session:
        frames = list(iterate_frames(session, JournalRange(robot=MINI)))
    store.close()
    came = [frame for frame in frames if not frame.outgoing]
    told = [frame for frame in came if frame.robot_at is not None]
    assert len(told) > 10
    assert all(frame.robot_at <= frame.at for frame in told)
    assert any(frame.outgoing for frame in frames)


async def test_a_row_that_the_journal_does_not_give_is_found(folder, tmp_path):
    store, rebuilt = opened(folder), opened(tmp_path / "rebuilt")
    forged = state(1, 0.0)
    store.append([replace(forged, robot=RobotId(MINI))]).result()
    with store.read() as session:
        replay_into(session, rebuilt, 1.0, lambda robot: KEY)
        tables = {table.table: table for table in compare(session, rebuilt)}
    store.close()
    rebuilt.close()
    assert tables["state_report"].only_stored == 1


def test_the_telemetry_log_is_read_by_another_program(tmp_path):
    sender = common.MAVLink(None, srcSystem=7, srcComponent=1)
    at = datetime(2026, 11, 21, 8, 0, 0, 250000, tzinfo=UTC)
    first = sender.heartbeat_encode(12, 0, 0, 4, 4).pack(sender)
    second = sender.attitude_encode(5, 0.1, -0.2, 0.3, 0.0, 0.0, 0.0).pack(sender)
    frames = [
        RawFrame(None, "xbee", False, b"\x00garbage" + first + second, at),
        RawFrame(None, "rockblock", False, b"\x11\x22\x33", at),
    ]
    file = tmp_path / "flight.tlog"
    file.write_bytes(b"".join(tlog_blocks(frames)))
    log = mavutil.mavlink_connection(str(file), dialect="common")
    read = [log.recv_match(), log.recv_match()]
    assert [message.get_type() for message in read] == ["HEARTBEAT", "ATTITUDE"]
    assert read[1].pitch == pytest.approx(-0.2)
    assert read[1]._timestamp == pytest.approx(at.timestamp())
    assert log.recv_match() is None
    log.close()


@pytest.mark.process
async def test_the_command_line_says_whether_journal_and_rows_agree(folder, tmp_path):
    grace = [sys.executable, "-m", "server.cli", "journal"]
    root = Path(__file__).parents[3]

    def run(*words, **environment):
        return subprocess.run(
            [*grace, *words, "--data", str(folder)],
            cwd=root, capture_output=True, text=True, timeout=200,
            env={**os.environ, **environment},
        )  # fmt: skip

    agreed = await asyncio.to_thread(run, "replay")
    assert agreed.returncode == 0, agreed.stderr
    assert f"{SAMPLES - 1} rows the same, 0 only stored" in agreed.stdout
    live = f"sqlite:///{folder / 'station.sqlite3'}"
    again = await asyncio.to_thread(run, "replay", GRACE_DATABASE_URL=live)
    assert again.returncode == 0, "the replay went into a database of its own"
    file = tmp_path / "flight.tlog"
    written = await asyncio.to_thread(run, "tlog", str(file), "--robot", MINI)
    assert written.returncode == 0, written.stderr
    assert file.stat().st_size > 1000
    unknown = await asyncio.to_thread(run, "tlog", str(tmp_path / "no.tlog"), "--robot", "nobody")
    assert unknown.returncode != 0
    assert "no robot nobody" in unknown.stderr
    assert not (tmp_path / "no.tlog").exists()
