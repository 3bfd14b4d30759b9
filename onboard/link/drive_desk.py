"""Who may drive the robot by hand, and what it answers to each stick."""

from functools import partial
from typing import Final

from onboard.link.newest_sender import NewestSender
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.drive import drive_message, received_stick
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.robot_program import CommandOutcome, RobotProgram
from robot_link.transport.datagram import Address

Driver = tuple[SystemId, int, Address]
"""A ground station: system, component, and the radio that it speaks by."""
DRIVE: Final = grace.MAV_CMD_COMPONENT_ARM_DISARM
"""Begins (1) and ends (0) driving by hand; ground stations of other makers have a button for it."""
_BEGIN, _END = 1.0, 0.0


def driver_of(message: WireMessage, address: Address) -> Driver:
    """Return who speaks."""
    return SystemId(message.get_srcSystem()), message.get_srcComponent(), address


class DriveDesk:
    """Lets one ground station drive: the one that began it, until that ends.

    Nobody drives by a stick alone: whoever wants to must begin first, and a stick of anybody else
    moves nothing. Anybody whom the robot serves may end it.

    Args:
        system: The robot's system id.
        program: What flies it.
        answers: Sends the newest answer to a stick when the radio has room.
    """

    def __init__(self, system: SystemId, program: RobotProgram, answers: NewestSender) -> None:
        self._system = system
        self._program = program
        self._answers = answers
        self._driver: Driver | None = None

    def command(self, wanted: float, driver: Driver, refusal: str) -> int:
        """Begin or end driving; return the MAV_RESULT.

        Args:
            wanted: First parameter of ``DRIVE``.
            driver: Who asks.
            refusal: Why this ground station may change nothing now; "" if it may.
        """
        if wanted == _END:
            self._program.end_drive()
            self._driver = None
            return grace.MAV_RESULT_ACCEPTED
        if wanted != _BEGIN:
            return grace.MAV_RESULT_DENIED
        is_another = self._driver not in (None, driver) and self._is_driven
        if refusal or is_another:
            return grace.MAV_RESULT_DENIED
        if self._program.begin_drive() is not CommandOutcome.DONE:
            return grace.MAV_RESULT_TEMPORARILY_REJECTED
        self._driver = driver
        return grace.MAV_RESULT_ACCEPTED

    def hear(self, message: grace.MAVLink_manual_control_message, driver: Driver) -> None:
        """Take a stick, and answer it.

        Raises:
            ValueError: If it is no stick's place.
        """
        if message.target != self._system or driver != self._driver:
            return
        self._program.steer(received_stick(message))
        sequence = message.get_seq()
        self._answers.put(partial(self._answer, sequence))

    @property
    def _is_driven(self) -> bool:
        return self._program.drive_report(0).is_driven

    def _answer(self, sequence: int) -> WireMessage:
        return drive_message(self._program.drive_report(sequence))
