"""A station that is killed at any moment: nothing is lost, nothing acts twice, nothing is made up.

Each case cuts the station's satellite side at another of its awaited steps, throws away all that
it had in memory, and goes on with what the database has.
"""

import pytest

from db.query.mission.commands import get_command
from db.query.satellite import outbox as outbox_query
from db.query.satellite.satellite_messages import messages_of
from db.store import Store
from robot_link.messages import CommandKind
from server.base.secret import SecretStore
from server.base.settings import Settings
from server.transfer import plan_row
from tests.server.conftest import GRACE
from tests.server.shore import Shore, begin_order, begin_plan
from tests.server.sky import ManualClock, Sky


class KilledError(BaseException):
    """The process is gone."""


class Knife:
    """Kills at one awaited step, before or after it took effect."""

    def __init__(self, step):
        self.left = step
        self.has_cut = False

    async def cut(self, work):
        await self._look()
        found = await work()
        await self._look()
        return found

    async def _look(self):
        self.left -= 1
        if self.left == 0:
            self.has_cut = True
            raise KilledError


class CutStore:
    """A store whose writes the knife may cut."""

    def __init__(self, store, knife):
        self.store, self.knife = store, knife

    async def query(self, function):
        return await self.store.query(function)

    async def write(self, function):
        return await self.knife.cut(lambda: self.store.write(function))


class CutSky:
    """Gateways that the knife may cut off, before or after they took a message."""

    def __init__(self, sky, knife):
        self.sky, self.knife = sky, knife

    async def send(self, *args, **kwargs):
        return await self.knife.cut(lambda: self.sky.send(*args, **kwargs))


@pytest.fixture
def store(tmp_path):
    store = Store.open(Settings(data_dir=tmp_path).resolved_database_url)
    yield store
    store.close()


def check_levels(session, robot, row_id, order_id):
    """Nothing is claimed that the robot's end does not bear out."""
    row = outbox_query.get_outbox(session, row_id)
    ground = plan_row.ground_of(row)
    assert (row.level != "applied") or robot.applied
    assert sum(part.level == "radio" for part in ground.parts) <= robot.fetched
    assert outbox_query.get_outbox(session, order_id).level != "applied" or robot.commands


@pytest.mark.parametrize("step", range(1, 40, 3))
@pytest.mark.parametrize("tells_mtmsn", [False, True])
async def test_station_killed_at_any_step_loses_nothing_and_doubles_nothing(
    store, tmp_path, step, tells_mtmsn
):
    sky = Sky(ManualClock(), tells_mtmsn=tells_mtmsn)
    key = SecretStore(Settings(data_dir=tmp_path).secret_dir).robot_key(GRACE)
    robot = sky.robot(GRACE, 2, key)
    at = sky.clock.now()
    plan = await store.write(lambda session: begin_plan(session, at))
    told = await store.write(lambda session: begin_order(session, at))
    row, order, command = plan.id, told.id, told.command
    sha256 = plan_row.ground_of(plan).plan
    knife = Knife(step)

    def begin(knife):
        return Shore(CutStore(store, knife), CutSky(sky, knife), sky.clock, key)

    process = begin(knife)
    undelivered = []

    async def deliver(message):
        undelivered.append(message)
        while undelivered:
            await process.take(undelivered[0])
            undelivered.pop(0)
        return True

    sky.deliver = deliver
    for _ in range(14):
        try:
            await process.work()
            await process.work()
            await robot.call()
        except KilledError:
            process = begin(Knife(10**6))
            await process.finish()
        await store.query(lambda session: check_levels(session, robot, row, order))
        sky.clock.advance(minutes=20)
    assert knife.has_cut
    assert await process.inbox.unsettled() == []
    assert [mission.sha256() for mission, _ in robot.applied] == [sha256]
    assert [one.kind for one in robot.commands] == [CommandKind.HOLD]
    ended = await store.query(lambda session: outbox_query.get_outbox(session, row))
    assert (ended.state, ended.level) == ("applied", "applied")
    found = await store.query(lambda session: get_command(session, command))
    assert found.level == "applied"
    sent = await store.query(lambda session: messages_of(session, row))
    assert len({(one.data, one.client_id) for one in sent}) == len(sent)
