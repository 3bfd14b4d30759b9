"""A station and robots that talk through the emulated air, with what they said kept for tests."""

import asyncio
import math
import random
from collections.abc import AsyncGenerator, Callable, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from autonomy.planner.plan import Leg, PrimitiveKind
from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import CommandOutcome, RobotLink
from robot_link.camera.received_fix import ReceivedFix
from robot_link.clock import Clock, SystemClock, monotonic_s
from robot_link.drive import CENTRE, DriveReport, Stick
from robot_link.mavlink.signing import Signing
from robot_link.messages import (
    CommandKind,
    LogId,
    RobotId,
    RobotMode,
    Sample,
    StateReport,
    SystemId,
)
from robot_link.mission import Mission, MissionSettings
from robot_link.report import LinkEvent
from robot_link.sample_log import MemorySampleLog, SampleLog
from robot_link.station import path
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.timing import LinkTiming
from robot_link.transport.datagram import Address
from robot_link.transport.opening import open_transport
from simulator.xbee_network import AirConditions, XBeeNetwork

if TYPE_CHECKING:
    import pytest

STATION = Address(0x0013A200_41F000FF)
MINI = RobotId("mini-1")
GRACE = RobotId("grace-1")
SYSTEMS = {MINI: SystemId(1), GRACE: SystemId(2)}
ADDRESSES = {MINI: Address(0x0013A200_41F00001), GRACE: Address(0x0013A200_41F00002)}

HASTE = LinkTiming(
    heartbeat_s=0.1,
    stale_s=60.0,
    submerged_s=60.0,
    report_s=0.1,
    plan_report_s=0.2,
    answer_s=0.15,
    retry_s=0.3,
    upload_s=60.0,
    resend_s=0.1,
    resend_limit_s=0.4,
)
"""About ten times as fast as in use; but a machine that stands still for seconds is no silence."""

CALM = AirConditions(delay_s=0.0, jitter_s=0.002)
ROUGH = AirConditions(loss=0.3, duplication=0.2, delay_s=0.002, jitter_s=0.01, mac_retries=0)
"""Every third packet lost, some twice, many overtaken, and a radio that does not repeat."""

Event = TypeVar("Event", bound=LinkEvent)
T = TypeVar("T")


@dataclass
class Program:
    """An onboard program that keeps what it was told."""

    refusal: str = ""
    outcome: CommandOutcome = CommandOutcome.DONE
    obeyed: list[tuple[CommandKind, str]] = field(default_factory=list)
    taken: list[Mission] = field(default_factory=list)
    sticks: list[Stick] = field(default_factory=list)
    is_driven: bool = False
    fixes: list[ReceivedFix] = field(default_factory=list)
    refused_fixes: list[str] = field(default_factory=list)
    switched: list[Mission] = field(default_factory=list)
    is_flying: bool = False

    def plan_refusal(self) -> str:
        return self.refusal

    def take_plan(self, mission: Mission) -> None:
        self.taken.append(mission)

    def switch_refusal(self, mission: Mission) -> str:
        del mission
        return ""

    def switch_plan(self, mission: Mission) -> None:
        self.switched.append(mission)

    def obey(self, kind: CommandKind, plan_digits: str) -> CommandOutcome:
        self.obeyed.append((kind, plan_digits))
        return self.outcome

    def begin_drive(self) -> CommandOutcome:
        self.is_driven = self.outcome is CommandOutcome.DONE
        return self.outcome

    def end_drive(self) -> None:
        self.is_driven = False

    def steer(self, stick: Stick) -> None:
        self.sticks.append(stick)

    def hear_fix(self, fix: ReceivedFix) -> None:
        self.fixes.append(fix)

    def refuse_fix(self, reason: str) -> None:
        self.refused_fixes.append(reason)

    def drive_report(self, sequence: int) -> DriveReport:
        acts_on = self.sticks[-1] if self.sticks and self.is_driven else CENTRE
        at = SystemClock().now()
        return DriveReport(MINI, at, at, sequence, acts_on, self.is_driven, False, False)


@dataclass
class Robot:
    program: Program
    link: RobotLink
    plans: MemoryPlanStore
    log: SampleLog


@dataclass
class Heard:
    """Every event of a station, in order; storing samples can be switched off."""

    station: StationLink | None = None
    events: list[LinkEvent] = field(default_factory=list)
    stores: bool = True
    then: Callable[[LinkEvent], object] = lambda _event: None
    """Called with each event at once: what is done here, nothing that comes later overtakes."""

    def __call__(self, event: LinkEvent) -> None:
        self.events.append(event)
        self.then(event)
        if isinstance(event, Sample) and self.stores and self.station is not None:
            self.station.acknowledge_samples(event.robot, event.log, [event.sequence])

    def of(self, kind: type[Event]) -> list[Event]:
        return [event for event in self.events if isinstance(event, kind)]


@dataclass
class Rig:
    air: XBeeNetwork
    uri: str
    robots: dict[RobotId, Robot]
    reachable: set[RobotId]

    @asynccontextmanager
    async def station(
        self,
        timing: LinkTiming = HASTE,
        bind: bool = False,
        signing: Callable[[RobotId], Signing | None] = lambda _robot: None,
        clock: Clock | None = None,
    ) -> AsyncGenerator[tuple[StationLink, Heard], None]:
        heard = Heard()
        link = StationLink(
            {self.uri: open_transport(self.uri)},
            {
                robot: RobotEndpoint(
                    SYSTEMS[robot], (RadioPath(self.uri, ADDRESSES[robot] if bind else None),)
                )
                for robot in self.robots
            },
            clock or SystemClock(),
            heard,
            timing,
            signing,
        )
        heard.station = link
        async with running(link.run):
            yield link, heard


