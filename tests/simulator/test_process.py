"""The simulator behind its radios: the wire, the process, and how it ends."""

import asyncio
import math
import signal
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest

from autonomy.planner.plan import Leg
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    OnboardPlanState,
    PlanReport,
    RobotMode,
    Sample,
    StateReport,
)
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.transport.opening import open_transport
from simulator.fleet import FLEET, GRACE_1, MINI_1, USUAL_ROBOTS
from simulator.process import serve
from simulator.robot import SimulatedRobot
from simulator.settings import SimulatorSettings
from tests.robot_link.rig import Heard, running, soon, until
from tests.simulator.flight import mission, vee

SPEED = 20.0


def settings(folder: Path, **changes) -> SimulatorSettings:
    now = datetime.now(UTC)
    return SimulatorSettings(
        link_folder=folder, wall_anchor=now, time_anchor=now, speed=SPEED, **changes
    )


@asynccontextmanager
async def simulation(chosen: SimulatorSettings) -> AsyncIterator[None]:
    stopped = asyncio.Event()
    async with asyncio.TaskGroup() as group:
        task = group.create_task(serve(chosen, stopped))
        await until(lambda: task.done() or all(path.exists() for path in links(chosen)))
        yield
        stopped.set()
    assert not any(path.is_symlink() for path in links(chosen))


def links(chosen: SimulatorSettings) -> list[Path]:
    return [chosen.link_path(robot) for robot in USUAL_ROBOTS]


@asynccontextmanager
async def station(chosen: SimulatorSettings) -> AsyncIterator[tuple[StationLink, Heard]]:
    uris = {robot: f"xbee://{chosen.link_path(robot)}" for robot in USUAL_ROBOTS}
    heard = Heard()
    link = StationLink(
        {uri: open_transport(uri) for uri in uris.values()},
        {
            robot: RobotEndpoint(
                definition.system_id, (RadioPath(uris[robot], definition.radio_address),)
            )
            for robot, definition in FLEET.items()
            if robot in USUAL_ROBOTS
        },
        chosen.clock(),
        heard,
    )
    heard.station = link
    async with running(link.run):
        yield link, heard


async def test_a_robot_with_its_own_camera_says_by_radio_that_a_camera_fixed_it(tmp_path):
    chosen = settings(tmp_path, memory_folder=tmp_path / "memory", has_own_cameras=True)
    chosen = chosen.model_copy(update={"speed": 4.0})

    def fixed(heard):
        mine = [report for report in heard.of(StateReport) if report.robot == MINI_1.robot]
        return [report for report in mine if report.has_fix and report.is_by_cameras]

    async with simulation(chosen), station(chosen) as (_, heard):
        await until(lambda: fixed(heard))
    assert math.dist(fixed(heard)[0].position_ned[:2], MINI_1.start_ne_m) < 0.5
    assert (tmp_path / "memory" / MINI_1.robot / "camera.json").exists()


async def test_plan_travels_is_flown_and_its_samples_arrive(tmp_path):
    chosen = settings(tmp_path)
    plan = mission(*vee())
    async with simulation(chosen), station(chosen) as (link, heard):
        await until(lambda: {report.robot for report in heard.of(StateReport)} == set(USUAL_ROBOTS))
        report = await link.upload(MINI_1.robot, plan)
        assert report.state is OnboardPlanState.ON_BOARD
        link.send_command(
            MINI_1.robot, CommandKind.START, CommandNumber(1), soon(3600.0), plan.sha256()
        )
        await until(
            lambda: any(
                report.state is OnboardPlanState.DONE and report.sha256 == plan.sha256()
                for report in heard.of(PlanReport)
            ),
        )
        await until(lambda: min(counted(heard, "blue_light", "temperature")) > 15)
        await until(lambda: max(sample.position_ned[2] for sample in heard.of(Sample)) > 0.4)
    samples = heard.of(Sample)
    assert {sample.variable for sample in samples} == {"blue_light", "temperature"}
    assert {sample.robot for sample in samples} == {MINI_1.robot}
    assert RobotMode.GLIDING in {report.mode for report in heard.of(StateReport)}


def counted(heard, *channels) -> list[int]:
    """Return how many samples of each channel were heard."""
    return [sum(sample.variable == key for sample in heard.of(Sample)) for key in channels]


def dives(count: int) -> tuple[Leg, ...]:
    """Out and back again, many times: it goes on while a busy machine looks elsewhere."""
    legs = vee()
    for n in range(1, count):
        legs += vee(legs[-1].end_ned[:2], 0.4 + math.pi * (n % 2))
    return legs


