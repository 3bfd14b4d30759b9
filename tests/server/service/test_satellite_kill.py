"""A station that is killed at any moment: nothing is lost, nothing acts twice, nothing is made up.

Each case cuts the station's satellite side at another of its awaited steps, throws away all that
it had in memory, and goes on with what the database has.
"""

import asyncio
from datetime import timedelta

import pytest

from autonomy.planner.plan import Leg, PrimitiveKind
from db.query import outbox as outbox_query
from db.query.commands import add_command, get_command
from db.query.plans import add_plan, change_plan, get_plan
from db.query.satellite_messages import messages_of
from db.query.transfers import add_transfer, get_transfer
from db.store import Store
from robot_link.messages import CommandKind
from robot_link.mission import Mission, MissionSettings
from robot_link.satellite.blob import Blob
from robot_link.satellite.config import Tariff
from server.secret import SecretStore
from server.service.plan_document import mission_of
from server.service.satellite import order_row, plan_row
from server.service.satellite.inbox import Inbox
from server.service.satellite.modem import Modem
from server.service.satellite.outbox import Outbox
from server.service.satellite.preparing import Means
from server.settings import Settings
from tests.server.service.conftest import GRACE
from tests.server.service.sky import IMEI, URI, ManualClock, Sky

MODEM = Modem(GRACE, 2, URI, "rockblock", IMEI)
SETTINGS = MissionSettings(5.0, 30.0, 9000.0, 150.0, 150.0)


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


class Process:
    """The satellite side of a station as long as it lives."""

    def __init__(self, store, sky, key, knife):
        cut = CutStore(store, knife)
        self.told = []
        means = Means(MODEM, key, Tariff())
        self.outbox = Outbox(
            cut, sky.clock, CutSky(sky, knife), lambda _: means, lambda _: None, lambda _: None
        )
        self.inbox = Inbox(cut, sky.clock, self._tell)
        self.key = key

    async def _tell(self, values):
        self.told += values

    async def work(self):
        await self.outbox.step()
        calls = list(self.outbox._calls.values())
        for outcome in await asyncio.gather(*calls, return_exceptions=True):
            if isinstance(outcome, KilledError):
                raise outcome

    async def take(self, message):
        arrival = await self.inbox.take(message, MODEM, self.key)
        if arrival.is_new:
            await self.inbox.settle(message, arrival.values)
        return arrival.is_new

    async def finish(self):
        for record in await self.inbox.unsettled():
            values = await self.inbox.values_again(record, MODEM, self.key)
            await self.inbox.settle(record.message, values)


def long_mission():
    legs, depth = [], 0.0
    for number in range(1, 41):
        to = 0.0 if number == 40 else number * 1.37 % 5
        start, end = (150.0, 150.0, depth), (150.0, 150.0, to)
        speed = 0.05 + number / 1e3
        legs.append(Leg(PrimitiveKind.DIVE, start, end, speed, 60.0, 0.3, 0.0, 0.0, 0.0))
        depth = to
    return Mission.from_legs(SETTINGS, tuple(legs))


def prepare(session, at):
    """Add a plan on its way and an order, as the services do before anything is sent."""
    mission = long_mission()
    plan = add_plan(session, GRACE, "primitives", config={}, at=at, by="test")
    document = {
        "format": mission.format,
        "settings": {name: getattr(mission.settings, name) for name in SETTINGS.__slots__},
        "legs": [{name: getattr(leg, name) for name in leg.__slots__} for leg in mission.legs],
    }
    change_plan(session, plan, at=at, state="draft", sha256=mission.sha256(), document=document)
    record = get_plan(session, plan)
    transfer = get_transfer(
        session, add_transfer(session, plan, GRACE, items=40, size=9, start=False, at=at)
    )
    blob = Blob.of(mission_of(record))
    row = plan_row.begin_plan(
        session, transfer, record, blob, MODEM, at=at, expires_at=at + timedelta(days=4)
    )
    command = add_command(
        session, GRACE, CommandKind.HOLD, at=at, expires_at=at + timedelta(days=1), by="test"
    )
    order = order_row.begin_order(session, command, MODEM, at, is_only=False)
    return row.id, order.id, command.id, mission.sha256()


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
    row, order, command, sha256 = await store.write(lambda session: prepare(session, at))
    knife = Knife(step)
    process = Process(store, sky, key, knife)
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
            process = Process(store, sky, key, Knife(10**6))
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
