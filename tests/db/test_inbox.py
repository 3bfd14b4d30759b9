"""When a modem was heard, by what gateways delivered."""

from datetime import timedelta

from sqlalchemy.orm import Session

from db.query.satellite.inbox import add_inbox, newest_session, note_inbox
from db.store import Store
from robot_link.station.gateway.gateway import MobileOriginated
from tests.db.conftest import START

IMEI = "300234010753370"
LATEST = timedelta(days=5)


def _take(session: Session, momsn: int, session_h: float, took: timedelta) -> None:
    at = START + timedelta(hours=session_h)
    message = MobileOriginated(
        "directip", IMEI, momsn, None, at, at + took, bytes([momsn]), None, None, None
    )
    record, _ = add_inbox(session, message, "mini-1")
    note_inbox(session, record.id, is_decoded=True, text="state")


async def test_a_delivery_that_took_too_long_hides_no_earlier_session(store: Store) -> None:
    def take(session: Session) -> None:
        _take(session, 1, 0.0, timedelta(seconds=20))
        _take(session, 2, 1.0, LATEST)
        _take(session, 3, 2.0, LATEST + timedelta(microseconds=1))

    await store.write(take)
    newest = await store.query(lambda session: newest_session(session, IMEI, LATEST))
    assert newest == START + timedelta(hours=1)


async def test_a_modem_that_only_brought_what_took_too_long_was_never_heard(store: Store) -> None:
    await store.write(lambda session: _take(session, 1, 0.0, 2 * LATEST))
    assert await store.query(lambda session: newest_session(session, IMEI, LATEST)) is None
    assert await store.query(lambda session: newest_session(session, "none", LATEST)) is None
