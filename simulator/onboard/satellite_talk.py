"""The robot's talk by satellite: it calls, says what fits one record, and takes what waits.

A call is up to eight sessions: the first carries the full record (state, plan, answers, and the
samples that change the map most), the next ones fetch what waits still, the last says what came
of it. The device is behind the satellite node; which one it is makes no difference here.
"""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from robot_link.clock import Clock
from robot_link.mavlink.command import ReceivedCommand
from robot_link.messages import (
    OnboardPlanState,
    PlanHash,
    RobotId,
    Sample,
    StateReport,
    SystemId,
)
from robot_link.mission import Mission
from robot_link.onboard_settings import DigestSettings
from robot_link.plan_desk import PlanOnBoard
from robot_link.robot_program import CommandOutcome
from robot_link.sample_log import SampleLog
from robot_link.satellite.digest import choose
from robot_link.satellite.receiver import Complete, Nothing, OrderReceived, Receiver
from robot_link.satellite.record import (
    CommandAnswer,
    MobileOriginatedContent,
    Reason,
    ShortPlanReport,
    TransferAck,
    compose,
    read_mobile_originated,
    sample_room,
)
from simulator.node.satellite import SatelliteClient, SessionOutcome
from simulator.node.wire import NodeError, NodeGoneError, NodeSilentError
from simulator.onboard.satellite_policy import SESSIONS_MAX, CallLimits, CallPolicy, Situation

_TICK_S = 0.05
"""Wall time between two looks at the situation."""
_RADIO_WALL_S = 3.0
"""The station's radio is heard once a second of the wall, however fast the robot lives."""
_DIGITS = 16
_FLOWN = (OnboardPlanState.RUNNING, OnboardPlanState.DONE, OnboardPlanState.FAILED)

_log = logging.getLogger(__name__)


class Carried(Protocol):
    """What the robot's link offers to the roads beside its radio; a ``RobotLink``."""

    @property
    def last_heard_station_s(self) -> float:
        """Seconds of the wall since the station was heard; infinite before the first time."""
        ...

    @property
    def plan_hash(self) -> PlanHash | None:
        """Hash of the plan on board."""
        ...

    def plan_report(self) -> PlanOnBoard:
        """Return what is to be said of the plan on board."""
        ...

    def take_mission(self, mission: Mission, *, start: bool) -> str:
        """Put a mission on board; return why it was refused, or ""."""
        ...

    def take_command(self, command: ReceivedCommand) -> CommandOutcome:
        """Act on a command; one heard by several roads acts once."""
        ...


class Aboard(Protocol):
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

    @property
    def digest_settings(self) -> DigestSettings | None:
        """What tells which samples change the map most, where a mission brought it."""
        ...

    def state_report(self) -> StateReport:
        """Return what the robot believes of itself."""
        ...


@dataclass(slots=True)
class TalkSettings:
    """What the operator may change while the robot talks, as its parameters."""

    limits: CallLimits
    record_bytes: int
    """Most bytes of one record."""


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
        note: Callable[[str], None] = _log.info,
    ) -> None:
        self._robot = robot
        self._system = system
        self._key = key
        self._client = client
        self._rings = client.rings()
        self._receiver = receiver
        self._link = link
        self._program = program
        self._samples = samples
        self._clock = clock
        self._settings = settings
        self._note = note
        self._policy = CallPolicy(settings.limits)
        self._has_rung = False
        self._told: frozenset[TransferAck | CommandAnswer] = frozenset()
        self._said: set[int] = set()
        self.sessions = 0
        """Sessions since the program began."""
        self.refused = 0
        """Messages that were none for this robot."""

    async def run(self) -> None:
        """Call whenever a call is due, until cancelled."""
        if pending := self._receiver.pending(self._link.plan_hash):
            self._apply(pending)
        listening = asyncio.create_task(self._listen(), name=f"{self._robot} rings")
        try:
            while True:
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

    async def _listen(self) -> None:
        async for _ in self._rings:
            self._note("the satellite rang")
            self._has_rung = True

    def _limits(self) -> CallLimits:
        """Return the operator's limits; the radio gets its time by the wall's clock, too."""
        limits = self._settings.limits
        silence_s = max(limits.radio_silence_s, _RADIO_WALL_S * self._clock.speed)
        return CallLimits(silence_s, limits.session_period_s)

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
        for_ring, self._has_rung = self._has_rung, False
        is_sent = False
        for number in range(SESSIONS_MAX):
            is_full = number == 0
            said = self._answers()
            record = self._record(is_full=is_full) if is_full or self._has_news else None
            outcome = await self._session(record, for_ring=for_ring and is_full)
            is_sent = outcome.is_sent
            if is_sent and record is not None:
                self._told = said
                self._remember(record)
            if outcome.received is not None:
                self._take(outcome.received)
            if not is_sent:
                self._has_rung = self._has_rung or for_ring
                break
            if self._program.surfaced_s <= 0.0:
                break
            if outcome.queued == 0 and not self._has_news:
                break
        self._policy = self._policy.called(self._situation(), is_sent=is_sent)

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
        """Put a mission on board, unless it came and was flown by another road already."""
        plan = self._link.plan_report()
        name = complete.mission.sha256()[:_DIGITS]
        if plan.sha256 == complete.mission.sha256() and plan.state in _FLOWN:
            refusal = ""
        else:
            refusal = self._link.take_mission(complete.mission, start=complete.start)
        if refusal:
            self._receiver.refused(complete.transfer_id, refusal)
            self._note(f"mission {name} by satellite refused: {refusal}")
        else:
            self._receiver.applied(complete.transfer_id)
            self._note(f"mission {name} by satellite is on board")

    def _answers(self) -> frozenset[TransferAck | CommandAnswer]:
        """Return what the station asked for and waits to hear."""
        return frozenset((*self._receiver.acks(), *self._receiver.answers()))

    @property
    def _has_news(self) -> bool:
        return not self._answers() <= self._told

    def _record(self, *, is_full: bool) -> bytes:
        plan = self._link.plan_report()
        content = MobileOriginatedContent(
            counter=self._receiver.next_counter(),
            state=self._program.state_report() if is_full else None,
            plan=ShortPlanReport(
                (plan.sha256 or "")[:_DIGITS],
                plan.state,
                plan.leg,
                plan.legs,
                plan.energy_used,
                Reason.of(plan.reason),
            ),
            acks=self._receiver.acks(),
            answers=self._receiver.answers(),
        )
        most = self._settings.record_bytes
        if is_full:
            content = replace(content, samples=self._digest(sample_room(content, most)))
        return compose(content, self._key, self._system, most)

    def _digest(self, room: int) -> tuple[Sample, ...]:
        """Return the samples that change the map most, within so many bytes of a record."""
        kept = [number for number in self._samples.kept() if number not in self._said]
        samples: list[Sample] = []
        for number in kept:
            measured = self._samples.get(number)
            if measured is not None:
                samples.append(
                    Sample(
                        robot=self._robot,
                        log=self._samples.log,
                        sequence=number,
                        variable=measured.variable,
                        value=measured.value,
                        position_ned=measured.position_ned,
                        position_std_m=measured.position_std_m,
                        measured_at=measured.measured_at,
                        received_at=measured.measured_at,
                    )
                )
        return choose(samples, self._program.digest_settings, room)

    def _remember(self, record: bytes) -> None:
        """Note which samples a record that was taken ashore carried: they need not go again."""
        content = read_mobile_originated(
            record, self._key, self._system, self._robot, self._clock.now()
        )
        self._said |= {sample.sequence for sample in content.samples}
        self._said &= set(self._samples.kept())
