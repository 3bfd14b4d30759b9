"""Plans that were given up do not come alive, whatever gateways still hold and the sky loses."""

import pytest

from db.query.mission.commands import get_command
from db.query.satellite import outbox as query
from db.query.satellite.satellite_messages import credits_spent, messages_of
from db.store import Store
from robot_link.messages import CommandKind, CommandLevel
from robot_link.station.gateway.gateway import GatewayFault, GatewayRefusal, GatewayUnreachableError
from server.base.secret import SecretStore
from server.base.settings import Settings
from server.command import state
from server.satellite.budget import utc_day
from server.transfer.state import end_by_satellite
from server.transfer.withdrawal_row import called_back
from tests.server.conftest import GRACE
from tests.server.shore import Shore, begin_order, begin_plan
from tests.server.sky import IMEI, ManualClock, Sky


class Given:
    """A station's satellite side, its sky and its robot, on one clock."""

    def __init__(self, store, key):
        self.store, self.sky = store, Sky(ManualClock())
        self.clock = self.sky.clock
        self.robot = self.sky.robot(GRACE, 2, key)
        self.shore = Shore(store, self.sky, self.clock, key)
        self.sky.deliver = self.shore.take

    async def write(self, function, *args, **kwargs):
        at = self.clock.now()
        return await self.store.write(lambda session: function(session, *args, at, **kwargs))

    async def work(self):
        for _ in range(3):
            await self.shore.work()

    async def call(self):
        self.clock.advance(minutes=20)
        await self.robot.call()
        await self.work()

    async def withdraw(self, plan, state="withdrawn"):
        def write(session, at):
            end_by_satellite(session, plan.transfer, state, "it was", at, calls_back=True)

        await self.write(write)

    async def row(self, kind):
        return await self.store.query(lambda session: query.newest_outbox(session, GRACE, kind))

    async def said(self, plan):
        return await self.store.query(lambda session: called_back(session, plan))

    async def states(self, row):
        found = await self.store.query(lambda session: messages_of(session, row.id))
        return [one.state for one in found]


@pytest.fixture
def given(tmp_path):
    store = Store.open(Settings(data_dir=tmp_path).resolved_database_url)
    yield Given(store, SecretStore(Settings(data_dir=tmp_path).secret_dir).robot_key(GRACE))
    store.close()


async def test_lost_word_that_withdraws_is_said_again_until_the_robot_answers(given):
    plan = await given.write(begin_plan)
    await given.work()
    given.robot.hear(given.sky.queues[IMEI].pop(0).data)
    await given.withdraw(plan)
    await given.work()
    assert given.sky.calls[-1][3], "it empties the queue"
    assert "has not been heard to have it" in await given.said(plan)
    given.sky.queues[IMEI].clear()
    await given.call()
    await given.call()
    assert len(given.sky.calls) == 4, "said again"
    assert not given.sky.calls[-1][3], "the queue may hold something newer by now"
    await given.call()
    await given.call()
    row = await given.row("withdrawal")
    assert (row.state, row.level) == ("applied", "applied")
    assert await given.said(plan) == "grace-1 refuses what is left of it."
    for call in given.sky.calls:
        given.robot.hear(call[1])
    assert given.robot.applied == []


async def test_robot_that_has_nothing_to_answer_is_told_three_times(given):
    plan = await given.write(begin_plan)
    await given.work()
    await given.withdraw(plan)
    await given.work()
    for _ in range(10):
        await given.call()
    row = await given.row("withdrawal")
    assert (row.state, row.level) == ("sent", "queued")
    assert len(given.sky.calls) == 2 + 3
    assert "had nothing to answer" in await given.said(plan)


async def test_plan_that_expired_is_called_back(given):
    plan = await given.write(begin_plan)
    await given.work()
    left = list(given.sky.queues[IMEI])
    given.clock.advance(hours=97)
    await given.work()
    assert (await given.row("plan")).state == "expired"
    given.robot.hear(given.sky.calls[-1][1])
    for message in left:
        given.robot.hear(message.data)
    assert given.robot.applied == []
    assert await given.said(plan)


async def test_plan_of_which_nothing_left_is_not_called_back(given):
    plan = await given.write(begin_plan)
    await given.withdraw(plan)
    await given.work()
    assert given.sky.calls == []
    assert await given.row("withdrawal") is None
    assert await given.said(plan) == ""


