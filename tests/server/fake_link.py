"""Robots that answer at once, in place of the radio and all that lies behind it."""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import cast

import numpy as np

from autonomy.field.synthetic import measure
from autonomy.planner.leg.primitive import position_at
from autonomy.planner.plan import PositionNed
from autonomy.planner.preset import MINIGLIDER
from robot_link.camera.fix import CameraFix
from robot_link.clock import Clock
from robot_link.drive import DriveReport, Stick
from robot_link.messages import (
    SURFACED_BY_COMMAND,
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    LinkReport,
    LinkState,
    LogId,
    OnboardPlanState,
    PlanHash,
    PlanQueue,
    PlanReport,
    RawFrame,
    RobotId,
    RobotMode,
    Sample,
    StateReport,
    SystemId,
    UploadReport,
)
from robot_link.mission import Mission
from robot_link.report import CurrentReport, LinkEvent
from robot_link.service.file_store import FileEntry
from robot_link.service.parameter_file import ParameterDescription
from robot_link.service.parameter_table import ParameterValue
from robot_link.service.standard_item import StandardItem
from robot_link.station.drive_client import DriveAnswer, DriveClient
from robot_link.station.error import ServiceRefusedError
from robot_link.station.fix_sender import OnSent
from robot_link.station.link import RobotEndpoint
from robot_link.transport.datagram import DatagramTransport
from server.link.signing import RobotSigning

SAMPLES_PER_LEG = 4


def state_report(
    robot: RobotId,
    position_ned: PositionNed = (1.0, 0.5, 0.0),
    at: datetime | None = None,
    **changes: object,
) -> StateReport:
    at = at or datetime.now(UTC)
    report = StateReport(
        robot=robot,
        measured_at=at,
        received_at=at,
        position_ned=position_ned,
        position_std_m=0.02,
        velocity_ned=(0.0, 0.0, 0.0),
        roll_rad=0.0,
        pitch_rad=-0.4,
        heading_rad=1.0,
        net_buoyancy_kg=0.01,
        mass_position_m=0.002,
        tail_rad=0.0,
        battery_fraction=0.9,
        battery_v=11.1,
        mode=RobotMode.IDLE,
        has_fix=True,
        energy_used=0.0,
    )
    return replace(report, **changes)


def current_report(robot: RobotId, at: datetime | None = None) -> CurrentReport:
    """Return the word of a robot that has lain in still water for a while."""
    at = at or datetime.now(UTC)
    return CurrentReport(robot, at, at, (0.0, 0.0), 0.001, 1.0, 0, 0)


