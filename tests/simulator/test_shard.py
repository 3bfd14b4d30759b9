"""Robots in several processes: one desk, one satellite network, and one that dies."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

import pytest

from onboard.node.client import NodeClient
from onboard.node.wire import NodeAddress
from robot_link.messages import StateReport
from simulator.background import alongside
from simulator.fault_desk import FAULTS, FaultDesk
from simulator.fleet import GRACE_1, MINI_1, USUAL_ROBOTS, robots_named
from simulator.process import satellites, serve
from simulator.settings import SimulatorSettings
from simulator.shard import ROBOTS_IN_ONE, dealt, modems, processes_of, shards_of
from tests.robot_link.rig import until
from tests.simulator.test_process import links, station

SPEED = 20.0


def settings(folder: Path, **changes) -> SimulatorSettings:
    now = datetime.now(UTC)
    return SimulatorSettings(
        link_folder=folder, wall_anchor=now, time_anchor=now, speed=SPEED, **changes
    )


def test_a_few_robots_live_in_one_process_and_many_in_as_many_as_there_are_cores(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    few = settings(tmp_path, robots=robots_named([f"mini-1..{ROBOTS_IN_ONE}"]))
    assert dealt(few) == (few.robots, [])
    many = settings(tmp_path, robots=robots_named(["mini-1..25", "grace-1..25"]))
    here, away = dealt(many)
    assert here == ()
    assert [len(robots) for robots in away] == [13, 13, 12, 12]
    assert sorted(robot for robots in away for robot in robots) == sorted(many.robots)
    assert processes_of(settings(tmp_path, processes=3)) == len(USUAL_ROBOTS)


def test_robots_before_cameras_live_where_these_are(tmp_path):
    robots = robots_named(["mini-1..9", "grace-1..3"])
    here, away = dealt(settings(tmp_path, robots=robots, cameras=2, processes=2))
    assert here == robots_named(["mini-1..9"])
    assert sorted(robot for group in away for robot in group) == ["grace-1", "grace-2", "grace-3"]


@pytest.mark.process
async def test_robots_of_two_processes_are_heard_and_one_that_is_killed_lives_again(tmp_path):
    chosen = settings(tmp_path, processes=2)
    async with simulated(chosen) as desk, station(chosen) as (_, heard):
        await until(lambda: {report.robot for report in heard.of(StateReport)} == set(USUAL_ROBOTS))
        await desk.ask("cause", robot="grace-1", fault="leak", by="ann")
        mini, _ = [child for child in children() if child]
        os.kill(mini, signal.SIGKILL)
        known = len(heard.of(StateReport))
        await until(lambda: mini not in children() and len(children()) == 2)
        await until(
            lambda: {report.robot for report in heard.of(StateReport)[known:]} == set(USUAL_ROBOTS)
        )
    assert children() == []


@pytest.mark.process
async def test_a_robot_of_another_process_calls_by_satellite(tmp_path):
    memory = tmp_path / "memory" / GRACE_1.robot
    memory.mkdir(parents=True)
    (memory / "robot.key").write_text(os.urandom(32).hex())
    chosen = settings(tmp_path, robots=(GRACE_1.robot,), memory_folder=tmp_path / "memory")
    [shard] = shards_of(chosen, [(GRACE_1.robot,)])
    desk = FaultDesk(chosen.clock())
    calls = []
    network = satellites(chosen, lambda imei: imei in shard.sky and shard.sky[imei].in_view)
    network.on_message("rockblock", calls.append)
    async with modems([shard], chosen, network), alongside(shard.live(desk), "shard"):
        await until(lambda: calls)
    assert calls[0].imei == GRACE_1.imei
    site = GRACE_1.site
    assert calls[0].latitude_deg == pytest.approx(site.origin_latitude_deg, abs=0.05)


def children() -> list[int]:
    """Return the shards of this process, in the order of their robots."""
    text = Path(f"/proc/self/task/{os.getpid()}/children").read_text()
    return [int(one) for one in text.split() if b"shard_process" in command_of(one)]


def command_of(process: str) -> bytes:
    with suppress(FileNotFoundError, ProcessLookupError):  # it was reaped just now
        return Path(f"/proc/{process}/cmdline").read_bytes()
    return b""


@asynccontextmanager
async def simulated(chosen: SimulatorSettings) -> AsyncIterator[NodeClient]:
    """Run a simulation; give its fault desk, which knows every robot by then."""
    stopped, opened = asyncio.Event(), asyncio.Queue[NodeAddress]()
    async with asyncio.TaskGroup() as group:
        group.create_task(serve(chosen, stopped, opened=opened.put_nowait))
        client = NodeClient(await opened.get())
        heard = client.subscribe(FAULTS)
        async with AsyncExitStack() as stack:
            await stack.enter_async_context(alongside(client.run(), "client of the desk"))
            while set((await heard.get())["robots"]) != {MINI_1.robot, GRACE_1.robot}:
                pass
            await until(lambda: all(path.exists() for path in links(chosen)))
            yield client
        stopped.set()
