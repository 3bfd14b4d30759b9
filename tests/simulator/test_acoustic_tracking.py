"""A tag that is followed by its acoustic ranges, from the water to the station."""

import asyncio
import math
from datetime import timedelta
from statistics import median

from autonomy.tracking.config import TRACKING_PRESETS
from autonomy.tracking.phase import TargetPhase
from robot_link.messages import CommandKind, CommandNumber, OnboardPlanState, StateReport
from robot_link.mission import Mission, MissionSettings
from robot_link.report import TargetReport
from robot_link.station.link import StationLink
from robot_link.target_settings import TargetSettings
from simulator.fleet import MINI_1
from simulator.process import serve
from simulator.target import TANK_TARGETS
from tests.robot_link.rig import Heard, running, until
from tests.simulator.test_robot_process import bodies, station_of, with_program

(TAG,) = TANK_TARGETS
NOISE_M = MINI_1.acoustics.travel_time_std_s * MINI_1.acoustics.sound_speed_m_s
PRESET = TRACKING_PRESETS["miniglider"]
FOLLOW = PRESET.model_copy(
    update={
        "target": PRESET.target.model_copy(
            update={
                "kind": "tag",
                "address": TAG.address,
                "depth_m": TAG.depth_m,
                "north_m": 1.4,
                "east_m": 0.7,
            }
        )
    }
)
PLAN = Mission.for_target(
    MissionSettings(5.0, 50.0, 900.0, *MINI_1.start_ne_m), TargetSettings.of(FOLLOW)
)


async def follow(link: StationLink, heard: Heard, expires) -> None:
    """Send the robot after the tag, silence it, let it ping again, and call it back."""
    numbers = iter(range(1, 9))

    def tell(kind: CommandKind, plan=None) -> None:
        link.send_command(MINI_1.robot, kind, CommandNumber(next(numbers)), expires, plan)

    def newest() -> TargetReport:
        return heard.of(TargetReport)[-1]

    await until(lambda: heard.of(StateReport))
    report = await link.upload(MINI_1.robot, PLAN)
    assert report.state is OnboardPlanState.ON_BOARD
    assert not heard.of(TargetReport)
    tell(CommandKind.START, PLAN.sha256())
    await until(lambda: heard.of(TargetReport) and newest().ranges_heard >= 15)
    await until(lambda: newest().phase is TargetPhase.TRACKING)
    check_ranges(heard)
    tell(CommandKind.QUIET)
    await until(lambda: newest().is_quiet)
    silent = newest().ranges_heard
    reports = len(heard.of(TargetReport))
    await until(lambda: len(heard.of(TargetReport)) > reports + 5)
    assert newest().ranges_heard == silent
    tell(CommandKind.PING)
    await until(lambda: newest().ranges_heard > silent + 2)
    assert not newest().is_quiet
    tell(CommandKind.SURFACE)
    await until(lambda: newest().phase is TargetPhase.ENDED)


def check_ranges(heard: Heard) -> None:
    """Hold the ranges that were reported against where robot and tag were.

    Not every one: the age of a range is worse known the longer the machine kept its answer.
    """
    errors_m = []
    for report in heard.of(TargetReport):
        assert report.true_ne_m is None
        if report.range_m is not None:
            at = report.measured_at - timedelta(seconds=report.range_age_s)
            true_m = math.dist(report.position_ne_m, TAG.place_ned_m(at)[:2])
            errors_m.append(abs(report.range_m - true_m))
    assert median(errors_m) < 5.0 * NOISE_M + 0.2


async def test_robot_follows_the_tag_of_its_water_and_says_so(tmp_path):
    chosen = bodies(tmp_path / "links", MINI_1.robot).model_copy(update={"has_programs": True})
    chosen.link_folder.mkdir()
    ended = asyncio.Event()
    async with asyncio.TaskGroup() as group:
        task = group.create_task(serve(chosen, ended))
        await until(lambda: task.done() or chosen.link_path(MINI_1.robot).exists())
        link, heard = station_of(chosen, MINI_1)
        try:
            async with running(link.run):
                await follow(link, heard, chosen.clock().now() + timedelta(hours=1))
        finally:
            ended.set()


async def test_program_in_a_process_of_its_own_pings_by_its_acoustic_node(tmp_path):
    chosen = bodies(tmp_path / "links", MINI_1.robot)
    chosen.link_folder.mkdir()

    async def work(link: StationLink, heard: Heard) -> None:
        await until(lambda: heard.of(StateReport))
        await link.upload(MINI_1.robot, PLAN)
        expires = chosen.clock().now() + timedelta(hours=1)
        number = CommandNumber(1)
        link.send_command(MINI_1.robot, CommandKind.START, number, expires, PLAN.sha256())
        await until(
            lambda: any(
                one.ranges_heard >= 10 and one.phase is TargetPhase.TRACKING
                for one in heard.of(TargetReport)
            )
        )

    await with_program(chosen, MINI_1, tmp_path / "memory", work)
