"""The robot's talk by satellite, the same program over two kinds of device."""

import asyncio
import math
from collections import Counter
from collections.abc import Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import pairwise

import pytest

from autonomy.planner.leg import primitive
from onboard.link.channel_announcer import TableInForce
from onboard.link.plan_desk import PlanOnBoard
from onboard.link.plan_store import MemoryPlanStore, WaitingPlan
from onboard.node.satellite import SatelliteClient
from onboard.satellite.policy import CallLimits
from onboard.satellite.receiver import MemoryStore, Receiver
from onboard.satellite.talk import SatelliteTalk, TalkSettings
from robot_link.channel_table import ChannelTable, TableRow
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    LogId,
    OnboardPlanState,
    RobotId,
    RobotMode,
    StateReport,
    SystemId,
)
from robot_link.mission import Mission
from robot_link.report import CurrentReport, TargetReport
from robot_link.robot_program import CommandOutcome
from robot_link.sample_log import Measurement, MemorySampleLog, SampleKey
from robot_link.satellite.blob import Blob
from robot_link.satellite.channel_code import ChannelPart
from robot_link.satellite.chunk import cut
from robot_link.satellite.content import Reason, TransferState
from robot_link.satellite.order import pack_order
from robot_link.satellite.record import read_mobile_originated
from simulator.background import alongside
from tests.robot_link.rig import until
from tests.robot_link.target_case import track
from tests.simulator.flight import EPOCH, TANK_PLANNER, mission, two_dives
from tests.simulator.satellite_rig import IMEI, cellular, fast_clock, heard, iridium, network

ROBOT, SYSTEM, KEY = RobotId("grace-1"), SystemId(2), bytes(range(32))
STATE = StateReport(
    robot=ROBOT,
    measured_at=EPOCH,
    received_at=EPOCH,
    position_ned=(360.0, 350.0, 0.0),
    position_std_m=2.0,
    velocity_ned=(0.0, 0.0, 0.0),
    roll_rad=0.0,
    pitch_rad=0.1,
    heading_rad=0.8,
    net_buoyancy_kg=-0.05,
    mass_position_m=0.0,
    tail_rad=0.0,
    battery_fraction=0.9,
    battery_v=20.0,
    mode=RobotMode.IDLE,
    has_fix=True,
    energy_used=0.0,
)


NO_PLAN = PlanOnBoard(None, OnboardPlanState.NONE, 0, 0, 0.0, "")


@dataclass
class Channels:
    """What a robot measures."""

    in_force: TableInForce | None = None


@dataclass
class Link:
    """What the robot's radio side is told."""

    refusal: str = ""
    plan: PlanOnBoard = NO_PLAN
    taken: list[tuple[str, bool]] = field(default_factory=list)
    commands: list[CommandKind] = field(default_factory=list)
    last_heard_station_s: float = math.inf
    plans: MemoryPlanStore = field(default_factory=MemoryPlanStore)
    flown: set[str] = field(default_factory=set)
    channels: Channels = field(default_factory=Channels)
    is_flying: bool = False
    waiting_plan: WaitingPlan | None = None

    @property
    def plan_hash(self):
        return self.plan.sha256

    def plan_report(self) -> PlanOnBoard:
        return self.plan

    def take_mission(self, taken: Mission, *, start: bool, may_wait: bool = False) -> str:
        self.taken.append((taken.sha256(), start))
        if may_wait and self.is_flying:
            self.waiting_plan = WaitingPlan(taken, starts=start)
            return ""
        if not self.refusal:
            self.plans.replace(taken)
            state = OnboardPlanState.RUNNING if start else OnboardPlanState.ON_BOARD
            self.plan = PlanOnBoard(taken.sha256(), state, 0, len(taken.legs), 0.0, "")
        return self.refusal

    def take_command(self, command) -> CommandOutcome:
        self.commands.append(command.kind)
        return CommandOutcome.DONE


