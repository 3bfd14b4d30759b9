"""The fleet follows what others write into the database, and nothing that robots alone say."""

from datetime import UTC, datetime

from db.query.station.events import add_event
from server.link.moments import CONTACT, DIVE_BEGUN, DIVE_ENDED, SURFACED
from tests.server.conftest import GRACE, MINI, until


async def test_fleet_is_read_anew_when_somebody_changed_a_robot_and_not_when_it_dives(
    station, monkeypatch
):
    read: list[str] = []

    async def note(robot):
        read.append(robot)

    monkeypatch.setattr(station.roster, "refresh", note)

    def write(session):
        for kind in (CONTACT, DIVE_BEGUN, DIVE_ENDED, SURFACED):
            add_event(session, datetime.now(UTC), kind, "It said so.", robot=MINI)
        add_event(session, datetime.now(UTC), "robot.changed", "Ada changed it.", robot=GRACE)

    await station.foundation.store.write(write)
    await until(lambda: read)
    assert read == [GRACE]