@asynccontextmanager
async def running(
    run: Callable[[], Coroutine[object, object, T]],
) -> AsyncGenerator[asyncio.Task[T], None]:
    """Run a task; if it ends by itself, its failure ends the test."""
    task = asyncio.create_task(run())
    try:
        yield task
    finally:
        if task.done():
            task.result()
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


@asynccontextmanager
async def rig(
    folder: Path,
    conditions: AirConditions = CALM,
    robots: tuple[RobotId, ...] = (MINI,),
    timing: LinkTiming = HASTE,
    cable: AsyncExitStack | None = None,
    **equipment: Any,
) -> AsyncGenerator[Rig, None]:
    """Set up the air; closing ``cable`` pulls the plug of the station's radio."""
    reachable = set(robots)
    by_address = {ADDRESSES[robot]: robot for robot in robots}

    def passes(first: Address, second: Address) -> bool:
        return all(by_address[one] in reachable for one in (first, second) if one in by_address)

    air = XBeeNetwork(random.Random(1), conditions, passes)
    built = {robot: robot_on(air, robot, timing, **equipment) for robot in robots}
    async with AsyncExitStack() as stack:
        await (cable or stack).enter_async_context(air.pty(STATION, folder / "xbee"))
        for robot in built.values():
            await stack.enter_async_context(running(robot.link.run))
        yield Rig(air, f"xbee://{folder}/xbee", built, reachable)


def robot_on(
    air: XBeeNetwork,
    robot: RobotId,
    timing: LinkTiming = HASTE,
    clock: Clock | None = None,
    log: SampleLog | None = None,
    **equipment: Any,
) -> Robot:
    program, plans = Program(), MemoryPlanStore()
    log = MemorySampleLog(LogId(77)) if log is None else log
    link = RobotLink(
        SYSTEMS[robot],
        air.robot_radio(ADDRESSES[robot]),
        clock or SystemClock(),
        program,
        log=log,
        plans=plans,
        timing=timing,
        **equipment,
    )
    return Robot(program, link, plans, log)


async def until(holds: Callable[[], object], longest_s: float = 60.0) -> None:
    """Wait until something holds, or fail."""
    async with asyncio.timeout(longest_s):
        while not holds():  # noqa: ASYNC110 - tests watch what has no event
            await asyncio.sleep(0.005)


async def settled(count: Callable[[], int]) -> None:
    """Wait until what was under way has come: a count that grows no more.

    It is looked at many times: a machine that stands still hides it from one look alone.
    """
    before, looks = count(), 0
    while looks < 20:
        await asyncio.sleep(0.005)
        looks = looks + 1 if count() == before else 0
        before = count()


def pass_time(monkeypatch: "pytest.MonkeyPatch", seconds: float) -> None:
    """Let the station find that nothing was heard for so much longer."""
    monkeypatch.setattr(path, "monotonic_s", lambda: monotonic_s() + seconds)


def soon(seconds: float = 60.0) -> datetime:
    return SystemClock().now() + timedelta(seconds=seconds)


def mission(dives: int = 6, timeout_s: float = 600.0) -> Mission:
    """A mission with every kind of primitive."""
    legs: list[Leg] = []
    here = (0.5, 0.25, 0.0)
    for number in range(dives):
        north, east, _ = here
        for kind, there in (
            (PrimitiveKind.GLIDE, (north + 0.4, east, 0.3)),
            (PrimitiveKind.SPIRAL, (north + 0.4, east + 0.1, 0.0)),
            (PrimitiveKind.DIVE, (north + 0.4, east + 0.1, 0.5)),
            (PrimitiveKind.SWIM, (north + 0.5, east + 0.1, 0.5)),
            (PrimitiveKind.GLIDE, (north + 0.5, east + 0.3, 0.0)),
        ):
            is_spiral = kind is PrimitiveKind.SPIRAL
            legs.append(
                Leg(
                    kind=kind,
                    start_ned=here,
                    end_ned=there,
                    speed_m_s=0.03,
                    duration_s=12.3 + number,
                    energy=1.5,
                    heading_rad=-math.pi / 3,
                    radius_m=0.35 if is_spiral else 0.0,
                    turn_rad=-4.2 if is_spiral else 0.0,
                )
            )
            here = there
    settings = MissionSettings(
        sample_period_s=1.0,
        max_uncertainty_m=0.6,
        timeout_s=timeout_s,
        start_x_m=0.5,
        start_y_m=0.25,
    )
    return Mission.from_legs(settings, tuple(legs))


def state(at: datetime, mode: RobotMode = RobotMode.GLIDING) -> StateReport:
    return StateReport(
        robot=MINI,
        measured_at=at,
        received_at=at,
        position_ned=(1.25, -0.5, 0.375),
        position_std_m=0.0625,
        velocity_ned=(0.125, -0.05, 0.03),
        roll_rad=0.01,
        pitch_rad=-0.4321,
        heading_rad=3.1,
        net_buoyancy_kg=0.00390625,
        mass_position_m=-0.0078125,
        tail_rad=0.5,
        battery_fraction=0.8765,
        battery_v=7.412,
        mode=mode,
        has_fix=True,
        energy_used=12.5,
    )
