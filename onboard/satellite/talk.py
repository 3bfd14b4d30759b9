"""The robot's talk by satellite: it calls, says what fits one record, and takes what waits.

A call is up to eight sessions: the first carries the full record (state, plan, answers, and the
samples that change the map most), the next ones fetch what waits still, the last says what came
of it. The device is behind the satellite node; which one it is makes no difference here.
"""

import asyncio
import logging
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Protocol

from onboard.link.plan_store import PlanStore, WaitingPlan
from onboard.node.satellite import SatelliteClient, SessionOutcome
from onboard.node.wire import NodeError, NodeGoneError, NodeSilentError
from onboard.satellite.policy import SESSIONS_MAX, CallLimits, CallPolicy, Situation
from onboard.satellite.receiver import Complete, Nothing, OrderReceived, Receiver
from onboard.satellite.record import (
    PLAN_DIGITS,
    PlanTeller,
    RecordWriter,
    StateTeller,
)
from robot_link.clock import Clock
from robot_link.mavlink.command import ReceivedCommand
from robot_link.messages import (
    OnboardPlanState,
    PlanHash,
    RobotId,
    SystemId,
)
from robot_link.mission import Mission
from robot_link.robot_program import CommandOutcome
from robot_link.sample_log import SampleLog
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import sizes
from robot_link.satellite.content import waiting_ack
from robot_link.satellite.record import (
    CommandAnswer,
    TransferAck,
    TransferState,
)

_TICK_S = 0.05
"""Wall time between two looks at the situation."""
_RADIO_WALL_S = 3.0
"""The station's radio is heard once a second of the wall, however fast the robot lives."""
_OVERTAKEN = "withdrawn: a plan came by radio meanwhile"
_DROPPED = "withdrawn: it waits no longer"
_FLOWN = (OnboardPlanState.RUNNING, OnboardPlanState.DONE, OnboardPlanState.FAILED)

_log = logging.getLogger(__name__)


class Carried(PlanTeller, Protocol):
    """What the robot's link offers to the links beside its radio; a ``RobotLink``."""

    @property
    def last_heard_station_s(self) -> float:
        """Seconds of the wall since the station was heard; infinite before the first time."""
        ...

    @property
    def plan_hash(self) -> PlanHash | None:
        """Hash of the plan on board."""
        ...

    @property
    def waiting_plan(self) -> WaitingPlan | None:
        """The plan that waits behind the one on board."""
        ...

    def take_mission(self, mission: Mission, *, start: bool, may_wait: bool = False) -> str:
        """Put a mission on board, or let it wait; return why it was refused, or ""."""
        ...

    def take_command(self, command: ReceivedCommand) -> CommandOutcome:
        """Act on a command; one heard by several links acts once."""
        ...


class Aboard(StateTeller, Protocol):
    """What the talk asks of the onboard program."""

    is_talking: bool
    """Set while a call is due or under way: the robot then stays up."""

    @property
    def time_s(self) -> float:
        """Seconds since the program began."""
        ...

    @property
    def surfaced_s(self) -> float:
        """How long the robot has been at the surface; 0 under water."""
        ...


@dataclass(slots=True)
class TalkSettings:
    """What the operator may change while the robot talks, as its parameters."""

    limits: CallLimits
    record_bytes: int
    """Most bytes of one record."""
    health_s: float = 3600.0
    """Least time between two records that tell the robot's own condition; with 0 none tells that,
    nor the channels, which older stations do not understand."""