async def test_surface_now_reaches_a_diving_robot(tmp_path):
    chosen = settings(tmp_path)
    plan = mission(*dives(12))
    async with simulation(chosen), station(chosen) as (link, heard):
        await link.upload(MINI_1.robot, plan)
        link.send_command(
            MINI_1.robot, CommandKind.START, CommandNumber(1), soon(3600.0), plan.sha256()
        )
        await until(lambda: any(report.position_ned[2] > 0.2 for report in heard.of(StateReport)))
        link.send_command(MINI_1.robot, CommandKind.SURFACE, CommandNumber(2), soon(3600.0))
        await until(
            lambda: any(
                report.number == 2 and report.level is CommandLevel.APPLIED
                for report in heard.of(CommandReport)
            )
        )

        def ended():
            reports = heard.of(PlanReport)
            return [one for one in reports if one.state is OnboardPlanState.FAILED]

        await until(ended)
        assert ended()[0].reason == "surfaced by command"


async def test_states_of_a_fast_robot_come_once_a_second_of_its_own_clock(tmp_path):
    chosen = settings(tmp_path).model_copy(update={"speed": 10.0})

    def moments(heard: Heard) -> list[datetime]:
        states = heard.of(StateReport)
        return [report.measured_at for report in states if report.robot == MINI_1.robot]

    async with simulation(chosen), station(chosen) as (_, heard):
        await until(lambda: len(moments(heard)) > 25)
    gaps_s = [(b - a).total_seconds() for a, b in pairwise(moments(heard)[10:])]
    assert 0.9 < median(gaps_s) < 2.5


def test_robot_under_water_is_out_of_reach_in_the_lake_only():
    for definition, is_heard in ((MINI_1, True), (GRACE_1, False)):
        robot = SimulatedRobot(definition, 0, datetime.now(UTC))
        assert robot.is_in_reach
        robot.body.plant.state[2] = 0.5
        assert robot.is_in_reach is is_heard


def spawn(chosen: SimulatorSettings) -> subprocess.Popen:
    code = (
        "import sys; from simulator.process import run;"
        "from simulator.settings import SimulatorSettings;"
        "run(SimulatorSettings.model_validate_json(sys.argv[1]))"
    )
    return subprocess.Popen([sys.executable, "-c", code, chosen.model_dump_json()])


def idle_process() -> subprocess.Popen:
    return subprocess.Popen(["sleep", "600"])


@pytest.mark.process
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_signal_ends_the_process_cleanly(tmp_path, number):
    chosen = settings(tmp_path)
    process = spawn(chosen)
    try:
        await until(lambda: all(path.exists() for path in links(chosen)))
        process.send_signal(number)
        assert process.wait(timeout=60.0) == 0
    finally:
        process.kill()
        process.wait()
    assert not any(path.is_symlink() for path in links(chosen))


@pytest.mark.process
async def test_process_ends_when_its_parent_is_gone(tmp_path):
    parent = idle_process()
    chosen = settings(tmp_path, parent_pid=parent.pid)
    process = spawn(chosen)
    try:
        await until(lambda: all(path.exists() for path in links(chosen)))
        assert process.poll() is None
        parent.kill()
        parent.wait()
        assert process.wait(timeout=60.0) == 0
    finally:
        for each in (parent, process):
            each.kill()
            each.wait()
    assert not any(path.is_symlink() for path in links(chosen))


@pytest.mark.process
async def test_samples_that_a_killed_robot_had_not_brought_ashore_come_after_it_lives_again(
    tmp_path,
):
    chosen = settings(tmp_path, memory_folder=tmp_path / "memory")
    plan = mission(*vee())
    async with killed_afterwards(chosen), station(chosen) as (link, heard):
        heard.stores = False
        await until(lambda: bool(heard.of(StateReport)))
        await link.upload(MINI_1.robot, plan)
        order = (CommandKind.START, CommandNumber(1), soon(3600.0), plan.sha256())
        link.send_command(MINI_1.robot, *order)
        await until(lambda: len(names(heard)) >= 8)
        taken = names(heard)
    async with killed_afterwards(chosen), station(chosen) as (_, after):
        await until(lambda: taken <= names(after))
    assert {log for log, _ in names(after)} == {log for log, _ in taken}


@asynccontextmanager
async def killed_afterwards(chosen: SimulatorSettings) -> AsyncIterator[None]:
    process = spawn(chosen)
    try:
        await until(lambda: all(path.exists() for path in links(chosen)))
        yield
    finally:
        process.kill()
        process.wait()
        for path in links(chosen):
            path.unlink(missing_ok=True)


def names(heard: Heard) -> set[tuple[int, int]]:
    return {(sample.log, sample.sequence) for sample in heard.of(Sample)}


def test_settings_file_is_refused_with_the_name_of_the_wrong_field(tmp_path):
    text = settings(tmp_path).model_dump_json().replace('"speed":20.0', '"speed":-1.0')
    with pytest.raises(ValueError, match="speed"):
        SimulatorSettings.model_validate_json(text)
