"""What the outbox asks of whoever sends something by satellite, by the kind of its rows.

Satellite knows bytes, budgets and gateways. What a row means, such as a plan or a command, is known
to the capability that added it; that registers its kind here before the station starts.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from db.query.satellite.outbox import OutboxRecord
from db.query.satellite.satellite_messages import SatelliteMessage
from robot_link.messages import PlanHash
from robot_link.satellite.blob import TransferId
from robot_link.satellite.config import Tariff
from robot_link.satellite.content import CommandAnswer, ShortPlanReport, TransferAck
from server.satellite.ending import end_row
from server.satellite.modem import Modem

FIRST_PRIORITY = 1
"""Of messages that wait for nothing."""
LAST_PRIORITY = 5


@dataclass(frozen=True, slots=True)
class Means:
    """What sending to one robot takes."""

    modem: Modem
    key: bytes
    tariff: Tariff
    ack_seen: bool = False
    """Whether the robot need not repeat its word on anything from before."""


@dataclass(frozen=True, slots=True)
class RobotSession:
    """What one session of a robot says of what is on its way to it."""

    acks: Sequence[TransferAck]
    answers: Sequence[CommandAnswer]
    plan: ShortPlanReport | None
    mtmsn: int | None
    """Number of a message of this row that the modem fetched; ``None`` if it fetched none."""
    session_at: datetime
    """By the satellite network's clock."""
    arrived_at: datetime


class RowKind(ABC):
    """Rows of one kind. Every method runs in the transaction of what it is told of."""

    name: str
    """As the outbox stores it."""

    @abstractmethod
    def due(self, session: Session, row: OutboxRecord, now: datetime) -> tuple[int, ...]:
        """Return the parts that are to be sent now, but for those that are being sent."""

    @abstractmethod
    def pack(self, session: Session, row: OutboxRecord, means: Means) -> Sequence[bytes]:
        """Return the message of each part."""

    @abstractmethod
    def title(self, row: OutboxRecord, part: int) -> str:
        """Return what a message is, for a sentence."""

    @abstractmethod
    def taken(
        self, session: Session, row: OutboxRecord, message: SatelliteMessage, at: datetime
    ) -> OutboxRecord:
        """Note that the gateway has a message of an open row."""

    def refused(
        self, session: Session, row: OutboxRecord, reason: str, at: datetime
    ) -> OutboxRecord:
        """End an open row of which the gateway will never take a message."""
        return end_row(session, row.id, "refused", reason, at)

    @abstractmethod
    def expired(self, session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
        """End an open row whose time has passed."""

    @abstractmethod
    def heard(self, session: Session, row: OutboxRecord, said: RobotSession) -> OutboxRecord:
        """Note a session of the robot, and what it says of an open row."""

    def fetched(self, session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
        """Note that the robot's modem fetched a message of a row, which may have ended."""
        del session, at
        return row

    def thrown_away(self, session: Session, row: OutboxRecord) -> None:
        """Note that the gateway's queue was emptied while an open row may have been in it."""
        del session, row

    def priority(self, row: OutboxRecord) -> int:
        """Return the priority at the gateway."""
        del row
        return LAST_PRIORITY

    def is_urgent(self, row: OutboxRecord) -> bool:
        """Tell whether neither silence of the robot nor another message holds a row up."""
        del row
        return False

    def is_exempt(self, row: OutboxRecord) -> bool:
        """Tell whether no budget holds a row back: it keeps a robot at the surface."""
        return self.is_urgent(row)

    def is_held(self, row: OutboxRecord, part: int) -> bool:
        """Tell whether the robot says that it has a part."""
        del row, part
        return False

    def is_told(self, row: OutboxRecord) -> bool:
        """Tell whether the robot need not repeat its word on a row."""
        return row.ended_at is not None

    def plan_of(self, session: Session, robot: str, transfer_id: TransferId) -> PlanHash | None:
        """Return the hash of the plan that a robot calls by this name, ``None`` if none is."""
        del session, robot, transfer_id

    def fault_of(self, row: OutboxRecord) -> str:
        """Return what the operator calls a row that was refused or expired; "" to say nothing."""
        del row
        return ""


class RowKinds:
    """The kinds of rows that were registered."""

    def __init__(self, *kinds: RowKind) -> None:
        self._kinds = {kind.name: kind for kind in kinds}

    def register(self, kind: RowKind) -> None:
        """Take up a kind; what is registered last is spoken of first."""
        self._kinds[kind.name] = kind

    def of(self, row: OutboxRecord) -> RowKind:
        """Return the kind of a row.

        Raises:
            KeyError: If nobody registered it.
        """
        return self._kinds[row.kind]

    def plan_of(self, session: Session, robot: str, transfer_id: TransferId) -> PlanHash | None:
        """Return the hash of the plan that a robot calls by this name, ``None`` if none is."""
        found = (kind.plan_of(session, robot, transfer_id) for kind in self._kinds.values())
        return next((one for one in found if one is not None), None)

    @property
    def names(self) -> Sequence[str]:
        """The registered kinds, the last first."""
        return [*self._kinds][::-1]
