"""The sound in a robot's water: its own modem, the station's, and the targets that answer."""

import random
from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager

from onboard.node.acoustic import AcousticNode
from robot_link.acoustic.config import AcousticConfig
from robot_link.acoustic.modem_line import ModemTiming
from robot_link.clock import Clock
from robot_link.messages import RobotId
from simulator.acoustic_modem import AcousticModem, Point
from simulator.acoustic_modem import AcousticNode as WaterNode
from simulator.fleet import STATION_ACOUSTIC, STATION_ADDRESS, RobotDefinition
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings

_STATION = RobotId("station")
_STATION_DEPTH_M = 1.0
"""Depth of the station's acoustic modem, below its antenna."""
_TIMING = ModemTiming(spare_s=0.02, quiet_s=0.01)
"""An emulated modem's answer is late by what the computer is; each lost ping costs this much of the
wall, which is much of a fast robot's time."""
_LONGEST_RANGE_M = 1500.0


def acoustic_node(
    settings: SimulatorSettings, definition: RobotDefinition, clock: Clock
) -> AcousticNode:
    """Return the node of a robot's acoustic modem.

    Args:
        settings: Those of the process.
        definition: The robot; it must have such a modem.
        clock: Its clock.

    Raises:
        ValueError: If it has no acoustic modem.
    """
    if definition.acoustic_address is None:
        raise ValueError(f"{definition.robot} has no acoustic modem")
    peers = {target.address: target.id for target in definition.targets}
    if definition.has_station_acoustics:
        peers[STATION_ADDRESS] = _STATION
    conditions = settings.acoustics(definition)
    return AcousticNode(
        settings.device_path(definition.robot, "acoustic"),
        definition.acoustic_address,
        peers,
        clock,
        AcousticConfig(
            sound_speed_m_s=conditions.sound_speed_m_s,
            range_max_m=min(conditions.range_m, _LONGEST_RANGE_M),
            turnaround_s=conditions.turnaround_s,
        ),
        _TIMING,
    )


@asynccontextmanager
async def acoustic_modems(
    settings: SimulatorSettings, definition: RobotDefinition, body: SimulatedBody, truth: Clock
) -> AsyncGenerator[None]:
    """Put the modem of a robot on its line, and the station's where it has one in that water.

    Args:
        settings: Those of the process: where the lines appear, the seed, how bad the water is.
        definition: The robot.
        body: Where it is.
        truth: Sound takes its time, and targets move, by this clock.
    """
    north, east = definition.antenna_ne_m
    conditions = settings.acoustics(definition)

    def modem(name: str, us: Callable[[], Point], nodes: Mapping[int, WaterNode]) -> AcousticModem:
        rng = random.Random(f"{settings.seed} {definition.robot} {name}")
        return AcousticModem(us, nodes, rng, conditions, truth)

    def station_position() -> Point:
        return north, east, _STATION_DEPTH_M

    def robot_position() -> Point:
        return body.plant.position_ned

    ours = definition.acoustic_address or 0
    nodes = {target.address: target.modem(truth) for target in definition.targets}
    robot = modem("robot", robot_position, nodes)
    async with AsyncExitStack() as stack:
        if definition.has_station_acoustics:
            robot_end = WaterNode(
                robot_position, lambda _, word: robot.send_mini(STATION_ADDRESS, word)
            )
            station = modem("station", station_position, {ours: robot_end})
            nodes[STATION_ADDRESS] = WaterNode(
                station_position, lambda _, word: station.send_mini(ours, word)
            )
            line = settings.device_path(definition.robot, STATION_ACOUSTIC)
            await stack.enter_async_context(station.pty(line))
        await stack.enter_async_context(
            robot.pty(settings.device_path(definition.robot, "acoustic"))
        )
        yield
