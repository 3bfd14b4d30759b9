"""Sends plans when what they wait for comes true, and drops them when their time is over.

A row is written before anything is due. What makes it due is asked of what the station knows, never
remembered in memory alone: the event log tells of surfacings since the row was added, plans of
their ends, the clock of moments. So a station that was killed goes on where it was, and what
expired meanwhile is dropped, not sent.
"""

import logging
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query.mission import scheduled_sends as query
from db.query.mission.plans import ENDED_STATES, get_plan
from db.query.mission.scheduled_sends import ScheduledSend
from db.query.mission.transfers import TransferRecord, get_transfer, newest_transfer
from db.query.station.events import EventFilter, add_event, events_after
from robot_link.automation_config import AutomationConfig
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, conflict, unprocessable
from server.base.retry_queue import until_stored
from server.base.wakeups import Wakeups
from server.fleet.fleet import Fleet
from server.fleet.panel import FleetViews
from server.fleet.routing import RequestedLink
from server.fleet.words import clock_time
from server.lease.hold import AutomationHold
from server.link.moments import SURFACED
from server.plan.ledger import PlanLedger
from server.schedule.condition import (
    AfterPlan,
    AtTime,
    Condition,
    NextSurfacing,
    ValueBeyond,
    condition_of,
    document_of,
    moment_of,
    text_of,
)
from server.schedule.state import SendEvidence, apply, note, told
from server.transfer.state import WithdrawnError
from server.transfer.transfers import LinkRequest, Transfers

log = logging.getLogger(__name__)

LONGEST: Final = timedelta(days=14)
"""Nothing waits longer: the robot and its water are others by then."""
DEFAULT_LIFE: Final = timedelta(hours=12)
_HOUR: Final = timedelta(hours=1)
_REST_S: Final = 0.5
_ARRIVED: Final = {
    "kept": "{plan} waits on board of {robot} behind the plan that it flies.",
    "on_board": "{plan} is on board of {robot}.",
    "running": "{robot} flies {plan}.",
}
"""What is said of a plan that the robot has, by the state of its transfer."""
_REFUSED_S: Final = 60.0
"""One that was refused is looked at again after so long by the wall; most ends of a refusal are
told by an event before."""
_EXPIRED: Final = "schedule.expired"


@dataclass(frozen=True, slots=True)
class Allowance:
    """What may be sent to a robot by itself, and what was in the last hour, for whatever reason."""

    config: AutomationConfig
    sent: int
    free_at: datetime | None
    """When the next may be sent; ``None`` while one may be, and where none ever may."""
    is_free: bool