@dataclass
class Afloat:
    """A robot that has lain at the surface for hours, by a clock of its own."""

    clock: object
    surfaced_s: float = 20_000.0
    is_talking: bool = False
    variable: str = "chlorophyll"
    digest_settings: None = None
    track: TargetReport | None = None
    newest_condition: tuple[dict[str, float], datetime] | None = None

    @property
    def time_s(self) -> float:
        return (self.clock.now() - EPOCH).total_seconds()

    def state_report(self) -> StateReport:
        return STATE

    def target_report(self) -> TargetReport | None:
        return self.track

    def current_report(self) -> CurrentReport:
        return CurrentReport(
            ROBOT, STATE.measured_at, STATE.measured_at, (0.02, -0.01), 0.004, 1.0, 3, 0
        )


@dataclass
class Rig:
    """The talk with what it says and does."""

    talk: SatelliteTalk
    link: Link
    program: Afloat
    samples: MemorySampleLog
    ashore: list[bytes]
    sky: object
    store: MemoryStore
    notes: list[str]

    def records(self):
        return [
            read_mobile_originated(data, KEY, SYSTEM, ROBOT, EPOCH) for data in self.ashore if data
        ]

    def states(self) -> list[TransferState]:
        return [ack.state for record in self.records() for ack in record.acks]


@asynccontextmanager
async def talking(
    kind,
    folder,
    *,
    store: MemoryStore | None = None,
    link: Link | None = None,
    sessions_per_day: int = 10_000,
    measured: Sequence[str] = ("chlorophyll",) * 40,
):
    sky = network()
    ashore = heard(sky)
    clock = fast_clock()
    store = store or MemoryStore()
    samples = MemorySampleLog(LogId(1))
    for n, channel in enumerate(measured):
        place = (float(n), float(7 * n % 11), 3.0)
        samples.append(Measurement(channel, 2.0 + 0.1 * n, place, 3.0, EPOCH))
    async with kind(sky, folder) as node:
        rig_link, program, notes = link or Link(), Afloat(clock), []
        talk = SatelliteTalk(
            ROBOT,
            SYSTEM,
            KEY,
            client=SatelliteClient(node),
            receiver=Receiver(store, KEY, SYSTEM),
            link=rig_link,
            program=program,
            samples=samples,
            clock=clock,
            settings=TalkSettings(CallLimits(20.0, 600.0, sessions_per_day), 205),
            plans=rig_link.plans,
            was_flown=rig_link.flown.__contains__,
            note=notes.append,
        )
        async with alongside(talk.run(), "talk"):
            yield Rig(talk, rig_link, program, samples, ashore, sky, store, notes)


def parts(plan: Mission, counter: int = 2, *, start: bool = True) -> tuple[bytes, ...]:
    return cut(Blob.of(plan), KEY, SYSTEM, counter, start=start, ack_seen=False)


def long_plan() -> Mission:
    """A plan that takes two messages: legs without a pattern."""
    places = [
        (0.5 + 0.3 * math.sin(7.3 * n), 0.5 + 0.3 * math.sin(3.1 * n * n), 0.3 * (n % 2))
        for n in range(61)
    ]
    return mission(*(primitive.glide(TANK_PLANNER, a, b) for a, b in pairwise(places)))


KINDS = pytest.mark.parametrize("kind", [iridium, cellular])


@KINDS
async def test_one_program_calls_and_takes_a_mission_over_either_device(kind, tmp_path):
    plan = mission(*two_dives())
    async with talking(kind, tmp_path) as rig:
        await until(lambda: bool(rig.records()))
        first = rig.records()[0]
        assert first.state.position_ned == pytest.approx((360.0, 350.0, 0.0), abs=0.2)
        assert first.samples
        for part in (*parts(plan), *parts(plan)):
            rig.sky.accept(IMEI, part)
        await until(lambda: TransferState.APPLIED in rig.states())
        assert rig.link.taken == [(plan.sha256(), True)]
        last = rig.records()[-1]
        assert last.plan.digits == plan.sha256()[:16]
        assert last.plan.state is OnboardPlanState.RUNNING


async def test_record_of_a_robot_that_follows_a_target_tells_its_hold_on_it(tmp_path):
    async with talking(iridium, tmp_path) as rig:
        await until(lambda: bool(rig.records()))
        assert rig.records()[0].target is None
        rig.program.track = track(ranges_heard=5000)
        rig.sky.accept(IMEI, b"garbage that only rings")
        await until(lambda: rig.records()[-1].target is not None)
        told = rig.records()[-1].target
        assert told.ranges_heard == 5000
        assert told.hypotheses[0].weight == pytest.approx(0.75, abs=0.01)


