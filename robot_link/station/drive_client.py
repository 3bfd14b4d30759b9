"""Driving a robot by hand, the station's end: the newest stick goes out, the answer comes back."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from robot_link.clock import monotonic_s
from robot_link.drive import DriveReport, Stick
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.drive import SEQUENCE_BYTE, drive_report, stick_message
from robot_link.mavlink.wire import grace
from robot_link.station.command_client import CommandClient, StandardCommand
from robot_link.station.peer import Peer

_REMEMBERED: Final = 64
"""Sticks whose answer may still come; older ones of the same number are not meant."""
_BEGIN, _END = 1.0, 0.0


@dataclass(frozen=True, slots=True)
class DriveAnswer:
    """What a robot answered to a stick."""

    report: DriveReport
    tag: int
    """What the sender called the stick that is answered."""
    round_trip_s: float
    """Since that stick was given to the radio, by the station's clock."""


class DriveClient:
    """Sends sticks to one robot; on one event loop.

    A robot of ours answers each stick that it takes; vehicles of other makers do not answer.

    Args:
        peer: The robot.
        commands: Its standard commands.
        has_throttle: Whether it takes the vertical axis as a throttle (other makers' vehicles).
    """

    def __init__(self, peer: Peer, commands: CommandClient, *, has_throttle: bool) -> None:
        self._peer = peer
        self._commands = commands
        self._has_throttle = has_throttle
        self._sent: dict[int, tuple[int, float]] = {}
        """Tag and time of the sticks that were sent, by the number of their frame, oldest first."""
        self.on_answer: Callable[[DriveAnswer], None] = lambda _: None
        """Called with each answer, on the loop."""

    async def begin(self) -> None:
        """Have the robot listen to sticks from now on; of another maker's vehicle: arm it.

        Raises:
            NoAnswerError: If it does not answer.
            ServiceRefusedError: If it refuses.
        """
        self._sent.clear()
        await self._commands.send(StandardCommand(grace.MAV_CMD_COMPONENT_ARM_DISARM, (_BEGIN,)))

    async def end(self) -> None:
        """Have the robot listen to sticks no more; of another maker's vehicle: disarm it.

        Raises:
            NoAnswerError: If it does not answer; one of ours ends it by itself all the same.
            ServiceRefusedError: If it refuses.
        """
        await self._commands.send(StandardCommand(grace.MAV_CMD_COMPONENT_ARM_DISARM, (_END,)))

    async def steer(self, stick: Stick, tag: int) -> None:
        """Send where the stick is, once, and return when the radio is free for the next one.

        Args:
            stick: Where it is.
            tag: What its answer is to be told by.
        """
        message = stick_message(self._peer.system, stick, has_throttle=self._has_throttle)
        await self._peer.say_once(message, lambda frame: self._note(frame, tag))

    def hear(self, message: WireMessage) -> None:
        """Take what the robot says."""
        if not isinstance(message, grace.MAVLink_grace_drive_message):
            return
        try:
            report = drive_report(message, self._peer.robot, self._peer.clock.now())
        except ValueError:
            return
        found = self._sent.pop(report.sequence, None)
        if found is not None:
            tag, sent_s = found
            self.on_answer(DriveAnswer(report, tag, monotonic_s() - sent_s))

    def _note(self, frame: bytes, tag: int) -> None:
        number = frame[SEQUENCE_BYTE]
        self._sent.pop(number, None)
        self._sent[number] = (tag, monotonic_s())
        if len(self._sent) > _REMEMBERED:
            del self._sent[next(iter(self._sent))]
