"""A long mission over the slowest radio there is, and the speed of the parsers behind it.

The air carries 10 kbit/s in all, one packet after another, and loses every fifth packet or its
confirmation; the robot goes on reporting its state meanwhile. The radio itself does not repeat
(with its own repetitions the loss would hardly be seen), so all repetition is the link's.
"""

import asyncio
import dataclasses
import random
import tempfile
import time
from collections.abc import Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import RobotLink
from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.frame import MavlinkFrameReader
from robot_link.mavlink.mission_item import item_count
from robot_link.messages import LinkState, LogId, OnboardPlanState, UploadReport
from robot_link.mission import Mission
from robot_link.sample_log import MemorySampleLog
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.timing import LinkTiming
from robot_link.transport.port import SerialPort
from robot_link.transport.xbee import XBeeTiming, XBeeTransport
from robot_link.transport.xbee_frame import FrameReader, ReceivePacket, encode, parse_content
from simulator.xbee_network import AirConditions, XBeeNetwork
from tests.robot_link.far_end import heartbeat
from tests.robot_link.rig import ADDRESSES, MINI, STATION, SYSTEMS, Program, mission, state

Timing = TypeVar("Timing", LinkTiming, XBeeTiming)

BIT_RATE = 10_000.0
LOSS = 0.2
ITEMS = 200
RETRIES = 3
TELEMETRY_PERIOD_S = 1.0
PARSED_BYTES = 4_000_000


@dataclass(frozen=True)
class SlowUpload:
    """What became of a mission."""

    report: UploadReport
    """The last attempt's."""
    attempts: int
    took_s: float
    """Seconds of the slow air, all attempts together."""
    items: int
    kept: list[Mission]
    """Every mission that the robot ever held, one after another."""


class Shelf(MemoryPlanStore):
    """A plan store that remembers everything that it ever held."""

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[Mission] = []

    def replace(self, mission: Mission) -> None:
        """Make a mission the plan on board, and remember that it was."""
        super().replace(mission)
        self.kept.append(mission)


def measure() -> list[dict[str, Any]]:
    """Upload over the slow air in its own time, and read as fast as the machine can."""
    sent = long_mission(ITEMS)
    done = asyncio.run(upload(sent, seed=0))
    is_whole = done.kept == [sent]
    is_proved = done.report.state is OnboardPlanState.ON_BOARD and done.attempts <= RETRIES
    xbee = _read_speed(partial(FrameReader, 1), _xbee())
    mavlink = _read_speed(MavlinkFrameReader, _mavlink())
    is_met = float(is_whole and is_proved)
    what = f"Mission of {done.items} items, {BIT_RATE / 1000:g} kbit/s, {LOSS:.0%} lost"
    limit_s = RETRIES * time_limit_s(done.items)
    return [
        _row(f"{what}: whole, hash verified", is_met, "1 = yes", 1.0, at_least=True),
        _row(f"{what}: time on board", done.took_s, "s", limit_s),
        _row("XBee frames read, API mode 1", xbee, "1/s"),
        _row("MAVLink frames found in a stream", mavlink, "1/s"),
    ]


def long_mission(items: int) -> Mission:
    """Return a mission of at least so many items."""
    dives = 1
    while item_count(mission(dives)) < items:
        dives += 1
    return mission(dives)


def time_limit_s(items: int) -> float:
    """Return how long one attempt to upload may take."""
    timing = LinkTiming()
    return timing.upload_s + timing.upload_item_s * items


async def upload(sent: Mission, seed: int, haste: float = 1.0) -> SlowUpload:
    """Upload a mission over the slow air, again up to ``RETRIES`` times where it fails.

    Args:
        sent: The mission.
        seed: Starting point of the losses.
        haste: How many times as fast everything runs: the air, its delays and every time-out of
            both ends alike, so that only the machine's own slowness weighs more.
    """
    timing = hastened(LinkTiming(), haste)
    air = XBeeNetwork(
        random.Random(seed),
        AirConditions(
            loss=LOSS,
            delay_s=0.005 / haste,
            jitter_s=0.005 / haste,
            mac_retries=0,
            bit_rate=BIT_RATE * haste,
        ),
    )
    with tempfile.TemporaryDirectory() as folder:
        line = Path(folder) / "xbee"
        plans = Shelf()
        robot = RobotLink(
            SYSTEMS[MINI],
            air.robot_radio(ADDRESSES[MINI]),
            SystemClock(),
            Program(),
            log=MemorySampleLog(LogId(1)),
            plans=plans,
            timing=timing,
        )
        radio = XBeeTransport(
            partial(SerialPort.open, str(line), baud=115200, flow_control=False),
            timing=hastened(XBeeTiming(), haste),
            rate_kbit_s=10,
        )
        endpoint = RobotEndpoint(SYSTEMS[MINI], (RadioPath("xbee", ADDRESSES[MINI]),))
        station = StationLink(
            {"xbee": radio}, {MINI: endpoint}, SystemClock(), lambda _: None, timing
        )
        async with AsyncExitStack() as stack:
            await stack.enter_async_context(air.pty(STATION, line))
            await stack.enter_async_context(_running(robot.run))
            await stack.enter_async_context(_running(partial(_report, robot, haste)))
            await stack.enter_async_context(_running(station.run))
            while station.link_report(MINI).state is not LinkState.LIVE:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
            began_s = time.monotonic()
            report, attempts = await station.upload(MINI, sent), 1
            while report.state is OnboardPlanState.FAILED and attempts < RETRIES:
                report, attempts = await station.upload(MINI, sent), attempts + 1
            took_s = haste * (time.monotonic() - began_s)
        return SlowUpload(report, attempts, took_s, item_count(sent), plans.kept)


def hastened(timing: Timing, haste: float) -> Timing:
    """Return time-outs that are so many times as short; counts stay."""
    values = {
        field.name: getattr(timing, field.name) / haste
        for field in dataclasses.fields(timing)
        if field.name.endswith("_s")
    }
    return dataclasses.replace(timing, **values)


async def _report(robot: RobotLink, haste: float) -> None:
    while True:
        robot.report_state(state(SystemClock().now()))
        await asyncio.sleep(TELEMETRY_PERIOD_S / haste)


@asynccontextmanager
async def _running(run: Callable):
    task = asyncio.create_task(run())
    try:
        yield
    finally:
        if task.done():
            task.result()
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


def _xbee() -> bytes:
    return encode(ReceivePacket(ADDRESSES[MINI], heartbeat(1) * 6).content(), 1)


def _mavlink() -> bytes:
    codec = Codec(SYSTEMS[MINI], ROBOT_COMPONENT)
    return b"".join(heartbeat(number, codec) for number in range(6))


def _read_speed(make: Callable[[], Any], piece: bytes) -> float:
    """Return how many frames of a stream are read per second of the processor."""
    stream = piece * (PARSED_BYTES // len(piece))
    reader = make()
    found = 0
    began_s = time.process_time()
    for start in range(0, len(stream), 4096):
        frames = reader.feed(stream[start : start + 4096])
        found += len(frames)
        if isinstance(reader, FrameReader):
            for content in frames:
                parse_content(content)
    return found / (time.process_time() - began_s)


def _row(
    name: str, value: float, unit: str, bar: float | None = None, *, at_least: bool = False
) -> dict[str, Any]:
    met = None if bar is None else (value >= bar if at_least else value <= bar)
    return {"area": "radio", "name": name, "value": value, "unit": unit, "bar": bar, "met": met}