class FakeRobot:
    """The robot's memory and its way to fly: through the plan in no time, sampling the truth."""

    def __init__(self, robot: RobotId, tell: Callable[[LinkEvent], None]) -> None:
        self.id = robot
        self.tell = tell
        self.plan: Mission | None = None
        self.state = OnboardPlanState.NONE
        self.leg = 0
        self.energy_used = 0.0
        self.reason = ""
        self.overspends = 0.0
        self.sequence = 0
        self.next: Mission | None = None
        self.next_starts = False
        self.last: tuple[PlanHash, bool] | None = None
        """The plan before, once the one that waited took its place."""
        self.may_fly = asyncio.Event()
        self.may_fly.set()
        self.may_end = asyncio.Event()
        """Lets it begin the last leg of a plan."""
        self.may_end.set()
        self.rng = np.random.default_rng(1)

    def say(self, state: OnboardPlanState | None = None, later_s: float = 0.0) -> None:
        self.state = self.state if state is None else state
        at = datetime.now(UTC)
        self.tell(
            PlanReport(
                robot=self.id,
                sha256=None if self.plan is None else self.plan.sha256(),
                state=self.state,
                leg=self.leg,
                legs=0 if self.plan is None else len(self.plan.legs),
                energy_used=self.energy_used,
                reason=self.reason,
                measured_at=at + timedelta(seconds=later_s),
                received_at=at,
            )
        )

    def say_queue(self) -> None:
        """Say which plan waits behind the one on board."""
        at = datetime.now(UTC)
        last, is_done = self.last or (None, False)
        self.tell(
            PlanQueue(
                robot=self.id,
                sha256=None if self.plan is None else self.plan.sha256(),
                next_sha256=None if self.next is None else self.next.sha256(),
                next_starts=self.next_starts,
                last_sha256=last,
                last_done=is_done,
                measured_at=at,
                received_at=at,
            )
        )

    def keep(self, mission: Mission | None, *, starts: bool = False) -> None:
        """Let a plan wait, or none."""
        self.next, self.next_starts = mission, starts
        self.say_queue()

    def change_over(self, *, is_done: bool = False) -> None:
        """Begin the plan that waits, at a surfacing."""
        assert self.plan is not None
        assert self.next is not None
        self.last = (self.plan.sha256(), is_done)
        self.plan, self.next, self.next_starts = self.next, None, False
        self.leg, self.energy_used, self.reason = 0, 0.0, ""
        self.say_queue()
        self.say(OnboardPlanState.RUNNING)

    def take(self, mission: Mission) -> None:
        self.plan, self.leg, self.energy_used, self.reason = mission, 0, 0.0, ""
        self.say(OnboardPlanState.ON_BOARD)

    async def follow(self) -> None:
        """Say that it follows its target, until it may end."""
        self.say(OnboardPlanState.RUNNING)
        await self.may_end.wait()
        if self.state is OnboardPlanState.RUNNING:
            self.say(OnboardPlanState.DONE)

    async def fly(self) -> None:
        plan = self.plan
        assert plan is not None
        if plan.tracking is not None:
            await self.follow()
            return
        self.say(OnboardPlanState.RUNNING)
        for number, leg in enumerate(plan.legs):
            self.leg = number
            await self.may_fly.wait()
            if number == len(plan.legs) - 1 and not self.may_end.is_set():
                self.say()
                await self.may_end.wait()
            if self.state is not OnboardPlanState.RUNNING:
                return
            for part in range(1, SAMPLES_PER_LEG + 1):
                self.sample(position_at(leg, part / SAMPLES_PER_LEG))
            surfacing = MINIGLIDER.surfacing_energy if leg.start_ned[2] == 0.0 else 0.0
            self.energy_used += leg.energy + surfacing + self.overspends
            self.tell(state_report(self.id, leg.end_ned, mode=RobotMode.GLIDING))
            self.say()
            await asyncio.sleep(0)
        self.say(OnboardPlanState.DONE)
        self.tell(state_report(self.id, plan.legs[-1].end_ned))

    def end_early(self, reason: str) -> None:
        self.reason = reason
        self.say(OnboardPlanState.FAILED)

    def sample(
        self,
        position: PositionNed,
        variable: str = "blue_light",
        value: float | None = None,
        position_std_m: float = 0.05,
        measured_at: datetime | None = None,
    ) -> Sample:
        at = datetime.now(UTC)
        if value is None:
            value = float(measure(variable, np.array([position]), self.rng)[0])
        sample = Sample(
            self.id,
            LogId(1),
            self.sequence,
            variable,
            value,
            position,
            position_std_m,
            measured_at or at,
            at,
        )
        self.sequence += 1
        self.tell(sample)
        return sample


class FakeDrive:
    """Stands where ``DriveClient`` stands: a robot that answers each stick it is sent."""

    def __init__(self, robot: RobotId) -> None:
        self.robot = robot
        self.on_answer: Callable[[DriveAnswer], None] = lambda _: None
        self.sticks: list[tuple[Stick, int]] = []
        self.is_driven = False
        self.refusal = ""
        self.is_free = asyncio.Event()
        """Whether the radio takes a stick."""
        self.is_free.set()

    async def begin(self) -> None:
        if self.refusal:
            raise ServiceRefusedError(self.refusal)
        self.is_driven = True

    async def end(self) -> None:
        self.is_driven = False

    async def steer(self, stick: Stick, tag: int) -> None:
        self.sticks.append((stick, tag))
        await self.is_free.wait()
        self.answer()

    def answer(self) -> None:
        """Answer the newest stick."""
        stick, tag = self.sticks[-1]
        report = DriveReport(
            self.robot, _now(), _now(), tag % 256, stick, self.is_driven, False, False
        )
        self.on_answer(DriveAnswer(report, tag, 0.02))


