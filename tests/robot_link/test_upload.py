"""Mission upload: whole or not at all, proved by the robot's own word on the hash."""

import asyncio
import dataclasses
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.mission_item import mission_items
from robot_link.mavlink.telemetry import hash_octets
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    LinkState,
    OnboardPlanState,
    PlanReport,
    RawFrame,
    UploadReport,
)
from robot_link.mission import Mission
from robot_link.report import LinkEvent
from robot_link.station import upload as upload_module
from robot_link.station.link import StationLink, UploadUnderWayError
from simulator.xbee_network import AirConditions
from tests.robot_link.rig import (
    ADDRESSES,
    HASTE,
    MINI,
    ROUGH,
    STATION,
    SYSTEMS,
    Heard,
    mission,
    rig,
    soon,
    until,
)

ITEMS = 2 + 6 * 6
"""Settings, trim, and six dives of five legs of which one has a circle."""


def at_item(heard: Heard, number: int, act: Callable[[], object]) -> None:
    """Do something as soon as so many items are proved, before the next one travels."""
    due = [act]

    def look(event: LinkEvent) -> None:
        if isinstance(event, UploadReport) and event.items_sent >= number and due:
            due.pop()()

    heard.then = look


async def live(station: StationLink) -> None:
    await until(lambda: station.link_report(MINI).state is LinkState.LIVE)


