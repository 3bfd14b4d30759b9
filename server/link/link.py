"""What the services ask of the links to the robots."""

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Protocol

from sqlalchemy.orm import Session

from db.query.commands import CommandRecord
from db.query.outbox import OutboxRecord
from db.query.plans import PlanRecord
from db.query.transfers import TransferRecord
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    LogId,
    PlanHash,
    RobotId,
    UploadReport,
)
from robot_link.mission import Mission
from server.fleet.routing import LinkChoice, MessageKind, RequestedLink


class Radio(Protocol):
    """The part of ``robot_link.station.link.StationLink`` that services use; see there."""

    async def upload(self, robot: RobotId, mission: Mission) -> UploadReport:
        """Put a mission on board; return the last report."""
        ...

    def cancel_upload(self, robot: RobotId, reason: str) -> None:
        """End an upload under way as FAILED."""
        ...

    def send_command(
        self,
        robot: RobotId,
        kind: CommandKind,
        number: CommandNumber,
        expires: datetime,
        plan: PlanHash | None = None,
    ) -> None:
        """Send a command until it is answered or expires."""
        ...

    def acknowledge_samples(self, robot: RobotId, log: LogId, sequences: Iterable[int]) -> None:
        """Tell a robot that these samples are stored."""
        ...


class SatelliteLink(Protocol):
    """The part of ``server.satellite.Satellite`` that services use; see there."""

    @property
    def waits(self) -> Mapping[str, str]:
        """Why rows of the outbox are not sent on, by their ids."""
        ...

    def choice(
        self, robot: str, kind: MessageKind, requested: RequestedLink = "auto"
    ) -> LinkChoice:
        """Choose the links of a message to a robot."""
        ...

    def obstacle(self, robot: str) -> str:
        """Return why nothing may be sent to a robot unless its operator insists, or ""."""
        ...

    def order_in(self, session: Session, command: CommandRecord, *, is_only: bool) -> None:
        """Add the rows of an order to the satellite links of its robot, with the order itself."""
        ...

    def surface_unwritten(self, robot: str, number: CommandNumber, expires: datetime) -> None:
        """Send an order to surface that could not be written down."""
        ...

    async def begin(self, transfer: TransferRecord, plan: PlanRecord) -> OutboxRecord | None:
        """Begin or go on to send a plan; ``None`` if the robot has no link for it."""
        ...

    def row_of(self, transfer: str) -> OutboxRecord | None:
        """Return how far a transfer is; ``None`` if it was never to go by satellite."""
        ...

    async def hold(self, transfer: str) -> None:
        """Send nothing more of a transfer while radio is tried."""
        ...

    def stir(self) -> None:
        """Look at once for what is to be sent."""
        ...