class FakeLink:
    """Stands where ``StationLink`` stands; carries neither parameters nor files.

    Every vehicle takes the waypoints that it is sent, and gives them back.
    """

    def __init__(self, clock: Clock, on_event: Callable[[LinkEvent], None], world: "World") -> None:
        self.on_event = on_event
        self.world = world
        self.clock = clock
        world.link = self

    def set_robots(
        self,
        robots: Mapping[RobotId, RobotEndpoint],
        transports: Mapping[str, DatagramTransport],
    ) -> None:
        del transports
        for robot in robots:
            known = self.world.robots.get(robot)
            if known is None:
                self.world.robots[robot] = FakeRobot(robot, self.on_event)
            else:
                known.tell = self.on_event

    async def run(self) -> None:
        await asyncio.Event().wait()

    def drive(self, robot: RobotId) -> DriveClient:
        return cast("DriveClient", self.world.drives.setdefault(robot, FakeDrive(robot)))

    async def read_parameters(self, robot: RobotId) -> Sequence[ParameterValue]:
        return ()

    async def write_parameter(self, robot: RobotId, name: str, value: float) -> ParameterValue:
        raise ServiceRefusedError(f"{robot} has no parameter {name}")

    async def describe_parameters(self, robot: RobotId) -> Mapping[str, ParameterDescription]:
        raise ServiceRefusedError(f"{robot} describes no parameters")

    async def upload_waypoints(
        self, robot: RobotId, items: Sequence[StandardItem], report: Callable[[int, int], None]
    ) -> None:
        self.world.waypoints[robot] = tuple(items)
        report(len(items), len(items))

    async def read_waypoints(
        self, robot: RobotId, report: Callable[[int, int], None]
    ) -> Sequence[StandardItem]:
        items = self.world.waypoints.get(robot, ())
        report(len(items), len(items))
        return items

    async def list_files(self, robot: RobotId, path: str = "/") -> Sequence[FileEntry]:
        return ()

    async def download_file(
        self, robot: RobotId, path: str, *, content: bytearray, report: Callable[[int, int], None]
    ) -> bytes:
        raise ServiceRefusedError(f"{robot} has no file {path}")

    async def upload(
        self, robot: RobotId, mission: Mission, *, may_wait: bool = False
    ) -> UploadReport:
        self.world.uploads.append((robot, mission.sha256()))
        fake = self.world.robots[robot]
        report = UploadReport(
            robot, mission.sha256(), 1, len(mission.legs), OnboardPlanState.RECEIVING, "", _now()
        )
        if self.world.radio_takes:
            self.on_event(report)
        await self.world.may_upload.wait()
        if self.world.refuse_upload:
            return replace(
                report, state=self.world.refuse_upload, reason="the robot did not answer"
            )
        if may_wait and fake.state is OnboardPlanState.RUNNING:
            fake.keep(mission)
            return replace(report, state=OnboardPlanState.WAITING, items_sent=len(mission.legs))
        fake.take(mission)
        return replace(report, state=OnboardPlanState.ON_BOARD, items_sent=len(mission.legs))

    async def let_go(self) -> None:
        pass

    def set_enabled(self, uri: str, is_enabled: bool) -> None:
        self.world.switched.append((uri, is_enabled))

    def cancel_upload(self, robot: RobotId, reason: str) -> None:
        self.world.cancelled_uploads.append((robot, reason))

    def send_command(
        self,
        robot: RobotId,
        kind: CommandKind,
        number: CommandNumber,
        expires: datetime,
        plan: PlanHash | None = None,
    ) -> None:
        self.world.commands.append((robot, kind, number))
        self.level(robot, number, CommandLevel.QUEUED)
        if not self.world.in_reach:
            return
        self.level(robot, number, CommandLevel.RADIO)
        self.level(robot, number, CommandLevel.APPLIED)
        fake = self.world.robots[robot]
        if kind is CommandKind.SURFACE and fake.next is not None:
            fake.keep(None)
        if kind is CommandKind.START and fake.next is not None and fake.next.sha256() == plan:
            fake.keep(fake.next, starts=True)
        elif kind is CommandKind.START and fake.state is OnboardPlanState.ON_BOARD:
            self.world.flights.append(asyncio.ensure_future(fake.fly()))
        if kind is CommandKind.SURFACE and fake.state is OnboardPlanState.RUNNING:
            fake.end_early(SURFACED_BY_COMMAND)

    def level(self, robot: RobotId, number: CommandNumber, level: CommandLevel) -> None:
        self.on_event(CommandReport(robot, number, level, _now(), "xbee"))

    def give_control(self, robot: RobotId, system: SystemId, *, allows_takeover: bool) -> None:
        self.world.controls.append((robot, system, allows_takeover))

    def answer_control(self, robot: RobotId, system: SystemId, *, is_heard: bool) -> None:
        self.world.control_answers.append((robot, system, is_heard))

    def send_fix(self, fix: CameraFix, on_sent: OnSent) -> str:
        if not self.world.in_reach:
            return f"{fix.robot} is not in radio contact"
        self.world.fixes.append(fix)
        on_sent(_now())
        return ""

    def acknowledge_samples(self, robot: RobotId, log: LogId, sequences: Iterable[int]) -> None:
        self.world.acknowledged += [(robot, log, number) for number in sequences]