async def test_plan_withdrawn_while_the_gateway_is_being_called_is_called_back(given):
    plan = await given.write(begin_plan)

    async def withdraw():
        given.sky.before_answer = None
        await given.withdraw(plan)

    given.sky.before_answer = withdraw
    await given.work()
    assert await given.states(plan) == ["taken", "dropped"]
    assert (await given.row("withdrawal")).level == "queued"


async def test_older_plan_is_called_back_when_the_one_in_its_place_never_left(given):
    older = await given.write(begin_plan)
    await given.work()

    def supersede(session, at):
        end_by_satellite(session, older.transfer, "superseded", "newer", at, calls_back=False)
        return begin_plan(session, at, 30)

    newer = await given.write(supersede)
    await given.withdraw(newer)
    await given.work()
    assert await given.states(newer) == []
    given.robot.hear(given.sky.calls[-1][1])
    for call in given.sky.calls[:2]:
        given.robot.hear(call[1])
    assert given.robot.applied == []


async def test_order_that_went_ahead_is_not_thrown_away_with_the_plan(given):
    plan = await given.write(begin_plan)
    await given.work()
    await given.withdraw(plan)
    given.sky.refusals = [GatewayUnreachableError("no answer.")]
    await given.work()
    await given.write(begin_order, kind=CommandKind.HOLD)
    await given.work()
    given.clock.advance(minutes=11)
    await given.work()
    flushes = [call[3] for call in given.sky.calls]
    assert flushes[:3] == [False, False, True]
    assert True not in flushes[3:], "the order may be in the queue by now"
    assert len(flushes) == 6, "it is sent again: the first call may have come late, and emptied it"
    for _ in range(6):
        await given.call()
    assert [one.kind for one in given.robot.commands] == [CommandKind.HOLD]


async def test_order_that_met_an_emptied_queue_is_sent_again(given):
    plan = await given.write(begin_plan)
    await given.work()
    await given.withdraw(plan)

    async def overtake():
        given.sky.before_answer = None
        await given.write(begin_order, kind=CommandKind.SURFACE)
        await given.shore.outbox.step()
        await given.shore.outbox._calls[max(given.shore.outbox._calls)]
        given.sky.queues[IMEI].clear()

    given.sky.before_answer = overtake
    await given.work()
    await given.work()
    order = await given.row("order")
    assert await given.states(order) == ["taken", "taken"]
    await given.call()
    assert [one.kind for one in given.robot.commands] == [CommandKind.SURFACE]


async def test_order_that_radio_settled_is_neither_sent_nor_counted(given):
    given.sky.refusals = [GatewayRefusal(GatewayFault.QUEUE_FULL, "it is full.", "later")]
    order = await given.write(begin_order)
    await given.work()

    def settle(session, at):
        state.apply(session, order.command, CommandLevel.APPLIED, at=at, carrier="xbee")

    await given.write(settle)
    given.clock.advance(minutes=11)
    await given.work()
    assert len(given.sky.calls) == 1
    assert await given.states(order) == ["unknown"]


async def test_repetition_that_the_gateway_refuses_leaves_the_order_to_its_answer(given):
    order = await given.write(begin_order, is_only=True)
    await given.work()
    first = given.sky.queues[IMEI].pop(0)
    given.sky.refusals = [GatewayRefusal(GatewayFault.NO_CREDIT, "no credit.")] * 9
    for _ in range(5):
        await given.call()
    assert len(given.sky.calls) == 2
    given.robot.hear(first.data)
    await given.call()
    found = await given.store.query(lambda session: get_command(session, order.command))
    assert found.level == "applied"


async def test_message_that_may_have_been_taken_before_it_was_refused_is_charged(given):
    given.sky.refusals = [
        GatewayUnreachableError("no answer."),
        GatewayRefusal(GatewayFault.NO_CREDIT, "no credit."),
    ]
    order = await given.write(begin_order)
    await given.work()
    given.clock.advance(minutes=11)
    await given.work()
    assert await given.states(order) == ["unknown"]
    day = utc_day(given.clock.now())
    spent = await given.store.query(lambda session: credits_spent(session, GRACE, *day))
    assert spent == 1


async def test_message_counts_on_the_day_on_which_its_gateway_took_it(given):
    given.sky.refusals = [GatewayUnreachableError("no answer.")]
    await given.write(begin_order)
    await given.work()
    first = utc_day(given.clock.now())
    given.clock.advance(hours=15)
    await given.work()
    second = utc_day(given.clock.now())

    def spent(session):
        return [credits_spent(session, GRACE, *day) for day in (first, second)]

    assert await given.store.query(spent) == [0, 1]
