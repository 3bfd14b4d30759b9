"""The station's side of every service: telemetry, commands, mission upload, acknowledgement."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime

from robot_link.clock import Clock
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    LinkEvent,
    LinkReport,
    LogId,
    PlanHash,
    RobotId,
    SystemId,
    UploadReport,
)
from robot_link.mission import Mission
from robot_link.transport.datagram import Address, DatagramTransport


class UploadUnderWayError(Exception):
    """Another upload to the same robot has not ended yet."""


@dataclass(frozen=True, slots=True)
class RobotEndpoint:
    """Where a robot is to be found."""

    system: SystemId
    uri: str
    """The transport that reaches it."""
    address: Address | None = None
    """Its radio; None binds the first radio that speaks under its system id."""


class StationLink:
    """Talks to all robots and tells ``on_event`` what it learns; belongs to one event loop.

    ``on_event`` is called on the loop for every event in order and must return at once. Nothing
    here is persistent: after a restart, the owner sends unfinished commands again under the same
    number and expiry, and uploads the plan again; the robot recognizes both.
    """

    def __init__(
        self,
        transports: Mapping[str, DatagramTransport],
        robots: Mapping[RobotId, RobotEndpoint],
        clock: Clock,
        on_event: Callable[[LinkEvent], None],
    ) -> None:
        raise NotImplementedError

    async def run(self) -> None:
        """Serve until cancelled; ports that close are opened again by themselves."""
        raise NotImplementedError

    async def upload(self, robot: RobotId, mission: Mission) -> UploadReport:
        """Put a mission on board; progress travels as ``UploadReport`` events.

        Returns:
            The last report: ON_BOARD after the robot echoed the hash, REFUSED with the robot's
            reason, or FAILED when it did not answer. The same mission again is answered at once.

        Raises:
            UploadUnderWayError: If another upload to this robot has not ended.
            KeyError: If no such robot is known.
        """
        raise NotImplementedError

    def cancel_upload(self, robot: RobotId, reason: str) -> None:
        """End an upload under way as FAILED; without one, do nothing."""
        raise NotImplementedError

    def send_command(
        self,
        robot: RobotId,
        kind: CommandKind,
        number: CommandNumber,
        expires: datetime,
        plan: PlanHash | None = None,
    ) -> None:
        """Take a command for a robot; its levels travel as ``CommandReport`` events.

        It is sent at once, and again at each contact, until the robot answers or it expires.
        Commands to one robot go one after another; SURFACE drops all earlier ones as EXPIRED and
        ends an upload under way.

        Args:
            robot: Whom to tell.
            kind: What to tell.
            number: The station's number; with ``expires`` it names the command to the robot,
                which acts once however often it hears it.
            expires: Time of the clock after which the command is never sent.
            plan: The plan that START means.

        Raises:
            KeyError: If no such robot is known.
        """
        raise NotImplementedError

    def acknowledge_samples(self, robot: RobotId, log: LogId, sequences: Iterable[int]) -> None:
        """Tell a robot that these samples are stored; call it after the commit, repeats too.

        A sample that was acknowledged and arrives again is acknowledged again and not told;
        one that arrives twice before its acknowledgement is told twice.
        """
        raise NotImplementedError

    def link_report(self, robot: RobotId) -> LinkReport:
        """Return what is known of the road to a robot now."""
        raise NotImplementedError
