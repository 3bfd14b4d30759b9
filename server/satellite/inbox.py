"""The way in: a message is a row, with everything that it proves, before its gateway is answered.

What the robot acknowledges is written down in the transaction of its message. Its telemetry goes
the way that radio's goes; a message counts as settled once that is stored too, and one that is not
settled when the station starts is told again, which changes nothing that was stored.
"""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, replace

from sqlalchemy.orm import Session

from db.ingest import append_telemetry
from db.query.mission.plans import plan_by_hash
from db.query.satellite import inbox as query
from db.query.satellite.inbox import InboxRecord
from db.query.satellite.outbox import OutboxRecord, get_outbox, open_outbox
from db.query.satellite.satellite_messages import message_of_mtmsn
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import PlanHash, RawFrame
from robot_link.report import SatelliteReport
from robot_link.station.gateway.gateway import MobileOriginated
from server.fleet.words import carrier_title
from server.satellite.content import FindPlan, Reading, read, values_of
from server.satellite.hearing import LATEST_DELIVERY
from server.satellite.message_row import fetched
from server.satellite.modem import Modem
from server.satellite.row_kind import RobotSession, RowKinds


@dataclass(frozen=True, slots=True)
class Arrival:
    """What one delivery amounted to."""

    is_new: bool
    reading: Reading
    changed: tuple[OutboxRecord, ...]
    """Rows of the outbox about which it proved something."""
    values: Sequence[SatelliteReport]


class Inbox:
    """Takes messages of robots. Belongs to one event loop.

    Args:
        store: Where the rows are.
        clock: The robots' clock.
        kinds: What the rows mean about which a message proves something.
        tell: Takes what a message tells; returns once that is stored.
    """

    def __init__(
        self,
        store: Store,
        clock: Clock,
        kinds: RowKinds,
        tell: Callable[[Sequence[SatelliteReport]], Awaitable[None]],
    ) -> None:
        self._store = store
        self._clock = clock
        self._kinds = kinds
        self._tell = tell

    async def take(self, message: MobileOriginated, modem: Modem | None, key: bytes) -> Arrival:
        """Keep a message and what it proves; return after the commit.

        Args:
            message: As a gateway delivered it.
            modem: Whose it is; ``None`` for a modem of no robot here.
            key: The robot's key.

        Raises:
            StoreUnavailableError: Nothing was kept; the gateway must deliver it again.
        """
        reading = _read(message, modem, key)
        return await self._store.write(lambda s: _keep(s, self._kinds, message, modem, reading))

    async def settle(self, message: MobileOriginated, values: Sequence[SatelliteReport]) -> None:
        """Pass on what a message tells, then write down that it is done with."""
        await self._tell(values)
        at = self._clock.now()

        def write(session: Session) -> None:
            for record in query.unsettled_inbox(session):
                if _is_same(record.message, message):
                    query.settle_inbox(session, record.id, at)

        await self._store.write(write)

    async def unsettled(self) -> list[InboxRecord]:
        """Return the messages that the station had not done with when it stopped."""
        return await self._store.query(query.unsettled_inbox)

    async def values_again(
        self, record: InboxRecord, modem: Modem, key: bytes
    ) -> Sequence[SatelliteReport]:
        """Return what a stored message tells."""
        reading = _read(record.message, modem, key)
        return await self._store.query(
            lambda session: _values(session, self._kinds, record.message, modem, reading)
        )


def _read(message: MobileOriginated, modem: Modem | None, key: bytes) -> Reading:
    if modem is None:
        text = f"No robot has the modem {message.imei}."
        return Reading(None, text, text)
    return read(message, key, modem.system, modem.robot)