class World:
    """What outlives a station: the robots, and a record of what they were told."""

    link: FakeLink
    """Of the station that runs, or that ran last."""

    def __init__(self) -> None:
        self.robots: dict[RobotId, FakeRobot] = {}
        self.uploads: list[tuple[RobotId, PlanHash]] = []
        self.controls: list[tuple[RobotId, SystemId, bool]] = []
        """Who is to be in control of each robot, and whether another may take it."""
        self.control_answers: list[tuple[RobotId, SystemId, bool]] = []
        self.fixes: list[CameraFix] = []
        """Where robots were told that cameras saw them."""
        self.cancelled_uploads: list[tuple[RobotId, str]] = []
        self.commands: list[tuple[RobotId, CommandKind, CommandNumber]] = []
        self.acknowledged: list[tuple[RobotId, LogId, int]] = []
        self.switched: list[tuple[str, bool]] = []
        self.waypoints: dict[RobotId, tuple[StandardItem, ...]] = {}
        """Missions on board of vehicles of other makers."""
        self.drives: dict[RobotId, FakeDrive] = {}
        self.flights: list[asyncio.Task[None]] = []
        self.in_reach = True
        self.radio_takes = True
        """Whether the radio takes the bytes of an upload."""
        self.refuse_upload: OnboardPlanState | None = None
        self.may_upload = asyncio.Event()
        self.may_upload.set()

    def make_link(
        self, clock: Clock, on_event: Callable[[LinkEvent], None], signing: RobotSigning
    ) -> FakeLink:
        del signing
        return FakeLink(clock, on_event, self)

    def tell(self, event: LinkEvent) -> None:
        self.link.on_event(event)

    def hear(self, robot: RobotId, state: LinkState = LinkState.LIVE, frames_bad: int = 0) -> None:
        """Let a robot come into reach."""
        self.tell(LinkReport(robot, "xbee", state, _now(), -50.0, 10, frames_bad))

    def frame(self, robot: RobotId, data: bytes = b"\xfd\x00") -> None:
        self.tell(RawFrame(robot, "xbee", False, data, _now()))

    async def close(self) -> None:
        for flight in self.flights:
            flight.cancel()
        await asyncio.gather(*self.flights, return_exceptions=True)


def _now() -> datetime:
    return datetime.now(UTC)