class Schedule:
    """Plans that wait at the station. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        views: FleetViews,
        ledger: PlanLedger,
        transfers: Transfers,
        hold: AutomationHold,
    ) -> None:
        self._hold = hold
        self._store = foundation.store
        self._clock = foundation.clock
        self._alarms = foundation.alarms
        self._configurations = foundation.configurations
        self._fleet = fleet
        self._views = views
        self._ledger = ledger
        self._transfers = transfers
        self._open: dict[str, dict[str, ScheduledSend]] = {}
        """What has not ended, by robot."""
        self._again_at: dict[str, datetime] = {}
        """When one that is due and was not sent may be, by time alone."""
        self._looks = Wakeups(foundation.clock, _REST_S)

    @property
    def is_held(self) -> bool:
        """Whether nothing may be sent or suggested by itself now."""
        return self._hold.is_held

    async def load(self) -> None:
        """Take up what waited when the station stopped."""
        for send in await self._store.query(query.open_scheduled_sends):
            self._open.setdefault(send.robot, {})[send.id] = send
            self._looks.wake(send.robot)

    def take(self, send: ScheduledSend) -> None:
        """Take that one was added or moved."""
        sends = self._open.setdefault(send.robot, {})
        if send.ended_at is None:
            sends[send.id] = send
        else:
            sends.pop(send.id, None)
            self._again_at.pop(send.id, None)
        self._looks.wake(send.robot)

    def wake(self, robot: str | None) -> None:
        """Look again at what waits for a robot: something about it changed."""
        if robot is not None and self._open.get(robot):
            self._looks.wake(robot)

    def wake_all(self) -> None:
        """Look again at all that waits, such as after automation was held."""
        for robot in self._open:
            self.wake(robot)

    async def run(self) -> None:
        """Send and drop until cancelled."""
        while True:
            for robot in await self._looks.next():
                for send in list(self._open.get(robot, {}).values()):
                    await until_stored(send.id, lambda send=send: self._look_at(send))
                self._set_due(robot)

    async def add(
        self,
        plan: str,
        condition: Condition,
        *,
        expires_at: datetime,
        start: bool,
        route: RequestedLink,
        confirmed: bool,
        by: str,
    ) -> ScheduledSend:
        """Have a draft sent when a condition comes true.

        Raises:
            UnknownIdError: If there is no such plan.
            Problem: 409 if the plan is none that can be sent, 422 if condition or expiry cannot be.
        """
        record, now = await self._ledger.get(plan), self._clock.now()
        self._check(record.robot, condition, expires_at, now)
        if record.document.get("violations"):
            raise conflict(f"{plan} breaks a limit; change it and plan again.")

        def write(session: Session) -> ScheduledSend:
            if get_plan(session, plan).state != "draft":
                raise conflict(f"{plan} is no draft; only a draft is sent later.")
            if query.waits_for_plan(session, plan):
                raise conflict(f"{plan} waits to be sent already; cancel that first.")
            if isinstance(condition, AfterPlan):
                self._check_before(session, record.robot, plan, condition.plan)
            send = query.add_scheduled_send(
                session,
                plan,
                record.robot,
                condition=document_of(condition),
                route=route,
                start=start,
                confirmed=confirmed,
                at=now,
                by=by,
                expires_at=expires_at,
            )
            text = f"{plan} waits at the station for {text_of(condition)}, as {by} asked."
            data = {"schedule": send.id, "plan": plan}
            add_event(session, now, "schedule.waiting", text, robot=record.robot, data=data)
            return told(session, send)

        return await self._store.write(write)

    async def cancel(self, schedule: str, *, by: str) -> ScheduledSend:
        """Have a plan not sent by itself any more; what is on its way is withdrawn.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 409 if it has ended, or the robot has the plan.
        """
        at = self._clock.now()

        def write(session: Session) -> tuple[ScheduledSend, ScheduledSend]:
            before = query.get_scheduled_send(session, schedule)
            arrival = _arrival(_transfer_of(session, before))
            if arrival:
                raise conflict(f"{arrival} There is nothing to cancel.")
            text = f"{by} cancelled sending {before.plan}."
            after = apply(session, schedule, SendEvidence.CANCELLED, text, at)
            if after is None:
                raise conflict(f"{schedule} is {before.state}; there is nothing to cancel.")
            return before, after

        before, after = await self._store.write(write)
        await self._withdraw(before, after.reason)
        return after

    async def of_robot(self, robot: str) -> list[ScheduledSend]:
        """Return those of a robot, the newest first."""
        return await self._store.query(lambda s: query.newest_scheduled_sends(s, robot))

    def _check(self, robot: str, condition: Condition, expires_at: datetime, now: datetime) -> None:
        if self._fleet.status(robot).record.is_foreign:
            raise conflict(f"{robot} takes no plans of this station.")
        if not now < expires_at <= now + LONGEST:
            text = f"It must expire after now and within {LONGEST.days} days."
            raise _invalid("expires_at", text)
        at = moment_of(condition)
        if at is not None and not now < at < expires_at:
            raise _invalid("condition.at", "The time must be to come, and before it expires.")
        if isinstance(condition, ValueBeyond):
            known = self._views.state_view(robot).channels
            if condition.channel not in known:
                text = f"{robot} has told no {condition.channel!r}; it told {', '.join(known)}."
                raise _invalid("condition.channel", text)

    def _check_before(self, session: Session, robot: str, plan: str, before: str) -> None:
        first = get_plan(session, before)
        if first.robot != robot or before == plan:
            text = "It must be another plan of the same robot."
            raise _invalid("condition.plan", text)
        if first.state in ENDED_STATES and first.state != "done":
            raise conflict(f"{before} is {first.state}; it will never be done.")

    def _set_due(self, robot: str) -> None:
        """Have a look at the next moment that time alone changes something."""
        moments: list[datetime] = []
        for send in self._open.get(robot, {}).values():
            at = moment_of(condition_of(send.condition)) if send.due_at is None else None
            again_at = self._again_at.get(send.id)
            moments += [one for one in (send.expires_at, at, again_at) if one is not None]
        self._looks.set_due(robot, min(moments, default=None))

    async def _look_at(self, send: ScheduledSend) -> None:
        now = self._clock.now()
        self._again_at.pop(send.id, None)
        if send.state == "sent":
            await self._follow(send, now)
            return
        if now >= send.expires_at:
            condition = condition_of(send.condition)
            why = send.reason if send.due_at is not None else f"{text_of(condition)} did not come"
            await self._drop(send, SendEvidence.EXPIRED, f"its time was over; {why}", now)
            return
        plan = await self._ledger.get(send.plan)
        if plan.state in ("sent", "waiting", "on_board", "running", *ENDED_STATES):
            await self._drop(send, SendEvidence.FAILED, f"it is {plan.state} already", now)
            return
        due_at = send.due_at or await self._due_at(send, now)
        if due_at is None:
            return
        if send.due_at is None:
            send = await self._store.write(lambda s: note(s, send.id, due_at=due_at))
        held = await self._held(send)
        await (self._note_reason(send, held) if held else self._send(send, now))

    async def _due_at(self, send: ScheduledSend, now: datetime) -> datetime | None:
        """Return since when a condition is true, ``None`` while it is not."""
        match condition_of(send.condition):
            case AtTime(at=at):
                return at if now >= at else None
            case NextSurfacing():
                found = await self._store.query(
                    lambda s: events_after(
                        s, send.cursor, EventFilter(robot=send.robot, kinds=(SURFACED,)), limit=1
                    )
                )
                return found[0].at if found else None
            case ValueBeyond(channel=channel, side=side, limit=limit):
                told_value = self._views.state_view(send.robot).channels.get(channel)
                if told_value is None or told_value.age_s > told_value.limit_s:
                    return None
                beyond = told_value.value > limit if side == "over" else told_value.value < limit
                return told_value.measured_at if beyond else None
            case AfterPlan(plan=before):
                first = await self._ledger.get(before)
                if first.state in ENDED_STATES and first.state != "done":
                    why = f"{before} is {first.state} and will never be done"
                    await self._drop(send, SendEvidence.FAILED, why, now)
                return first.ended_at if first.state == "done" else None

    async def allowance(self, robot: str) -> Allowance:
        """Return how much of the limit of an hour a robot has used.

        Raises:
            UnknownIdError: If there is no such robot.
        """
        now = self._clock.now()
        config = (await self._configurations.current("automation", robot)).value_as(
            AutomationConfig
        )
        most = config.most_sends_per_hour
        times = await self._store.query(lambda s: query.sent_times(s, robot, now - _HOUR))
        is_free = len(times) < most
        free_at = None if is_free or most == 0 else times[-most] + _HOUR
        return Allowance(config, len(times), free_at, is_free=is_free)

    async def _held(self, send: ScheduledSend) -> str:
        """Return why it is not sent now although it is due, or ""."""
        if self.is_held:
            return f"held: {self._hold.view.text}"
        found = await self.allowance(send.robot)
        if found.is_free:
            return ""
        until = ""
        if found.free_at is not None:
            self._again_at[send.id] = found.free_at
            until = f" until {clock_time(found.free_at)}"
        return (
            f"held{until}: {found.sent} plans were sent to {send.robot} by themselves in the last "
            f"hour, the limit is {found.config.most_sends_per_hour}"
        )

    async def _send(self, send: ScheduledSend, now: datetime) -> None:
        text = f"{send.plan} is sent to {send.robot} by itself, as {send.created_by} asked."

        def begin(session: Session) -> None:
            if self._clock.now() >= send.expires_at:
                raise WithdrawnError
            if apply(session, send.id, SendEvidence.BEGUN, text, now) is None:
                raise WithdrawnError

        try:
            await self._transfers.send(
                send.plan,
                start=send.start,
                check=begin,
                confirmed=send.confirmed,
                request=LinkRequest(_route(send.route)),
                may_wait=True,
            )
        except WithdrawnError:
            log.info("%s ended before it was sent", send.id)
        except Problem as problem:
            rest = timedelta(seconds=_REFUSED_S * self._clock.speed)
            self._again_at[send.id] = now + rest
            await self._note_reason(send, problem.detail)

    async def _follow(self, send: ScheduledSend, now: datetime) -> None:
        """Take what became of a transfer; one that has not arrived when its time is over ends."""
        transfer = await self._store.query(lambda s: _transfer_of(s, send))
        if transfer is None:
            why = "its transfer is not known any more"
            await self._drop(send, SendEvidence.FAILED, why, now)
        elif text := _arrival(transfer):
            await self._store.write(lambda s: apply(s, send.id, SendEvidence.ARRIVED, text, now))
        elif transfer.ended_at is not None:
            await self._drop(send, SendEvidence.FAILED, transfer.reason, now)
        elif now >= send.expires_at:
            why = "its time was over before the robot had it"
            await self._withdraw(send, f"{send.plan}: {why}.")
            await self._drop(send, SendEvidence.EXPIRED, why, now)

    async def _withdraw(self, send: ScheduledSend, reason: str) -> None:
        """End the transfer of one that is on its way."""
        transfer = await self._store.query(lambda s: _transfer_of(s, send))
        if transfer is not None and transfer.ended_at is None and not _arrival(transfer):
            await self._transfers.withdraw(send.robot, reason)

    async def _drop(
        self, send: ScheduledSend, evidence: SendEvidence, why: str, now: datetime
    ) -> None:
        text = f"{send.plan} is not sent: {why.rstrip('.')}."
        after = await self._store.write(lambda s: apply(s, send.id, evidence, text, now))
        if after is not None:
            await self._alarms.raise_(f"{_EXPIRED}:{send.id}", text, robot=send.robot)
            await self._alarms.clear(f"{_EXPIRED}:{send.id}", robot=send.robot)

    async def _note_reason(self, send: ScheduledSend, reason: str) -> None:
        if send.reason != reason:
            await self._store.write(lambda s: note(s, send.id, reason=reason))


def _transfer_of(session: Session, send: ScheduledSend) -> TransferRecord | None:
    """Return the transfer that a send began."""
    newest = newest_transfer(session, send.plan)
    found = None if newest is None else get_transfer(session, newest)
    since = send.sent_at
    return found if found is not None and since is not None and send.state == "sent" else None


def _arrival(transfer: TransferRecord | None) -> str:
    """Return that a robot has the plan of a transfer, in a sentence, or ""."""
    if transfer is None:
        return ""
    text = _ARRIVED.get(transfer.state, "")
    return text.format(plan=transfer.plan, robot=transfer.robot)


def _route(route: str) -> RequestedLink:
    match route:
        case "radio" | "satellite" as asked:
            return asked
        case _:
            return "auto"


def _invalid(field: str, text: str) -> Problem:
    return unprocessable(text, [FieldError(loc=["body", *field.split(".")], msg=text)])
