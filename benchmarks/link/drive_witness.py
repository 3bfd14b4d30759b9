"""The simulator of one robot, which writes down each set point of its tail as it comes.

``python -m benchmarks.link.drive_witness FOLDER``: the robot's radio is in FOLDER. A line of its
output is the machine's monotonic clock, s, the amplitude and the mean angle of the tail, rad.
"""

import asyncio
import sys
from datetime import UTC, datetime
from pathlib import Path

from onboard.flight.hardware import SetPoints
from robot_link.clock import monotonic_s
from simulator.fleet import MINI_1
from simulator.process import serve
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings


def settings(folder: Path) -> SimulatorSettings:
    """Return those of a simulator at the speed of a person's clock."""
    now = datetime.now(UTC)
    return SimulatorSettings(
        link_folder=folder, wall_anchor=now, time_anchor=now, speed=1.0, robots=(MINI_1.robot,)
    )


def main() -> None:
    actuate = SimulatedBody.actuate

    def witnessed(self: SimulatedBody, command: SetPoints) -> None:
        actuate(self, command)
        told = f"{monotonic_s()!r} {command.tail_amplitude_rad!r} {command.tail_rad!r}"
        print(told, flush=True)

    SimulatedBody.actuate = witnessed
    asyncio.run(serve(settings(Path(sys.argv[1])), asyncio.Event()))


if __name__ == "__main__":
    main()
