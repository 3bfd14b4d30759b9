"""The satellite side of a station on a database of its own, without the station around it."""

import asyncio
from datetime import timedelta

from autonomy.planner.plan import Leg, PrimitiveKind
from db.query.mission.commands import add_command
from db.query.mission.plans import add_plan, change_plan, get_plan
from db.query.mission.transfers import add_transfer, get_transfer
from robot_link.messages import CommandKind
from robot_link.mission import Mission, MissionSettings
from robot_link.satellite.blob import Blob
from robot_link.satellite.config import Tariff
from server.command.satellite_row import CommandRows, add_row
from server.plan.document import mission_of
from server.satellite.inbox import Inbox
from server.satellite.modem import Modem
from server.satellite.outbox import Outbox
from server.satellite.row_kind import Means, RowKinds
from server.transfer import plan_row
from server.transfer.plan_row import PlanRows
from server.transfer.withdrawal_row import WithdrawalRows, begin_withdrawal
from tests.server.conftest import GRACE
from tests.server.sky import IMEI, URI

MODEM = Modem(GRACE, 2, URI, "rockblock", IMEI)
SETTINGS = MissionSettings(5.0, 30.0, 9000.0, 150.0, 150.0)


class Shore:
    """The satellite side of a station as long as it lives."""

    def __init__(self, store, sender, clock, key, tariff=None):
        self.told = []
        means = Means(MODEM, key, tariff or Tariff())
        kinds = RowKinds(CommandRows(), PlanRows(begin_withdrawal), WithdrawalRows())
        self.outbox = Outbox(store, clock, sender, kinds, lambda _: means, lambda _: None)
        self.inbox = Inbox(store, clock, kinds, self._tell)
        self.key = key

    async def _tell(self, values):
        self.told += values

    async def work(self):
        """Do what is due; raise what ended a call of a gateway."""
        await self.outbox.step()
        calls = list(self.outbox._calls.values())
        for outcome in await asyncio.gather(*calls, return_exceptions=True):
            if isinstance(outcome, BaseException):
                raise outcome

    async def take(self, message):
        arrival = await self.inbox.take(message, MODEM, self.key)
        if arrival.is_new:
            await self.inbox.settle(message, arrival.values)
        return arrival.is_new

    async def finish(self):
        """Do what a station does first when it starts."""
        for record in await self.inbox.unsettled():
            values = await self.inbox.values_again(record, MODEM, self.key)
            await self.inbox.settle(record.message, values)


def long_mission(count=40):
    """Return a mission that needs two messages, with fewer legs another."""
    legs, depth = [], 0.0
    for number in range(1, count + 1):
        to = 0.0 if number == count else number * 1.37 % 5
        start, end = (150.0, 150.0, depth), (150.0, 150.0, to)
        speed = 0.05 + number / 1e3
        legs.append(Leg(PrimitiveKind.DIVE, start, end, speed, 60.0, 0.3, 0.0, 0.0, 0.0))
        depth = to
    return Mission.from_legs(SETTINGS, tuple(legs))


def begin_plan(session, at, legs=40):
    """Add a plan on its way, as the services do before anything is sent; return its row."""
    mission = long_mission(legs)
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
    return plan_row.begin_plan(
        session, transfer, record, blob, MODEM, at=at, expires_at=at + timedelta(days=4)
    )


def begin_order(session, at, kind=CommandKind.HOLD, *, is_only=False):
    """Add an order on its way; return its row."""
    command = add_command(session, GRACE, kind, at=at, expires_at=at + timedelta(days=1), by="test")
    return add_row(session, command, MODEM, is_only=is_only)
