"""What runs on board of a robot of the fleet, in whichever process: its program, its computer."""

from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from autonomy.control.config import BACKSTEPPING_PRESETS, BacksteppingConfig
from onboard.computer import KEY_FILE, Computer, TimeAt
from onboard.flight.hardware import Hardware
from onboard.flight.water_track import CurrentBelief
from onboard.memory import read_key
from onboard.node.client import NodeClient
from onboard.program import OnboardProgram
from robot_link.clock import Clock
from robot_link.transport.datagram import DatagramTransport
from simulator.fleet import RobotDefinition


def program_of(
    definition: RobotDefinition,
    hardware: Hardware,
    started_at: datetime,
    stamp: Callable[[], datetime] | None = None,
    current: CurrentBelief | None = None,
) -> OnboardProgram:
    """Return a robot's program.

    Args:
        definition: The robot.
        hardware: Its body.
        started_at: Its clock at the beginning.
        stamp: Tells the time by its own clock; by default the steps are counted.
        current: What it learned of the current before; None as when it is switched on.
    """
    vehicle = definition.vehicle
    return OnboardProgram(
        definition.robot,
        vehicle,
        definition.site,
        estimator=definition.estimator,
        controller=BACKSTEPPING_PRESETS.get(vehicle.key, BacksteppingConfig()),
        energy=definition.energy,
        hardware=hardware,
        started_at=started_at,
        stamp=stamp,
        current=current,
    )


def computer_of(
    definition: RobotDefinition,
    program: OnboardProgram,
    *,
    radio: DatagramTransport,
    clock: Clock,
    memory: Path | None,
    satellite: NodeClient | None,
    acoustic: NodeClient | None = None,
    tag_receiver: NodeClient | None = None,
    camera: tuple[NodeClient, TimeAt] | None = None,
) -> Computer:
    """Return a robot's computer; it talks by satellite only with a key in its memory.

    Args:
        definition: The robot.
        program: What flies it.
        radio: Its radio.
        clock: Its clock.
        memory: Folder of what it remembers; None forgets.
        satellite: Its satellite node; None without a modem.
        acoustic: Its acoustic node; None without a modem.
        tag_receiver: The node of its receiver of acoustic tags; None without one.
        camera: The node of its own camera, and what its counts mean; None without one.

    Raises:
        KeyUnreadableError: If the robot's key is none.
    """
    key = None
    if memory is not None:
        with suppress(FileNotFoundError):
            key = read_key(memory / KEY_FILE)
    return Computer(
        definition.robot,
        definition.system_id,
        definition.vehicle,
        definition.site,
        program=program,
        radio=radio,
        clock=clock,
        memory=memory,
        satellite=None if satellite is None or key is None else (satellite, key),
        satellite_config=definition.satellite,
        acoustic=acoustic,
        tag_receiver=tag_receiver,
        camera=camera,
    )
