"""MAVSDK 4 as another maker's ground station, and as another maker's vehicle."""

import asyncio
import json
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import RobotLink
from onboard.link.waypoint_mission import WaypointRules
from robot_link.clock import SystemClock
from robot_link.mavlink.wire import grace
from robot_link.messages import LinkState, LogId, RobotId, SystemId
from robot_link.sample_log import MemorySampleLog
from robot_link.service.file_store import FolderFiles
from robot_link.service.parameter_table import Parameter, ParameterTable, ParameterType
from robot_link.service.standard_item import StandardItem
from robot_link.station.error import ServiceRefusedError
from robot_link.station.link import RobotEndpoint, StationLink
from robot_link.station.path import RadioPath
from robot_link.timing import LinkTiming
from robot_link.transport.opening import open_transport
from tests.free_port import free_port
from tests.robot_link.rig import Program, running, state, until

pytestmark = [pytest.mark.process, pytest.mark.timeout(600)]

ROOT = Path(__file__).parents[2]
LONGEST_S = 60.0
VEHICLE = RobotId("vehicle-1")
RULES = WaypointRules(
    origin_latitude_deg=43.0,
    origin_longitude_deg=-84.0,
    flattest_glide_deg=42.0,
    steepest_glide_deg=50.0,
)
"""The window of the gliders here; twenty waypoints under water are much flatter."""


@asynccontextmanager
async def peer(*arguments: str) -> AsyncIterator[asyncio.subprocess.Process]:
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "tests.robot_link.mavsdk_peer",
        *arguments,
        cwd=ROOT,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.communicate()


async def said(process: asyncio.subprocess.Process, key: str) -> dict[str, Any]:
    """The next object that the peer wrote with this key; the library's own log lines are none."""
    assert process.stdout is not None
    async with asyncio.timeout(LONGEST_S):
        while line := await process.stdout.readline():
            with suppress(ValueError):
                if isinstance(heard := json.loads(line), dict) and key in heard:
                    return heard
    raise AssertionError(f"the peer ended before it said {key!r}")


async def test_mavsdk_as_ground_station_reads_a_robot_and_gives_it_a_mission(tmp_path: Path):
    logs, local = tmp_path / "logs", tmp_path / "local"
    logs.mkdir()
    for folder in ("False", "True"):
        (local / folder).mkdir(parents=True)
    content = bytes(n * n % 251 for n in range(9000)) + bytes(500)
    (logs / "dive.bin").write_bytes(content)
    port = free_port(socket.SOCK_DGRAM)
    table = ParameterTable(
        (
            Parameter("GAIN_PITCH", ParameterType.REAL32, 0.4, 0.0, 2.0),
            Parameter("SAT_PERIOD_S", ParameterType.INT32, 600, 30, 86400),
        )
    )
    program, plans = Program(), MemoryPlanStore()
    link = RobotLink(
        SystemId(7),
        open_transport(f"udp://127.0.0.1:{port}"),
        SystemClock(),
        program,
        log=MemorySampleLog(LogId(1)),
        plans=plans,
        parameters=table,
        files=FolderFiles(logs),
        waypoints=RULES,
    )
    link.report_state(state(SystemClock().now()))
    async with (
        peer("ground_station", f"udpin://127.0.0.1:{port}", str(local)) as mavsdk,
        running(link.run),
    ):
        await said(mavsdk, "connected")
        seen = await said(mavsdk, "latitude_deg")
        assert seen["latitude_deg"] == pytest.approx(43.0 + 1.25 / 111_111, abs=1e-6)
        assert seen["altitude_m"] == pytest.approx(-0.375)
        assert seen["pitch_deg"] == pytest.approx(-24.757, abs=0.01)
        assert seen["voltage_v"] == pytest.approx(7.412)
        assert await said(mavsdk, "uploaded") == {"uploaded": 20, "same": True}
        (taken,) = program.taken
        assert plans.load() == taken
        assert len(taken.legs) >= 20
        refused = await said(mavsdk, "refused")
        assert refused["refused"]
        assert (await said(mavsdk, "above"))["above"]
        assert plans.load() == taken
        listed = await said(mavsdk, "ints")
        assert listed["ints"] == {"SAT_PERIOD_S": 600}
        assert listed["floats"] == {"GAIN_PITCH": pytest.approx(0.4)}
        assert await said(mavsdk, "period") == {"period": 1234, "gain": 0.75}
        assert table.read("SAT_PERIOD_S").value == 1234
        assert table.read("GAIN_PITCH").value == 0.75
        files = await said(mavsdk, "identical")
        assert files == {"files": [["dive.bin", len(content)]], "identical": True}
        for folder in ("False", "True"):
            assert (local / folder / "dive.bin").read_bytes() == content


async def test_mavsdk_as_vehicle_takes_a_mission_and_parameters_and_serves_a_file(tmp_path: Path):
    content = bytes(n * n % 251 for n in range(5000)) + bytes(100)
    (tmp_path / "dive.bin").write_bytes(content)
    port = free_port(socket.SOCK_DGRAM)
    uri = f"udp://127.0.0.1:{port}?listen=1"
    station = StationLink(
        {uri: open_transport(uri)},
        {VEHICLE: RobotEndpoint(SystemId(1), (RadioPath(uri),))},
        SystemClock(),
        lambda _event: None,
        LinkTiming(stale_s=LONGEST_S, answer_s=LONGEST_S / 4.0),
    )
    items = [
        StandardItem(
            grace.MAV_CMD_NAV_WAYPOINT,
            grace.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            x=430_000_000 + number,
            y=-840_000_000 - number,
            z=-0.5 * number,
        )
        for number in range(20)
    ]
    async with (
        running(station.run),
        peer("vehicle", f"udpout://127.0.0.1:{port}", str(tmp_path)) as mavsdk,
    ):
        await said(mavsdk, "ready")
        await until(lambda: station.link_report(VEHICLE).state is LinkState.LIVE, LONGEST_S)
        await station.services(VEHICLE).missions.upload(items)
        await station.services(VEHICLE).missions.verify(items)
        kept = await said(mavsdk, "mission")
        assert kept["mission"] == [[item.command, item.x, item.y, item.z] for item in items]
        listed = {value.name: value for value in await station.read_parameters(VEHICLE)}
        assert {name: value.value for name, value in listed.items()} == {
            "COUNT": 4,
            "OFFSET": -77,
            "GAIN": 0.5,
        }
        assert listed["COUNT"].is_integer
        assert not listed["GAIN"].is_integer
        assert (await station.write_parameter(VEHICLE, "COUNT", 9)).value == 9
        assert (await station.write_parameter(VEHICLE, "GAIN", 0.125)).value == 0.125
        (entry,) = await station.list_files(VEHICLE)
        assert (entry.name, entry.size) == ("dive.bin", len(content))
        assert await station.download_file(VEHICLE, "/dive.bin") == content
        with pytest.raises(ServiceRefusedError):
            await station.download_file(VEHICLE, "/none.bin")
        assert mavsdk.stdin is not None
        mavsdk.stdin.write(b"\n")
        assert await said(mavsdk, "count") == {"count": 9, "gain": 0.125}