def _keep(
    session: Session,
    kinds: RowKinds,
    message: MobileOriginated,
    modem: Modem | None,
    reading: Reading,
) -> Arrival:
    record, is_new = query.add_inbox(session, message, None if modem is None else modem.robot)
    if not is_new:
        return Arrival(is_new=False, reading=reading, changed=(), values=())
    append_telemetry(session, [_journaled(message, modem, reading)])
    if record.is_said_again:
        text = "the same bytes were heard before, in another session; they prove nothing again"
        reading = Reading(None, text, f"{text[0].upper()}{text[1:]}.")
    query.note_inbox(session, record.id, is_decoded=not reading.fault, text=reading.text)
    if modem is None:
        return Arrival(is_new=True, reading=reading, changed=(), values=())
    if reading.fault:
        _flag(session, message, modem, reading)
        query.settle_inbox(session, record.id, message.arrived_at)
        return Arrival(is_new=True, reading=reading, changed=(), values=())
    changed = _prove(session, kinds, message, modem, reading)
    values = _values(session, kinds, message, modem, reading)
    return Arrival(is_new=True, reading=reading, changed=tuple(changed), values=values)


def _journaled(message: MobileOriginated, modem: Modem | None, reading: Reading) -> RawFrame:
    """Return the message as the raw journal keeps it."""
    state = None if reading.content is None else reading.content.state
    return RawFrame(
        robot=None if modem is None else modem.robot,
        carrier=message.carrier,
        outgoing=False,
        data=message.data,
        at=message.arrived_at,
        robot_at=None if state is None else state.measured_at,
        arrived_at=message.session_at,
    )


def _prove(
    session: Session, kinds: RowKinds, message: MobileOriginated, modem: Modem, reading: Reading
) -> list[OutboxRecord]:
    """Write down what a session proves of what is on its way to the robot."""
    content, at = reading.content, message.session_at
    brought = None
    if message.mtmsn:
        brought = message_of_mtmsn(session, message.imei, message.mtmsn, at - LATEST_DELIVERY)
    said = RobotSession(
        acks=() if content is None else tuple(content.acks),
        answers=() if content is None else tuple(content.answers),
        plan=None if content is None else content.plan,
        mtmsn=None,
        session_at=at,
        arrived_at=message.arrived_at,
    )
    changed: dict[str, OutboxRecord] = {}
    for row in open_outbox(session, modem.robot):
        is_of_row = brought is not None and brought.outbox == row.id
        told = replace(said, mtmsn=message.mtmsn) if is_of_row else said
        changed[row.id] = kinds.of(row).heard(session, row, told)
    if brought is not None:
        fetched(session, brought, at)
        row = get_outbox(session, brought.outbox)
        changed[row.id] = kinds.of(row).fetched(session, row, at)
    return list(changed.values())


def _values(
    session: Session, kinds: RowKinds, message: MobileOriginated, modem: Modem, reading: Reading
) -> Sequence[SatelliteReport]:
    if reading.content is None:
        return ()
    find: FindPlan = lambda digits: _plan(session, modem, digits)  # noqa: E731 - names its type
    return values_of(
        reading.content,
        modem.robot,
        message.session_at,
        message.arrived_at,
        find,
        lambda name: kinds.plan_of(session, modem.robot, name),
    )


def _plan(session: Session, modem: Modem, digits: str) -> PlanHash | None:
    found = plan_by_hash(session, modem.robot, digits)
    return None if found is None or found.sha256 is None else PlanHash(found.sha256)


def _flag(session: Session, message: MobileOriginated, modem: Modem, reading: Reading) -> None:
    add_event(
        session,
        message.arrived_at,
        "satellite.undecoded",
        f"A message of {modem.robot} by {carrier_title(message.carrier)} "
        f"(MOMSN {message.momsn}) was not understood: {reading.fault}. Its bytes are kept.",
        level="watch",
        robot=modem.robot,
        data={"momsn": message.momsn, "imei": message.imei},
    )


def _is_same(one: MobileOriginated, other: MobileOriginated) -> bool:
    return (one.imei, one.momsn, one.session_at, one.data) == (
        other.imei,
        other.momsn,
        other.session_at,
        other.data,
    )