async def test_a_robot_tells_its_table_once_and_its_condition_at_a_rate_of_its_own(tmp_path):
    async with talking(iridium, tmp_path) as rig:
        rows = (TableRow(64, "leak", "1", "switch", 30.0), TableRow(200, "methane", "nmol/L"))
        table = ChannelTable(rows)
        rig.link.channels.in_force = TableInForce(table, SampleKey(LogId(1), 3), EPOCH)
        rig.program.newest_condition = {"humidity": 95.0, "leak": 0.0, "gps_hdop": math.nan}, EPOCH
        await until(lambda: bool(rig.records()) and rig.records()[-1].channels.page)
        told = rig.records()[-1].channels
        assert (told.page.rows, told.page.sequence, told.page.pages) == (rows, 3, 1)
        assert [one.channel for one in told.readings] == ["humidity", "leak"]
        before = len(rig.records())
        rig.sky.accept(IMEI, b"garbage that only rings")
        await until(lambda: len(rig.records()) > before)
        again = rig.records()[before].channels
        assert (again.version.version, again.page, again.readings) == (table.version, None, ())


async def test_a_robot_of_an_older_station_says_nothing_of_its_channels(tmp_path):
    async with talking(iridium, tmp_path) as rig:
        rig.talk._settings.health_s = 0.0
        rows = (TableRow(64, "leak", "1", "switch", 30.0),)
        rig.link.channels.in_force = TableInForce(ChannelTable(rows), SampleKey(LogId(1), 3), EPOCH)
        before = len(rig.records())
        rig.sky.accept(IMEI, b"garbage that only rings")
        await until(lambda: len(rig.records()) > before)
        assert rig.records()[-1].channels == ChannelPart()


async def test_samples_that_were_taken_ashore_are_not_sent_again(tmp_path):
    async with talking(iridium, tmp_path) as rig:
        await until(lambda: bool(rig.records()))
        rig.sky.accept(IMEI, b"garbage that only rings")
        await until(lambda: len(rig.records()) >= 2 and rig.talk.refused)
        sent = [sample.sequence for record in rig.records() for sample in record.samples]
        assert len(sent) == len(set(sent)) > 4
        assert rig.talk.refused == 1
        assert all(size <= 205 for size in map(len, rig.ashore))


@pytest.mark.parametrize("planned", [40, 2])
async def test_other_channels_have_what_room_the_planned_field_leaves(planned, tmp_path):
    measured = ("temperature", "dissolved_oxygen") * 20 + ("chlorophyll",) * planned
    async with talking(iridium, tmp_path, measured=measured) as rig:
        await until(lambda: bool(rig.records()))
        told = Counter(sample.variable for sample in rig.records()[0].samples)
    if planned > 2:
        assert set(told) == {"chlorophyll"}
    else:
        assert told["chlorophyll"] == planned
        assert min(told["temperature"], told["dissolved_oxygen"]) >= 2
    assert all(size <= 205 for size in map(len, rig.ashore))


async def test_robot_that_rings_without_end_spends_what_a_day_allows_and_not_more(tmp_path):
    async with talking(iridium, tmp_path, sessions_per_day=4) as rig:
        for number in range(12):
            rig.sky.accept(IMEI, b"garbage that only rings %d" % number)
        await until(lambda: any("spent" in note for note in rig.notes))
        assert rig.talk.sessions == 4
        assert not rig.talk._policy.is_due(rig.talk._situation())


async def test_mission_that_is_refused_is_told_and_changes_nothing(tmp_path):
    link = Link(refusal="a mission is running: wait for its end, or surface the robot")
    async with talking(iridium, tmp_path, link=link) as rig:
        for part in parts(mission(*two_dives())):
            rig.sky.accept(IMEI, part)
        await until(lambda: TransferState.REFUSED in rig.states())
        assert rig.link.plan.sha256 is None


