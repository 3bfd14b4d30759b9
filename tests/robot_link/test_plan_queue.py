"""A plan that waits on board, by radio and in records by satellite: proved by both hashes."""

import random
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from robot_link.mavlink import telemetry
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.telemetry import hash_octets
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    LinkState,
    OnboardPlanState,
    PlanHash,
    PlanQueue,
    PlanReport,
    RobotId,
)
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import sizes
from robot_link.satellite.content import (
    MobileOriginatedContent,
    Reason,
    ShortPlanReport,
    TransferAck,
    TransferState,
    is_waiting,
    waiting_ack,
)
from robot_link.satellite.record import BEST_SIZES, compose, read_mobile_originated
from server.satellite.content import values_of
from simulator.xbee_network import AirConditions
from tests.robot_link.rig import GRACE, MINI, Heard, mission, rig, until

FLYING = "a mission is running: wait for its end, or surface the robot"
FIRST, SECOND = mission(dives=3), mission(dives=2, timeout_s=700.0)
AT = datetime(2026, 5, 1, 12, tzinfo=UTC)
KEY = bytes(range(32))
SEEDS = random.Random(11).sample(range(10**6), 4)


def begin_to_fly(robot) -> None:
    """Let a robot of the rig say that it flies what is on board."""
    robot.program.is_flying, robot.program.refusal = True, FLYING
    robot.link.report_plan(OnboardPlanState.RUNNING)


def queue_told(heard: Heard) -> PlanQueue | None:
    return (heard.of(PlanQueue) or [None])[-1]


async def live(station, robot=MINI) -> None:
    await until(lambda: station.link_report(robot).state is LinkState.LIVE)


@pytest.mark.parametrize("seed", SEEDS)
async def test_plan_comes_to_wait_whatever_the_air_does_to_it(tmp_path: Path, seed):
    drawn = random.Random(seed)
    rough = AirConditions(
        loss=drawn.uniform(0.0, 0.35),
        duplication=drawn.uniform(0.0, 0.3),
        delay_s=0.002,
        jitter_s=drawn.uniform(0.0, 0.012),
        mac_retries=0,
    )
    async with rig(tmp_path, rough) as it, it.station() as (station, heard):
        robot = it.robots[MINI]
        await live(station)
        assert (await station.upload(MINI, FIRST)).state is OnboardPlanState.ON_BOARD
        begin_to_fly(robot)
        last = await station.upload(MINI, SECOND, may_wait=True)
        assert (last.state, last.sha256) == (OnboardPlanState.WAITING, SECOND.sha256())
        assert robot.plans.load() == FIRST
        assert robot.program.taken == [FIRST], "what is flown is left alone"
        await until(lambda: (one := queue_told(heard)) and one.next_sha256 == SECOND.sha256())
        told = queue_told(heard)
        assert (told.sha256, told.next_starts) == (FIRST.sha256(), False)
        again = await station.upload(MINI, SECOND, may_wait=True)
        assert again.state is OnboardPlanState.WAITING
        assert {one.state for one in heard.of(PlanReport)} <= {
            OnboardPlanState.NONE, OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING,
        }, "no answer to an offer is taken for the plan on board"  # fmt: skip