async def test_a_mission_comes_on_board_whole_and_is_echoed_by_its_hash(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        plan = mission()
        last = await station.upload(MINI, plan)
        assert (last.state, last.sha256) == (OnboardPlanState.ON_BOARD, plan.sha256())
        assert (last.items_sent, last.items) == (ITEMS, ITEMS)
        assert it.robots[MINI].program.taken == [plan]
        assert it.robots[MINI].plans.load() == plan
        await until(lambda: plan_told(heard) == plan.sha256())
        assert heard.of(PlanReport)[-1].legs == len(plan.legs)


async def test_progress_only_grows_and_on_board_comes_last(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        await station.upload(MINI, mission())
        reports = heard.of(UploadReport)
        assert [report.items_sent for report in reports] == list(range(ITEMS + 1))
        states = [report.state for report in reports]
        assert states[:-1] == [OnboardPlanState.RECEIVING] * ITEMS
        assert it.robots


async def test_a_rough_air_delays_a_mission_but_changes_nothing_in_it(tmp_path: Path):
    async with rig(tmp_path, ROUGH) as it, it.station() as (station, _heard):
        await live(station)
        plan = mission()
        last = await station.upload(MINI, plan)
        assert last.state is OnboardPlanState.ON_BOARD
        assert it.robots[MINI].program.taken == [plan]


async def test_the_same_mission_again_is_answered_at_once_and_taken_once(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        plan = mission()
        await station.upload(MINI, plan)
        heard.events.clear()
        last = await station.upload(MINI, plan)
        assert last.state is OnboardPlanState.ON_BOARD
        assert len(heard.of(UploadReport)) == 2
        assert it.robots[MINI].program.taken == [plan]


async def test_a_plan_that_was_flown_waits_again_when_uploaded_again(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        plan = mission()
        await station.upload(MINI, plan)
        it.robots[MINI].link.report_plan(OnboardPlanState.DONE, leg=30)
        await until(lambda: heard.of(PlanReport)[-1].state is OnboardPlanState.DONE)
        assert (await station.upload(MINI, plan)).state is OnboardPlanState.ON_BOARD
        assert it.robots[MINI].program.taken == [plan, plan]


async def test_a_station_that_dies_in_an_upload_just_uploads_again(tmp_path: Path):
    slow = AirConditions(delay_s=0.01, jitter_s=0.0)
    async with rig(tmp_path, slow) as it:
        plan = mission()
        async with it.station() as (station, heard):
            await live(station)
            at_item(heard, 15, it.reachable.clear)
            upload = asyncio.create_task(station.upload(MINI, plan))
            await until(lambda: any(r.items_sent >= 15 for r in heard.of(UploadReport)))
            upload.cancel()
        assert it.robots[MINI].program.taken == []
        it.reachable.add(MINI)
        async with it.station() as (station, heard):
            await live(station)
            last = await station.upload(MINI, plan)
            assert last.state is OnboardPlanState.ON_BOARD
            proved = [report.items_sent for report in heard.of(UploadReport)]
            assert min(sent for sent in proved if sent) >= 15, "begins where the first stopped"
        assert it.robots[MINI].program.taken == [plan]


async def test_a_robot_that_refuses_keeps_its_plan_and_says_why(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        first, second = mission(), mission(dives=2)
        await station.upload(MINI, first)
        it.robots[MINI].program.refusal = "under water"
        last = await station.upload(MINI, second)
        assert (last.state, last.reason) == (OnboardPlanState.REFUSED, "under water")
        assert it.robots[MINI].plans.load() == first
        assert it.robots[MINI].program.taken == [first]
        told = len(heard.of(PlanReport))
        await until(lambda: len(heard.of(PlanReport)) > told)
        assert {report.sha256 for report in heard.of(PlanReport)} <= {None, first.sha256()}


async def test_a_robot_that_dives_before_the_last_item_refuses_the_whole(tmp_path: Path):
    slow = AirConditions(delay_s=0.01, jitter_s=0.0)
    async with rig(tmp_path, slow) as it, it.station() as (station, heard):
        await live(station)
        program = it.robots[MINI].program
        at_item(heard, 15, lambda: setattr(program, "refusal", "under water"))
        last = await station.upload(MINI, mission())
        assert (last.state, last.reason) == (OnboardPlanState.REFUSED, "under water")
        assert it.robots[MINI].plans.load() is None


@pytest.mark.parametrize("is_foreign", [True, False])
async def test_items_of_another_mission_than_the_offered_leave_the_plan_on_board(
    tmp_path: Path, is_foreign: bool
):
    """Every frame is valid; only the hash tells that they do not belong together."""
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await live(station)
        first, second = mission(), mission(dives=2)
        await station.upload(MINI, first)
        carried = mission(dives=2, timeout_s=900.0) if is_foreign else second
        items = mission_items(carried, SYSTEMS[MINI])
        codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
        offer = grace.MAVLink_grace_plan_offer_message(
            len(items), SYSTEMS[MINI], hash_octets(second.sha256())
        )
        count = grace.MAVLink_mission_count_message(SYSTEMS[MINI], 1, len(items))
        for message in (offer, count, *items):
            await it.air.transmit(STATION, ADDRESSES[MINI], codec.pack(message))
        kept = first if is_foreign else second
        await until(lambda: plan_told(heard) == kept.sha256())
        told = await refusals(heard, 1 if is_foreign else 0)
        assert it.robots[MINI].plans.load() == kept
        assert it.robots[MINI].program.taken == ([first] if is_foreign else [first, second])
        assert plan_told(heard) == kept.sha256()
        assert told == (["the items are not the mission that was offered"] if is_foreign else [])


def plan_told(heard: Heard) -> str | None:
    """Return the hash that the robot said last, None before its first word."""
    reports = heard.of(PlanReport)
    return reports[-1].sha256 if reports else None


async def refusals(heard: Heard, count: int) -> list[str]:
    """Return the reasons of the refusals on the wire, once there are so many."""
    codec = Codec(STATION_SYSTEM, STATION_COMPONENT)

    def reasons() -> list[str]:
        return [
            message.reason
            for raw in heard.of(RawFrame)
            if not raw.outgoing
            for message in codec.unpack(raw.data).messages
            if isinstance(message, grace.MAVLink_grace_plan_report_message)
            and message.state == OnboardPlanState.REFUSED
        ]

    await asyncio.sleep(0.1)
    await until(lambda: len(reasons()) == count)
    return reasons()


async def test_an_upload_to_a_silent_robot_fails_after_its_time(tmp_path: Path):
    timing = dataclasses.replace(HASTE, upload_s=0.3, upload_item_s=0.0)
    async with rig(tmp_path) as it:
        it.reachable.clear()
        async with it.station(timing) as (station, _heard):
            last = await station.upload(MINI, mission())
            assert last.state is OnboardPlanState.FAILED
            assert last.reason == "no answer from the robot"


async def test_an_upload_cut_off_by_a_dive_tells_how_far_it_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    timing, passed_s = dataclasses.replace(HASTE, upload_s=600.0), [0.0]
    monkeypatch.setattr(upload_module, "monotonic_s", lambda: monotonic_s() + passed_s[0])
    slow = AirConditions(delay_s=0.01, jitter_s=0.0)
    async with rig(tmp_path, slow) as it, it.station(timing) as (station, heard):
        await live(station)
        at_item(heard, 5, it.reachable.clear)
        upload = asyncio.create_task(station.upload(MINI, mission()))
        await until(lambda: any(r.items_sent >= 5 for r in heard.of(UploadReport)))
        passed_s[0] = 2.0 * timing.upload_s
        last = await upload
        assert last.state is OnboardPlanState.FAILED
        assert f"after {last.items_sent} of {ITEMS} items" in last.reason
        assert it.robots[MINI].plans.load() is None


async def test_two_uploads_to_one_robot_are_not_mixed(tmp_path: Path):
    async with rig(tmp_path) as it, it.station() as (station, _heard):
        await live(station)
        first = asyncio.create_task(station.upload(MINI, mission()))
        await asyncio.sleep(0)
        with pytest.raises(UploadUnderWayError, match="mini-1"):
            await station.upload(MINI, mission(dives=2))
        assert (await first).state is OnboardPlanState.ON_BOARD
        assert len(it.robots[MINI].program.taken) == 1


async def test_surface_ends_an_upload_under_way(tmp_path: Path):
    slow = AirConditions(delay_s=0.02, jitter_s=0.0)
    async with rig(tmp_path, slow) as it, it.station() as (station, heard):
        await live(station)
        order = CommandKind.SURFACE, CommandNumber(1), soon()
        at_item(heard, 3, lambda: station.send_command(MINI, *order))
        last = await station.upload(MINI, mission())
        assert last.state is OnboardPlanState.FAILED
        assert "surface" in last.reason
        await until(lambda: it.robots[MINI].program.obeyed)
        assert it.robots[MINI].plans.load() is None


def test_a_mission_rebuilt_from_its_own_integers_has_the_same_name():
    plan = mission()
    again = Mission.from_integers(plan.settings_integers(), plan.leg_integers())
    assert again == plan
    assert again.sha256() == plan.sha256()


async def test_nothing_is_told_of_an_upload_that_no_radio_took(tmp_path: Path):
    short = dataclasses.replace(HASTE, upload_s=0.4, upload_item_s=0.0)
    async with AsyncExitStack() as cable, rig(tmp_path, cable=cable) as it:
        async with it.station(short) as (station, heard):
            await live(station)
            await cable.aclose()
            await until(lambda: station.link_report(MINI).state is LinkState.PORT_CLOSED)
            last = await station.upload(MINI, mission())
            assert last.state is OnboardPlanState.FAILED
            assert heard.of(UploadReport) == [last]
        assert it.robots[MINI].program.taken == []


async def test_a_robot_whose_memory_is_full_refuses_and_keeps_its_plan(tmp_path: Path):
    def full(_mission):
        raise OSError(28, "No space left on device")

    async with rig(tmp_path) as it, it.station() as (station, _):
        assert (await station.upload(MINI, mission(2))).state is OnboardPlanState.ON_BOARD
        it.robots[MINI].plans.replace = full
        report = await station.upload(MINI, mission(3))
        assert report.state is OnboardPlanState.REFUSED
        assert report.reason.startswith("the robot's memory does not take the plan")
        link = it.robots[MINI].link
        assert link.plan_hash == mission(2).sha256()
        assert "memory" in link.take_mission(mission(4), start=True)
        assert it.robots[MINI].program.obeyed == []
