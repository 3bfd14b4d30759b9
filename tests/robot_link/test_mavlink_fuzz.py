"""Garbage, flipped bits and impossible but well-formed messages: nothing raises at either end."""

import asyncio
import random
import struct
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import RobotLink
from onboard.link.waypoint_mission import WaypointRules
from robot_link.clock import SystemClock
from robot_link.mavlink.codec import (
    ROBOT_COMPONENT,
    STATION_COMPONENT,
    STATION_SYSTEM,
    Codec,
)
from robot_link.mavlink.wire import grace
from robot_link.messages import LogId, SystemId
from robot_link.report import LinkEvent
from robot_link.sample_log import MemorySampleLog
from robot_link.service.file_store import FolderFiles
from robot_link.service.parameter_table import Parameter, ParameterTable, ParameterType
from robot_link.station.error import ServiceError
from robot_link.station.link import RobotEndpoint, StationLink
from robot_link.station.path import RadioPath
from robot_link.transport.datagram import (
    Address,
    Delivery,
    Fate,
    Received,
    TransportEvent,
)
from tests.robot_link.rig import HASTE, MINI, SYSTEMS, Program, running, state, until

FAR = Address(0)
DATAGRAMS = 3000
SERVED = (
    "command_int",
    "command_long",
    "mission_count",
    "mission_item_int",
    "mission_request_int",
    "mission_request",
    "mission_request_list",
    "mission_clear_all",
    "mission_ack",
    "param_set",
    "param_request_read",
    "param_request_list",
    "param_value",
    "param_error",
    "file_transfer_protocol",
    "timesync",
    "heartbeat",
    "autopilot_version",
    "command_ack",
    "grace_state",
    "grace_sample",
    "grace_sample_ack",
    "grace_plan_offer",
    "grace_plan_report",
    "grace_track",
)
"""Messages that some service of either end understands."""


class Told:
    """A radio that brings what it is told, and takes everything."""

    carrier = "told"
    max_payload = 256
    bytes_per_s = 1e6
    is_enabled = True

    def __init__(self, datagrams: list[bytes]) -> None:
        self._datagrams = datagrams
        self.is_done = False

    async def run(self) -> None:
        await asyncio.Event().wait()

    def set_enabled(self, is_enabled: bool) -> None:
        self.is_enabled = is_enabled

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        fate: asyncio.Future[Delivery] = asyncio.get_running_loop().create_future()
        fate.set_result(Delivery(Fate.DELIVERED))
        return fate

    async def events(self) -> AsyncIterator[TransportEvent]:
        for number, data in enumerate(self._datagrams):
            yield Received(FAR, data, None)
            if number % 50 == 0:
                await asyncio.sleep(0)
        self.is_done = True
        await asyncio.Event().wait()


def well_formed(rng: random.Random, sender: Codec, speaker: int, target: int) -> bytes:
    """A frame that every check of the wire lets through, of arbitrary content, for the target."""
    kind = getattr(grace, f"MAVLink_{rng.choice(SERVED)}_message")
    payload = rng.randbytes(kind.unpacker.size)
    if rng.random() < 0.5:  # small numbers get further than wild ones
        payload = bytes(octet if rng.random() < 0.3 else rng.choice((0, 1, 7)) for octet in payload)
    head = struct.pack(
        "<BBBBBBHB", len(payload), 0, 0, 0, speaker, 1, kind.id % 2**16, kind.id >> 16
    )
    check = grace.x25crc(head + payload + bytes((kind.crc_extra,))).crc
    (message,), bad = sender.unpack(b"\xfd" + head + payload + struct.pack("<H", check))
    assert bad == 0
    if hasattr(message, "target_system") and rng.random() < 0.95:
        message.target_system = target
    return sender.pack(message)


def datagrams(seed: int, speaker: SystemId, component: int, target: int) -> Iterator[bytes]:
    """Well-formed frames, the same with flipped bits, cut or run together, and noise."""
    rng = random.Random(seed)
    sender = Codec(speaker, component)
    for _ in range(DATAGRAMS):
        data = bytearray(well_formed(rng, sender, speaker, target))
        match rng.randrange(8):
            case 0:
                data = bytearray(rng.randbytes(rng.randrange(1, 280)))
            case 1:
                del data[rng.randrange(len(data)) :]
            case 2:
                data += well_formed(rng, sender, speaker, target)
            case 3:
                for _ in range(rng.randrange(1, 6)):
                    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            case _:
                pass
        yield bytes(data)


@pytest.mark.parametrize("speaker", [STATION_SYSTEM, SystemId(245)], ids=["station", "guest"])
async def test_nothing_that_arrives_at_a_robot_raises(tmp_path: Path, speaker: SystemId):
    (tmp_path / "dive.bin").write_bytes(bytes(1000))
    hello = Codec(speaker, STATION_COMPONENT).pack(
        grace.MAVLink_heartbeat_message(grace.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
    )
    told = [hello, *datagrams(5, speaker, STATION_COMPONENT, SYSTEMS[MINI])]
    radio = Told(told)
    table = ParameterTable((Parameter("GAIN", ParameterType.INT8, 1, 0, 5),))
    link = RobotLink(
        SYSTEMS[MINI],
        radio,
        SystemClock(),
        Program(),
        log=MemorySampleLog(LogId(1)),
        plans=MemoryPlanStore(),
        parameters=table,
        files=FolderFiles(tmp_path),
        waypoints=WaypointRules(origin_latitude_deg=43.0, origin_longitude_deg=-84.0),
        timing=HASTE,
    )
    link.report_state(state(SystemClock().now()))
    async with running(link.run) as task:
        await until(lambda: radio.is_done or task.done())
        assert not task.done()
    assert 0 < link.frames_bad < 3 * DATAGRAMS
    assert 0 <= table.read("GAIN").value <= 5


async def test_nothing_that_arrives_at_the_station_raises():
    radio = Told(list(datagrams(6, SYSTEMS[MINI], ROBOT_COMPONENT, STATION_SYSTEM)))
    events: list[LinkEvent] = []
    station = StationLink(
        {"told": radio},
        {MINI: RobotEndpoint(SYSTEMS[MINI], (RadioPath("told"),))},
        SystemClock(),
        events.append,
        HASTE,
    )
    async with running(station.run) as task:
        asking = [
            asyncio.create_task(work)
            for work in (
                station.services(MINI).parameters.read_all(),
                station.services(MINI).files.download("/dive.bin"),
                station.services(MINI).missions.download(),
                station.services(MINI).clock.measure(),
            )
        ]
        await until(lambda: radio.is_done or task.done())
        assert not task.done()
        for work in asking:
            work.cancel()
        ends = await asyncio.gather(*asking, return_exceptions=True)
    for end in ends:
        if isinstance(end, BaseException):
            assert isinstance(end, asyncio.CancelledError | ServiceError)
    assert station.link_report(MINI).frames_bad > 0