async def test_start_of_a_waiting_plan_is_held_and_then_the_change_is_told(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        robot = it.robots[MINI]
        await live(station)
        await station.upload(MINI, FIRST)
        begin_to_fly(robot)
        await station.upload(MINI, SECOND, may_wait=True)
        desk = robot.link._plan
        assert desk.obey(CommandKind.START, SECOND.sha256()[:12]) is CommandOutcome.DONE
        assert robot.program.obeyed == [], "nothing begins before the surfacing"
        await until(lambda: (one := queue_told(heard)) and one.next_starts)
        robot.link.begin_next_plan()
        assert robot.program.switched == [SECOND]
        await until(lambda: (one := queue_told(heard)) and one.last_sha256 == FIRST.sha256())
        told = queue_told(heard)
        assert (told.sha256, told.next_sha256, told.last_done) == (SECOND.sha256(), None, False)
        await until(lambda: heard.of(PlanReport)[-1].sha256 == SECOND.sha256())
        order = [
            one
            for one in heard.events
            if isinstance(one, PlanReport | PlanQueue) and one.sha256 == SECOND.sha256()
        ]
        assert isinstance(order[0], PlanQueue), "how the one before ended is told first"


async def test_plan_that_begins_while_the_queue_is_said_is_told_after_how_the_first_ended(
    tmp_path: Path,
):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        robot, begun = it.robots[MINI], []
        await live(station)
        await station.upload(MINI, FIRST)
        begin_to_fly(robot)
        await station.upload(MINI, SECOND, may_wait=True)
        robot.link._plan.obey(CommandKind.START, SECOND.sha256()[:12])
        send = robot.link._send

        async def sent(message, *options) -> None:
            await send(message, *options)
            if isinstance(message, grace.MAVLink_grace_plan_queue_message) and not begun:
                begun.append(robot.link.begin_next_plan())

        robot.link._send = sent
        await until(lambda: heard.of(PlanReport)[-1].sha256 == SECOND.sha256())
        told = [one for one in heard.events if isinstance(one, PlanReport | PlanQueue)]
        first = next(one for one in told if one.sha256 == SECOND.sha256())
        assert isinstance(first, PlanQueue)


async def test_of_two_robots_only_the_one_that_was_sent_it_keeps_a_plan(tmp_path: Path):
    async with rig(tmp_path, robots=(MINI, GRACE)) as it, it.station() as (station, heard):
        for robot in (MINI, GRACE):
            await live(station, robot)
            await station.upload(robot, FIRST)
            begin_to_fly(it.robots[robot])
        await station.upload(GRACE, SECOND, may_wait=True)
        await until(lambda: queue_told(heard))
        assert {one.robot for one in heard.of(PlanQueue)} == {GRACE}
        assert it.robots[MINI].plans.load_next() is None


async def test_station_that_knows_no_waiting_is_answered_as_ever(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        await station.upload(MINI, FIRST)
        begin_to_fly(it.robots[MINI])
        last = await station.upload(MINI, SECOND)
        assert (last.state, last.reason) == (OnboardPlanState.REFUSED, FLYING)
        assert queue_told(heard) is None, "a robot in which none waited says nothing new"


def test_offer_that_may_not_wait_is_the_offer_of_older_stations():
    codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
    fields = {"items": 3, "target_system": 1, "sha256": hash_octets(PlanHash("ab" * 32))}
    offer = grace.MAVLink_grace_plan_offer_message(**fields)
    frame = codec.pack(offer)
    assert frame[1] == 35, "two, one and 32 octets: the extension is cut off as zero"
    wants = codec.pack(grace.MAVLink_grace_plan_offer_message(**fields, may_wait=1))
    assert wants[1] == 36
    assert wants[10:45] == frame[10:45], "what older robots read is where it was"


def queue(**changes) -> PlanQueue:
    one = PlanQueue(
        RobotId("mini-1"), PlanHash("11" * 32), PlanHash("22" * 32), True, None, False, AT, AT
    )
    return replace(one, **changes)


@pytest.mark.parametrize(
    "said",
    [
        queue(),
        queue(next_sha256=None, next_starts=False),
        queue(sha256=None, next_starts=False),
        queue(last_sha256=PlanHash("33" * 32), last_done=True),
    ],
)
def test_queue_is_read_back_as_it_was_said(said):
    message = telemetry.plan_queue_message(said)
    assert telemetry.plan_queue(message, RobotId("mini-1"), AT) == said


def test_impossible_queue_is_no_queue():
    message = telemetry.plan_queue_message(queue(next_sha256=PlanHash("11" * 32)))
    with pytest.raises(ValueError, match="behind itself"):
        telemetry.plan_queue(message, RobotId("mini-1"), AT)
    message = telemetry.plan_queue_message(queue())
    message.next_starts = 7
    with pytest.raises(ValueError, match="flag"):
        telemetry.plan_queue(message, RobotId("mini-1"), AT)


@pytest.mark.parametrize("starts", [False, True])
@pytest.mark.parametrize("most_bytes", BEST_SIZES)
def test_record_by_satellite_names_both_plans_within_its_bytes(starts, most_bytes):
    blob = Blob.of(SECOND)
    ack = waiting_ack(blob.transfer_id, len(sizes(blob)), starts=starts)
    plan = ShortPlanReport(FIRST.sha256()[:16], OnboardPlanState.RUNNING, 2, 15, 3.5)
    record = compose(MobileOriginatedContent(9, plan=plan, acks=(ack,)), KEY, 1, most_bytes)
    assert len(record) <= most_bytes
    read = read_mobile_originated(record, KEY, 1, RobotId("mini-1"), AT)
    told = values_of(
        read,
        RobotId("mini-1"),
        AT,
        AT,
        lambda _: FIRST.sha256(),
        lambda name: SECOND.sha256() if name == blob.transfer_id else None,
    )
    found = next(one for one in told if isinstance(one, PlanQueue))
    assert (found.sha256, found.next_sha256) == (FIRST.sha256(), SECOND.sha256())
    assert found.next_starts is starts


def test_older_station_takes_the_word_on_a_waiting_plan_for_one_that_came_in_whole():
    ack = waiting_ack(Blob.of(SECOND).transfer_id, 3, starts=True)
    assert is_waiting(ack)
    assert ack.state is TransferState.RECEIVING
    assert ack.received == {0, 1, 2}
    plain = TransferAck(ack.transfer_id, 3, ack.received, TransferState.RECEIVING)
    packed = [compose(MobileOriginatedContent(1, acks=(one,)), KEY, 1, 70) for one in (plain, ack)]
    assert len(packed[0]) == len(packed[1])
    assert ack.reason is Reason.NEXT_STARTS
    assert not is_waiting(plain)