async def test_mission_that_came_and_was_flown_by_radio_is_not_flown_again(tmp_path):
    plan = mission(*two_dives())
    flown = PlanOnBoard(plan.sha256(), OnboardPlanState.DONE, 4, 4, 12.0, "")
    async with talking(iridium, tmp_path, link=Link(plan=flown)) as rig:
        for part in parts(plan):
            rig.sky.accept(IMEI, part)
        await until(lambda: TransferState.APPLIED in rig.states())
        assert rig.link.taken == []


async def test_plan_that_was_flown_before_the_robot_was_switched_off_is_not_flown_again(tmp_path):
    plan = mission(*two_dives())
    waiting = PlanOnBoard(plan.sha256(), OnboardPlanState.ON_BOARD, 0, 4, 0.0, "")
    link = Link(plan=waiting, flown={plan.sha256()})
    async with talking(iridium, tmp_path, link=link) as rig:
        for part in parts(plan):
            rig.sky.accept(IMEI, part)
        await until(lambda: TransferState.APPLIED in rig.states())
        assert rig.link.taken == []


async def test_mission_of_which_a_part_came_gives_way_to_a_plan_by_radio(tmp_path):
    old, new = parts(long_plan()), mission(*two_dives())
    assert len(old) > 1
    async with talking(iridium, tmp_path) as rig:
        rig.sky.accept(IMEI, old[0])
        await until(lambda: TransferState.RECEIVING in rig.states())
        rig.link.take_mission(new, start=False)
        for part in old[1:]:
            rig.sky.accept(IMEI, part)
        await until(lambda: TransferState.REFUSED in rig.states())
        assert rig.link.taken == [(new.sha256(), False)]
        acks = [ack for record in rig.records() for ack in record.acks]
        assert acks[-1].reason is Reason.WITHDRAWN


async def test_mission_of_which_a_part_came_stays_where_the_radio_brought_the_same(tmp_path):
    plan = long_plan()
    async with talking(iridium, tmp_path) as rig:
        rig.sky.accept(IMEI, parts(plan)[0])
        await until(lambda: TransferState.RECEIVING in rig.states())
        rig.link.take_mission(plan, start=False)
        for part in parts(plan)[1:]:
            rig.sky.accept(IMEI, part)
        await until(lambda: TransferState.APPLIED in rig.states())
        assert TransferState.REFUSED not in rig.states()
        assert rig.link.taken[-1] == (plan.sha256(), True)


class FullDisk(MemoryStore):
    """A store that can be full."""

    is_full = False

    def save(self, data: bytes) -> None:
        if self.is_full:
            raise OSError(28, "No space left on device")
        super().save(data)


async def test_disk_that_refuses_ends_a_call_and_not_the_robot(tmp_path):
    plan, store = mission(*two_dives()), FullDisk()
    async with talking(iridium, tmp_path, store=store) as rig:
        await until(lambda: bool(rig.records()))
        store.is_full = True
        for part in parts(plan):
            rig.sky.accept(IMEI, part)
        await until(lambda: any("cannot be written" in note for note in rig.notes))
        store.is_full = False
        for part in parts(plan):
            rig.sky.accept(IMEI, part)
        await until(lambda: TransferState.APPLIED in rig.states())
        assert len(rig.link.taken) == 1


async def test_order_is_obeyed_once_and_answered_over_a_restart(tmp_path):
    order = pack_order(
        CommandKind.SURFACE, CommandNumber(5), EPOCH + timedelta(days=1), None, KEY, SYSTEM, 7
    )
    store = MemoryStore()
    for turn in range(2):
        async with talking(iridium, tmp_path, store=store) as rig:
            rig.sky.accept(IMEI, order)
            await until(lambda rig=rig: any(record.answers for record in rig.records()))
            assert rig.link.commands == ([CommandKind.SURFACE] if turn == 0 else [])


async def test_nobody_calls_while_the_radio_is_heard_until_it_rings(tmp_path):
    async with talking(iridium, tmp_path, link=Link(last_heard_station_s=0.0)) as rig:
        await asyncio.sleep(0.5)
        assert rig.ashore == []
        assert not rig.program.is_talking
        rig.sky.accept(IMEI, b"garbage that only rings")
        await until(lambda: bool(rig.records()))
