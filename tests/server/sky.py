"""Satellites that bring messages at once, lose them on request, and a robot that hears them.

The robot's end is the product's own: its receiver and its records. The gateway keeps one queue a
modem, as a real one does.
"""

import random
from collections import defaultdict
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta

from onboard.satellite.receiver import Complete, MemoryStore, OrderReceived, Receiver
from robot_link.messages import OnboardPlanState, RobotMode, SystemId
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import sizes
from robot_link.satellite.content import (
    MobileOriginatedContent,
    ShortPlanReport,
    waiting_ack,
)
from robot_link.satellite.record import compose
from robot_link.station.gateway.gateway import MobileOriginated, Taken
from tests.server.fake_link import state_report

IMEI = "300234010753370"
URI = f"rockblock://{IMEI}"


class ManualClock:
    """A clock that stands until someone turns it."""

    speed = 1.0

    def __init__(self):
        self.at = datetime.now(UTC).replace(hour=10, minute=0, second=0, microsecond=0)

    def now(self):
        return self.at

    def advance(self, **by):
        self.at += timedelta(**by)


@dataclass
class Queued:
    """One message that a gateway has."""

    data: bytes
    mtmsn: int
    priority: int


@dataclass
class Sky:
    """Gateway and satellites."""

    clock: ManualClock
    loss: float = 0.0
    rng: random.Random = field(default_factory=lambda: random.Random(5))
    tells_mtmsn: bool = False
    refusals: list = field(default_factory=list)
    """What the gateway answers next, in place of taking a message."""
    calls: list = field(default_factory=list)
    """Every call: IMEI, bytes, client id, flush."""
    queues: dict = field(default_factory=lambda: defaultdict(list))
    robots: dict = field(default_factory=dict)
    before_answer: object = None
    """Awaited when the gateway has a message and has not answered yet."""
    taken: int = 0
    momsn: int = 0

    def make_gateways(self, foundation, on_message):
        del foundation
        self.deliver = on_message
        return self

    async def start(self): ...

    async def stop(self): ...

    async def send(self, carrier, imei, data, *, client_id, flush=False, priority=5):
        del carrier
        self.calls.append((imei, data, client_id, flush))
        if self.refusals and (refusal := self.refusals.pop(0)) is not None:
            raise refusal
        queue = self.queues[imei]
        if flush:
            queue.clear()
        self.taken += 1
        mtmsn = self.taken if self.tells_mtmsn else None
        queue.append(Queued(data, self.taken, priority))
        queue.sort(key=lambda one: one.priority)
        if self.before_answer is not None:
            await self.before_answer()
        return Taken(f"mt-{self.taken}", mtmsn, len(queue))

    def robot(self, name, system, key, imei=IMEI):
        """Put a robot under this sky, or return the one that is there."""
        if imei not in self.robots:
            self.robots[imei] = Caller(self, name, SystemId(system), key, imei)
        return self.robots[imei]


class Caller:
    """A robot that calls when it is told to, and speaks of the plan that it holds."""

    def __init__(self, sky, name, system, key, imei):
        self.sky, self.name, self.system, self.key, self.imei = sky, name, system, key, imei
        self.memory = MemoryStore()
        self.receiver = Receiver(self.memory, key, system)
        self.applied = []
        """Every mission that it took, with whether it was to start."""
        self.plan = None
        self.plan_state = OnboardPlanState.NONE
        self.leg = 0
        self.waits = None
        """Mission, whether it starts, and name of its transfer, that waits for a surfacing."""
        self.refuses = ""
        self.commands = []
        self.outcome = CommandOutcome.DONE
        """What it answers to every order."""
        self.samples = ()
        self.position_ned = (150.0, 150.0, 0.0)
        self.mode = RobotMode.IDLE
        self.fetched = 0

    def restart(self):
        self.receiver = Receiver(MemoryStore(self.memory.data), self.key, self.system)
        self.memory = self.receiver._store

    def record(self):
        """Return what it says now."""
        now = self.sky.clock.now()
        content = MobileOriginatedContent(
            counter=self.receiver.next_counter(),
            state=state_report(self.name, self.position_ned, at=now, mode=self.mode),
            plan=self._plan(),
            acks=self._acks(),
            answers=self.receiver.answers(),
            samples=tuple(self.samples),
        )
        return compose(content, self.key, self.system, 340)

    def message(self, data=None, mtmsn=None, **changes):
        """Return what the gateway makes of its next message."""
        self.sky.momsn += 1
        now = self.sky.clock.now()
        data = self.record() if data is None else data
        made = MobileOriginated(
            "rockblock", self.imei, self.sky.momsn, mtmsn, now, now, data, None, None, None
        )
        return replace(made, **changes)

    async def call(self, sessions=1):
        """Call ashore: say how it is, fetch one message; lost either way as the sky has it."""
        for _ in range(sessions):
            queue = self.sky.queues[self.imei]
            queued = queue.pop(0) if queue else None
            said = self.message(mtmsn=queued.mtmsn if queued and self.sky.tells_mtmsn else None)
            if queued is not None and self.sky.rng.random() >= self.sky.loss:
                self.hear(queued.data)
            if self.sky.rng.random() >= self.sky.loss:
                await self.sky.deliver(said)
            self.sky.clock.advance(minutes=2)

    def hear(self, data):
        self.fetched += 1
        match self.receiver.take(data, self.sky.clock.now()):
            case Complete(mission, start, transfer_id):
                if self.refuses:
                    self.receiver.refused(transfer_id, self.refuses)
                    return
                if self.plan_state is OnboardPlanState.RUNNING:
                    self.waits = (mission, start, transfer_id)
                    return
                self.applied.append((mission, start))
                self.plan = mission
                self.plan_state = OnboardPlanState.RUNNING if start else OnboardPlanState.ON_BOARD
                self.receiver.applied(transfer_id)
            case OrderReceived(command):
                self.commands.append(command)
                self.receiver.answered(command, self.outcome)

    def change_over(self):
        """Begin the plan that waits, at a surfacing."""
        mission, start, transfer_id = self.waits
        self.waits, self.plan = None, mission
        self.applied.append((mission, start))
        self.receiver.applied(transfer_id)

    def _acks(self):
        """Return its words on missions, as the program on board says them."""
        if self.waits is None:
            return self.receiver.acks()
        mission, start, transfer_id = self.waits
        count = len(sizes(Blob.of(mission)))
        others = (one for one in self.receiver.acks() if one.transfer_id != transfer_id)
        return (waiting_ack(transfer_id, count, starts=start), *others)

    def _plan(self):
        digits = "" if self.plan is None else self.plan.sha256()[:16]
        legs = 0 if self.plan is None else len(self.plan.legs)
        return ShortPlanReport(digits, self.plan_state, self.leg, legs, 0.0)