class SatelliteTalk:
    """Runs the calls of one robot; belongs to one event loop.

    Args:
        robot: Its name.
        system: Its MAVLink system id.
        key: Its key.
        client: Its satellite node.
        receiver: What it remembers of chunks and orders.
        link: Where missions and commands go.
        program: What flies it.
        samples: What it measured.
        clock: Its clock.
        settings: What the operator allows.
        plans: The plan on board.
        was_flown: Tells whether the plan on board of this hash was started already, before the
            robot was switched off, too.
        note: Writes a sentence into the robot's log.
    """

    def __init__(
        self,
        robot: RobotId,
        system: SystemId,
        key: bytes,
        *,
        client: SatelliteClient,
        receiver: Receiver,
        link: Carried,
        program: Aboard,
        samples: SampleLog,
        clock: Clock,
        settings: TalkSettings,
        plans: PlanStore,
        was_flown: Callable[[PlanHash], bool],
        note: Callable[[str], None] = _log.info,
    ) -> None:
        self._robot = robot
        self._records = RecordWriter(
            robot, system, key, link, program, samples, clock, lambda: settings.health_s
        )
        self._client = client
        self._rings = client.rings()
        self._receiver = receiver
        self._link = link
        self._program = program
        self._clock = clock
        self._settings = settings
        self._plans = plans
        self._was_flown = was_flown
        self._on_board = link.plan_hash
        self._waiting = link.waiting_plan
        self._note = note
        self._policy = CallPolicy(settings.limits)
        self._has_rung = False
        self._told: frozenset[TransferAck | CommandAnswer] = frozenset()
        self.sessions = 0
        """Sessions since the program began."""
        self.refused = 0
        """Messages that were none for this robot."""

    async def run(self) -> None:
        """Call whenever a call is due, until cancelled."""
        self._resume()
        listening = asyncio.create_task(self._listen(), name=f"{self._robot} rings")
        try:
            while True:
                self._make_way()
                now = self._situation()
                self._policy = replace(self._policy, limits=self._limits())
                self._program.is_talking = self._policy.is_awaited(now)
                if self._policy.is_due(now):
                    await self._call()
                await asyncio.sleep(_TICK_S)
        finally:
            self._program.is_talking = False
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)

    def _resume(self) -> None:
        """Put on board what was complete when the robot was switched off."""
        with self._disk_may_refuse():
            if pending := self._receiver.pending(self._link.plan_hash):
                self._apply(pending)

    def _follow_waiting(self) -> None:
        """Say the last word on a mission that waited and does so no longer.

        Either it came on board, or an order to surface or another plan took it away.
        """
        waiting = self._link.waiting_plan
        if waiting == self._waiting:
            return
        before, self._waiting = self._waiting, waiting
        if before is None or (waiting is not None and waiting.mission == before.mission):
            return
        gone = Blob.of(before.mission).transfer_id
        if all(ack.transfer_id != gone for ack in self._receiver.acks()):
            return
        with self._disk_may_refuse():
            if self._link.plan_hash == before.mission.sha256():
                self._receiver.applied(gone)
            else:
                self._receiver.refused(gone, _DROPPED)

    def _make_way(self) -> None:
        """Give up the mission that is coming in where the radio brought another plan."""
        self._follow_waiting()
        on_board = self._link.plan_hash
        if on_board == self._on_board:
            return
        self._on_board = on_board
        mission = self._plans.load()
        held = None if mission is None else Blob.of(mission).transfer_id
        for ack in self._receiver.acks():
            if ack.state is TransferState.RECEIVING and ack.transfer_id != held:
                self._note("the mission that was coming by satellite gives way to one by radio")
                with self._disk_may_refuse():
                    self._receiver.refused(ack.transfer_id, _OVERTAKEN)

    @contextmanager
    def _disk_may_refuse(self) -> Generator[None]:
        """Note where the memory of satellite messages cannot be written, and go on without."""
        try:
            yield
        except OSError as error:
            self._note(f"the memory of satellite messages cannot be written: {error}")

    async def _listen(self) -> None:
        async for _ in self._rings:
            self._note("the satellite rang")
            self._has_rung = True

    def _limits(self) -> CallLimits:
        """Return the operator's limits; the radio gets its time by the wall's clock, too."""
        limits = self._settings.limits
        silence_s = max(limits.radio_silence_s, _RADIO_WALL_S * self._clock.speed)
        return replace(limits, radio_silence_s=silence_s)

    def _situation(self) -> Situation:
        return Situation(
            time_s=self._program.time_s,
            surfaced_s=self._program.surfaced_s,
            silent_s=self._link.last_heard_station_s * self._clock.speed,
            has_rung=self._has_rung,
            has_news=self._has_news,
        )

    async def _call(self) -> None:
        """Hold one call."""
        self._program.is_talking = True
        is_sent = False
        with self._disk_may_refuse():
            is_sent = await self._sessions()
        self._policy = self._policy.called(self._situation(), is_sent=is_sent)

    async def _sessions(self) -> bool:
        """Hold the sessions of one call; return whether the last one came about."""
        for_ring, self._has_rung = self._has_rung, False
        is_sent = False
        for number in range(SESSIONS_MAX):
            is_full = number == 0
            said = self._answers()
            record = self._record(is_full=is_full) if is_full or self._has_news else None
            outcome = await self._session(record, for_ring=for_ring and is_full)
            is_sent = outcome.is_sent
            if is_sent:
                self._policy = self._policy.held(self._program.time_s)
            if is_sent and record is not None:
                self._told = said
                self._records.taken_ashore(record)
            if outcome.received is not None:
                self._take(outcome.received)
            if not is_sent:
                self._has_rung = self._has_rung or for_ring
                break
            if self._program.surfaced_s <= 0.0:
                break
            if outcome.queued == 0 and not self._has_news:
                break
            if self._policy.is_spent(self._program.time_s):
                self._note("the satellite sessions of a day are spent: one an hour from now on")
                break
        return is_sent

    async def _session(self, record: bytes | None, *, for_ring: bool) -> SessionOutcome:
        self.sessions += 1
        try:
            outcome = await self._client.session(record, for_ring=for_ring)
        except (NodeError, NodeGoneError, NodeSilentError) as error:
            outcome = SessionOutcome(False, None, 0, str(error))
        size = 0 if record is None else len(record)
        if outcome.is_sent:
            got = "" if outcome.received is None else f", {len(outcome.received)} B came"
            waits = f", {outcome.queued} wait" if outcome.queued else ""
            self._note(f"satellite session: {size} B sent{got}{waits}")
        else:
            self._note(f"satellite session failed: {outcome.text}")
        return outcome

    def _take(self, data: bytes) -> None:
        self._make_way()
        match self._receiver.take(data, self._clock.now()):
            case Complete() as complete:
                self._apply(complete)
            case OrderReceived(command):
                outcome = self._link.take_command(command)
                self._receiver.answered(command, outcome)
                self._note(f"order {command.kind} by satellite: {outcome}")
            case Nothing(reason, is_bad):
                self.refused += is_bad
                self._note(f"message by satellite: {reason}")

    def _apply(self, complete: Complete) -> None:
        """Put a mission on board, unless it came and was flown by another link already."""
        plan = self._link.plan_report()
        sha256 = complete.mission.sha256()
        name = sha256[:PLAN_DIGITS]
        is_flown = plan.state in _FLOWN or self._was_flown(sha256)
        refusal = ""
        if plan.sha256 != sha256 or not is_flown:
            try:
                refusal = self._link.take_mission(
                    complete.mission, start=complete.start, may_wait=True
                )
            except OSError as error:
                refusal = f"the robot cannot keep it: {error}"
        self._on_board = self._link.plan_hash
        waiting = self._waiting = self._link.waiting_plan
        if refusal:
            self._receiver.refused(complete.transfer_id, refusal)
            self._note(f"mission {name} by satellite refused: {refusal}")
        elif waiting is not None and waiting.mission == complete.mission:
            self._note(f"mission {name} by satellite waits for the next surfacing")
        else:
            self._receiver.applied(complete.transfer_id)
            self._note(f"mission {name} by satellite is on board")

    def _answers(self) -> frozenset[TransferAck | CommandAnswer]:
        """Return what the station asked for and waits to hear."""
        return frozenset((*self._acks(is_own=True), *self._receiver.answers()))

    def _acks(self, *, is_own: bool = False) -> tuple[TransferAck, ...]:
        """Return what to say of missions, first of the one that waits, whichever link brought it.

        Args:
            is_own: Whether only of those that satellite brought.
        """
        acks, waiting = self._receiver.acks(), self._link.waiting_plan
        if waiting is None:
            return acks
        try:
            blob = Blob.of(waiting.mission)
            said = waiting_ack(blob.transfer_id, len(sizes(blob)), starts=waiting.starts)
        except ValueError:  # too long for satellite, so it came by radio, which tells it
            return acks
        others = tuple(ack for ack in acks if ack.transfer_id != said.transfer_id)
        return (said, *others) if len(others) < len(acks) or not is_own else acks

    @property
    def _has_news(self) -> bool:
        return not self._answers() <= self._told

    def _record(self, *, is_full: bool) -> bytes:
        return self._records.record(
            self._receiver.next_counter(),
            self._acks(),
            self._receiver.answers(),
            self._settings.record_bytes,
            is_full=is_full,
        )
