"""The simulator's process: robots that live by the shared clock, behind emulated radios."""

import asyncio
import logging
import os
import random
import signal
from contextlib import AsyncExitStack, suppress

from robot_link.clock import Clock
from robot_link.messages import LogId
from robot_link.onboard import RobotLink
from robot_link.plan_store import MemoryPlanStore
from robot_link.sample_log import MemorySampleLog
from simulator.fleet import FLEET, RobotDefinition
from simulator.onboard.program import PERIOD_S
from simulator.robot import SimulatedRobot
from simulator.settings import SimulatorSettings
from simulator.xbee_network import XBeeNetwork

_STATE_INTERVAL_S = 0.1
"""Wall time between two state reports of a robot whose clock is not fast."""
_STATE_GAP_S = 1.0
"""Time between two state reports by the robot's own clock, at most: a record of a flight that
leaves out more is of no use to learn a vehicle from."""
_SLEEP_MIN_S = 0.02
"""The radio needs about as long to take a report before the next one replaces it."""
_STEPS_AT_ONCE = 50
"""Steps of one robot before the event loop gets its turn: some ten milliseconds."""
_CATCHING_UP_SLEEP_S = 0.001
_PARENT_CHECK_S = 1.0

_log = logging.getLogger(__name__)


def run(settings: SimulatorSettings) -> None:
    """Simulate until SIGTERM or SIGINT, or until the parent process is gone.

    Raises:
        ExceptionGroup: If a robot or a link failed; nothing is left running then either.
    """
    asyncio.run(_serve_until_told(settings))


async def _serve_until_told(settings: SimulatorSettings) -> None:
    stopped = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, stopped.set)
    await serve(settings, stopped)


async def serve(settings: SimulatorSettings, stopped: asyncio.Event) -> None:
    """Simulate on this event loop until ``stopped`` is set, or the parent process is gone.

    Raises:
        ExceptionGroup: If a robot or a link failed.
    """
    async with AsyncExitStack() as links, asyncio.TaskGroup() as group:
        tasks: list[asyncio.Task[None]] = []
        if settings.parent_pid is not None:
            watch = _watch(settings.parent_pid, stopped)
            tasks.append(group.create_task(watch, name="parent watch"))
        for name in settings.robots:
            definition = FLEET[name]
            robot, link = await _build(settings, definition, links)
            life = _live(robot, link, settings.clock())
            tasks.append(group.create_task(link.run(), name=f"{definition.robot} link"))
            tasks.append(group.create_task(life, name=f"{definition.robot} life"))
        _log.info("simulating %s at speed %g", ", ".join(settings.robots), settings.speed)
        await stopped.wait()
        for task in tasks:
            task.cancel()
    _log.info("simulation ended")


async def _build(
    settings: SimulatorSettings, definition: RobotDefinition, links: AsyncExitStack
) -> tuple[SimulatedRobot, RobotLink]:
    """Put a robot into its water, and its station's radio on a pseudo-terminal."""
    clock = settings.clock()
    started_at = clock.now()
    robot = SimulatedRobot(definition, settings.seed, started_at, settings.conditions())
    network = XBeeNetwork(
        random.Random(f"{settings.seed} {definition.robot}"),
        settings.air(),
        lambda _from, _to: robot.is_in_reach,
    )
    await links.enter_async_context(
        network.pty(definition.station_address, settings.link_path(definition.robot))
    )
    link = RobotLink(
        definition.system_id,
        network.robot_radio(definition.radio_address),
        clock,
        robot.program,
        log=MemorySampleLog(LogId(int(started_at.timestamp()))),
        plans=MemoryPlanStore(),
    )
    return robot, link


async def _live(robot: SimulatedRobot, link: RobotLink, clock: Clock) -> None:
    """Let a robot live by the clock, sleeping in between."""
    at_speed_s = max(_STATE_GAP_S, 2.0 * _SLEEP_MIN_S * clock.speed)
    interval_s = min(_STATE_INTERVAL_S * clock.speed, at_speed_s)
    reported_s = robot.program.time_s
    while True:
        lag_s = (clock.now() - robot.program.now).total_seconds()
        steps = int(lag_s / PERIOD_S)
        is_late = steps > _STEPS_AT_ONCE
        due_s = reported_s + (at_speed_s if is_late else interval_s) - 0.5 * PERIOD_S
        has_reported = False
        for _ in range(min(steps, _STEPS_AT_ONCE)):
            robot.step(link)
            if robot.program.time_s >= due_s:
                reported_s = robot.program.time_s
                link.report_state(robot.program.state_report())
                has_reported = True
                break
        if is_late:
            await asyncio.sleep(_SLEEP_MIN_S if has_reported else _CATCHING_UP_SLEEP_S)
        else:
            await asyncio.sleep(max(PERIOD_S / clock.speed, _SLEEP_MIN_S))


async def _watch(parent_pid: int, stopped: asyncio.Event) -> None:
    """Stop when a process is gone, or is no longer the parent that it was."""
    was_parent = os.getppid() == parent_pid
    while _is_alive(parent_pid) and (not was_parent or os.getppid() == parent_pid):
        with suppress(TimeoutError):
            async with asyncio.timeout(_PARENT_CHECK_S):
                await stopped.wait()
                return
    _log.warning("process %d is gone: the simulation ends", parent_pid)
    stopped.set()


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
