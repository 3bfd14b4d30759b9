"""A fleet that only talks: robots that report their state, and maybe channels, over one radio.

``python -m benchmarks.station.telemetry_fleet COUNT RATE_HZ CHANNELS`` prints the port of the
station's radio and talks until it is terminated: so often a second each robot tells its state and
one measurement of each of so many channels, which it announces and sends until they are
acknowledged.
"""

import asyncio
import math
import random
import sys
from datetime import UTC, datetime

from autonomy.channel import CHANNELS, OWN_WIRE_NUMBERS
from onboard.link.plan_store import MemoryPlanStore
from onboard.link.robot_link import CommandOutcome, RobotLink
from robot_link.channel_table import ChannelTable, TableRow
from robot_link.clock import SystemClock
from robot_link.messages import CommandKind, LogId, RobotId, RobotMode, StateReport, SystemId
from robot_link.mission import Mission
from robot_link.sample_log import MemorySampleLog
from robot_link.transport.datagram import Address
from simulator.xbee_network import AirConditions, XBeeNetwork

STATION = Address(0x0013A200_40000000)


class Program:
    """An onboard program that takes no orders."""

    def plan_refusal(self) -> str:
        return "this robot only talks"

    def take_plan(self, mission: Mission) -> None:
        del mission

    is_flying = False

    def switch_refusal(self, mission: Mission) -> str:
        del mission
        return "this robot only talks"

    def switch_plan(self, mission: Mission) -> None:
        del mission

    def obey(self, kind: CommandKind, plan_digits: str) -> CommandOutcome:
        del kind, plan_digits
        return CommandOutcome.NOT_NOW


def carried(channels: int) -> ChannelTable:
    """Return what a robot measures: delivered fields first, then a team's own channels."""
    delivered = [one for one in CHANNELS.values() if one.kind == "field" and one.wire_number]
    known = [TableRow(one.wire_number, one.key, one.unit) for one in delivered]
    own = [TableRow(number, f"own_{number}", "V") for number in OWN_WIRE_NUMBERS]
    return ChannelTable.of([*known, *own][:channels])


async def talk(count: int, rate_hz: float, channels: int) -> None:
    network = XBeeNetwork(random.Random(0), AirConditions(delay_s=0.001, jitter_s=0.001))
    async with network.tcp(STATION, "127.0.0.1") as port:
        print(port, flush=True)
        async with asyncio.TaskGroup() as group:
            for number in range(1, count + 1):
                link = RobotLink(
                    SystemId(number),
                    network.robot_radio(Address(STATION + number)),
                    SystemClock(),
                    Program(),
                    log=MemorySampleLog(LogId(1)),
                    plans=MemoryPlanStore(),
                )
                group.create_task(link.run())
                group.create_task(report(link, number, rate_hz, carried(channels)))


async def report(link: RobotLink, number: int, rate_hz: float, table: ChannelTable) -> None:
    await asyncio.sleep(number / 20 / rate_hz)
    link.set_mode(RobotMode.GLIDING)
    if table.rows:
        link.announce(table)
    keys = [row.key if row.key in CHANNELS else f"#{row.number}" for row in table.rows]
    loop = asyncio.get_running_loop()
    due_s = loop.time()
    while True:
        told = state(number, due_s)
        link.report_state(told)
        for key in keys:
            link.record_sample(key, 0.5, told.position_ned, 0.05, told.measured_at)
        due_s += 1.0 / rate_hz
        await asyncio.sleep(max(0.0, due_s - loop.time()))


def state(number: int, at_s: float) -> StateReport:
    now = datetime.now(UTC)
    phase = 0.1 * at_s + number
    return StateReport(
        robot=RobotId(""),
        measured_at=now,
        received_at=now,
        position_ned=(1.0 + 0.9 * math.cos(phase), 0.7 + 0.5 * math.sin(phase), 0.4),
        position_std_m=0.05,
        velocity_ned=(0.05, 0.02, 0.01),
        roll_rad=0.01,
        pitch_rad=-0.3,
        heading_rad=math.remainder(phase, 2 * math.pi),
        net_buoyancy_kg=0.004,
        mass_position_m=0.002,
        tail_rad=0.1,
        battery_fraction=0.8,
        battery_v=11.4,
        mode=RobotMode.GLIDING,
        has_fix=False,
        energy_used=3.0,
    )


if __name__ == "__main__":
    asyncio.run(talk(int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])))
