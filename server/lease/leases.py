"""Who is in charge of each robot, and how it goes from one to another."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query.fleet.leases import LeaseRecord, get_lease, list_leases
from db.query.station.people import find_token
from robot_link.clock import SystemClock, monotonic_s
from robot_link.lease_config import LeaseConfig
from server.access.caller import Caller, may_pilot
from server.access.dependency import tell_taken
from server.access.guard import RobotAsk
from server.access.presence import Presence, PresenceChanged, Who
from server.access.role import Right
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, conflict, unprocessable
from server.base.retry_queue import until_stored
from server.base.wakeups import Wakeups
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.lease.state import Holder, LeaseChanged, LeaseEvidence, apply
from server.lease.words import holder_words, in_charge, refusal

log = logging.getLogger(__name__)
_FEED: Final = "leases"
_LEAST_S: Final = 0.05
"""A moment that has come is looked at a little later, so that it has come by every clock."""
Step = Callable[[Session, LeaseRecord], None]


@dataclass(frozen=True, slots=True)
class ScriptAsk:
    """A script that was refused since a person is in charge."""

    name: str
    token: str
    at_s: float


class Leases:
    """The leases of all robots. Belongs to one event loop; what it says is what was committed."""

    def __init__(self, foundation: Foundation, fleet: Fleet, presence: Presence) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._wall = SystemClock()
        self._feed = foundation.feed
        self._configurations = foundation.configurations
        self._fleet = fleet
        self._presence = presence
        self._leases: dict[str, LeaseRecord] = {}
        self._limits: dict[str, LeaseConfig] = {}
        self._asks: dict[str, ScriptAsk] = {}
        self._tokens: dict[str, str] = {}
        """Ids of bearer tokens by the hash of their secret."""
        self._looks = Wakeups(foundation.clock)

    async def load(self) -> None:
        """Take up who is in charge as the station that ran before left it."""
        for lease in await self._store.query(list_leases):
            self._leases[lease.robot] = lease
            self._looks.wake(lease.robot)

    def take_change(self, event: LeaseChanged) -> None:
        """Take that a lease moved."""
        robot = event.lease.robot
        self._leases[robot] = event.lease
        self._asks.pop(robot, None)
        self._tell(robot)

    def take_presence(self, event: PresenceChanged) -> None:
        """Take that somebody came or left: it matters to the robots that they are in charge of."""
        for lease in self._leases.values():
            if lease.holder is not None and _who(lease) == event.who:
                self._tell(lease.robot)

    def take_settings(self, event: SettingsChanged) -> None:
        """Take that other limits hold."""
        if event.kind == "lease":
            self._limits = {}
            for robot in self._leases:
                self._tell(robot)

    def of(self, robot: str) -> LeaseRecord:
        """Return the lease of a robot.

        Raises:
            Problem: 404 for an unknown one.
        """
        self._fleet.status(robot)
        return self._leases.get(robot) or LeaseRecord(robot)

    def asked_by_script(self, robot: str) -> ScriptAsk | None:
        """Return the script that was refused last under the present lease."""
        return self._asks.get(robot)

    def silent_s(self, lease: LeaseRecord) -> float:
        """Return for how long nothing was seen of who holds a lease, s of the wall."""
        if lease.holder is None or lease.holder_kind == "station":
            return 0.0
        return self._presence.silent_s(_who(lease))

    async def limits(self, robot: str) -> LeaseConfig:
        """Return after how long others need not wait for who is in charge of a robot."""
        limits = self._limits  # what was read before a change is not kept as of after it
        if robot not in limits:
            found = await self._configurations.current("lease", robot)
            limits[robot] = found.value_as(LeaseConfig)
        return limits[robot]

    async def holder(self, caller: Caller) -> Holder:
        """Return as whom a caller can be in charge."""
        if caller.proof.kind == "session":
            return Holder(caller.name)
        digest = caller.proof.digest
        if digest not in self._tokens:
            at = self._wall.now()
            token = await self._store.query(lambda session: find_token(session, digest, at))
            if token is None:
                raise Problem(401, "The bearer token has expired or was revoked.")
            self._tokens[digest] = token.id
        return Holder(caller.name, "script", self._tokens[digest])

    def refusal(self, lease: LeaseRecord, holder: Holder, limits: LeaseConfig) -> str:
        """Return why somebody may not send a robot anything, "" if they may.

        A free robot refuses nobody, and a script's no person.
        """
        if lease.holder is None or _acts_under(lease, holder):
            return ""
        silent_s = self.silent_s(lease)
        is_silent = silent_s >= limits.silent_s
        if lease.holder_kind == "script" and (holder.kind == "person" or is_silent):
            return ""
        return refusal(lease, holder, silent_s if is_silent else None)

    async def admit(self, caller: Caller, robot: str) -> bool:
        """Have somebody be in charge who sends a robot something, or refuse them.

        Whoever acts first on a free robot is in charge from then on; a person who acts takes over
        from a script.

        Returns:
            Whether they are in charge since now.

        Raises:
            Problem: 409 if somebody else is in charge; the sentence says who, and what to do.
            StoreUnavailableError: Nobody was put in charge.
        """
        if not self._can_be_led(robot):
            return False  # what is asked for cannot be, which its route says better
        holder = await self.holder(caller)
        lease = self.of(robot)
        if _acts_under(lease, holder):
            return False
        limits = await self.limits(robot)
        if reason := self.refusal(lease, holder, limits):
            self._note_ask(lease, holder)
            raise conflict(reason)

        def step(session: Session, before: LeaseRecord) -> None:
            if _acts_under(before, holder):
                return  # another request of theirs was faster
            if reason := self.refusal(before, holder, limits):
                raise conflict(reason)
            text = in_charge(holder, robot, "by the first order, plan or setting that they sent")
            self._put_in_charge(session, before, holder, text)

        return (await self._change(robot, step)).since != lease.since

    async def check(self, ask: RobotAsk) -> None:
        """Have the caller of a request be in charge of its robots, or refuse it.

        What reaches all robots needs nobody to be in charge of all of them, but no other person to
        be in charge of any.

        Raises:
            Problem: 409 if somebody else is in charge.
            StoreUnavailableError: Nobody was put in charge.
        """
        for robot in sorted(ask.robots):
            if await self.admit(ask.caller, robot):
                tell_taken(ask.connection, robot)
        if ask.robots:
            return
        holder = await self.holder(ask.caller)
        for robot, lease in sorted(self._leases.items()):
            reason = self.refusal(lease, holder, await self.limits(robot))
            if reason and lease.holder_kind != "script" and self._can_be_led(robot):
                raise conflict(f"This reaches every robot. {reason}")

    async def take(self, robot: str, caller: Caller, reason: str) -> LeaseRecord:
        """Put somebody in charge of a robot that nobody holds, or who holds it is silent.

        A person takes over from a script and from another ground station at any time, an
        administrator from anybody with a reason.

        Raises:
            Problem: 404 for an unknown robot; 409 if somebody is in charge who is there.
        """
        holder, limits = await self.holder(caller), await self.limits(robot)
        may_overrule = caller.rights.may(Right.ADMINISTER, robot)
        overrules = may_overrule and holder.kind == "person"

        def step(session: Session, before: LeaseRecord) -> None:
            if holder.holds(before):
                return
            is_open = not self.refusal(before, holder, limits) or _yields(before, holder)
            if not (is_open or self._has_left(session, before, limits) or (overrules and reason)):
                raise conflict(_must_ask(before, holder, overrules=overrules))
            text = in_charge(holder, robot, reason and f"“{reason}”")
            self._put_in_charge(session, before, holder, text, reason)

        return await self._change(robot, step)

    async def request(self, robot: str, caller: Caller, note: str) -> LeaseRecord:
        """Ask who is in charge for a robot; one that is free, a script's or silent is given.

        Raises:
            Problem: 404 for an unknown robot; 409 if one asked already, or a script asks.
        """
        holder, limits = await self.holder(caller), await self.limits(robot)
        if holder.kind == "script":
            raise conflict("A script asks for no robot; the pilot in charge can let it act.")

        def step(session: Session, before: LeaseRecord) -> None:
            if holder.holds(before):
                raise conflict(f"{holder.name} is in charge of {robot} already.")
            if not self.refusal(before, holder, limits) or _yields(before, holder):
                text = in_charge(holder, robot, "as they asked")
                self._put_in_charge(session, before, holder, text, note)
                return
            if before.requested_system is not None:  # people of the station are heard first
                text = f"{before.requested_by} asks for {robot} no more: {holder.name} does."
                self._apply(session, robot, LeaseEvidence.EXPIRED, text)
            elif before.requested_by == holder.name:
                return
            elif before.requested_by is not None:
                raise conflict(f"{before.requested_by} asked for {robot} already; wait for that.")
            text = f"{holder.name} asks {before.holder} for {robot}{_quoted(note)}."
            self._apply(session, robot, LeaseEvidence.REQUESTED, text, holder, note)
            if self._has_left(session, before, limits):
                text = f"{holder.name} is in charge of {robot}: {before.holder} is silent."
                self._apply(session, robot, LeaseEvidence.TIMED_OUT, text)

        return await self._change(robot, step)

    async def answer(
        self, robot: str, caller: Caller, *, requester: str, grants: bool, note: str
    ) -> LeaseRecord:
        """Grant or refuse what somebody asked who is in charge.

        Raises:
            Problem: 404 for an unknown robot; 409 if the caller is not in charge, or that person
                asks no more.
        """
        holder = await self.holder(caller)

        def step(session: Session, before: LeaseRecord) -> None:
            self._only_holder(before, holder)
            if before.requested_by != requester:
                raise conflict(f"{requester} does not ask for {robot} any more.")
            if grants:
                text = f"{holder.name} granted {requester} {robot}{_quoted(note)}."
                self._apply(session, robot, LeaseEvidence.GRANTED, text, note=note)
            else:
                text = f"{holder.name} refused {requester} {robot}{_quoted(note)}."
                self._apply(session, robot, LeaseEvidence.REFUSED, text, note=note)

        return await self._change(robot, step)

    async def withdraw(self, robot: str, caller: Caller) -> LeaseRecord:
        """Ask for a robot no more.

        Raises:
            Problem: 404 for an unknown robot; 409 if the caller has not asked.
        """

        def step(session: Session, before: LeaseRecord) -> None:
            if before.requested_by != caller.name or before.requested_system is not None:
                raise conflict(f"{caller.name} does not ask for {robot}.")
            text = f"{caller.name} asks for {robot} no more."
            self._apply(session, robot, LeaseEvidence.WITHDRAWN, text)

        return await self._change(robot, step)

    async def hand_over(self, robot: str, caller: Caller, to: str, note: str) -> LeaseRecord:
        """Put somebody else who is there in charge.

        Raises:
            Problem: 404 for an unknown robot; 409 if the caller is not in charge, or the other is
                not there; 422 for nobody who may pilot.
        """
        holder, limits = await self.holder(caller), await self.limits(robot)

        def step(session: Session, before: LeaseRecord) -> None:
            self._only_holder(before, holder)
            if not may_pilot(session, to, robot):
                text = f"it must be the name of a person who may pilot {robot}"
                raise unprocessable("1 field is wrong.", [FieldError(loc=["to"], msg=text)])
            if to == holder.name:
                raise conflict(f"{to} is in charge of {robot} already.")
            if self._presence.silent_s(("session", to)) >= limits.silent_s:
                raise conflict(f"{to} is not there; a robot is handed to somebody who is.")
            text = f"{holder.name} handed {robot} over to {to}{_quoted(note)}."
            self._apply(session, robot, LeaseEvidence.HANDED_OVER, text, Holder(to), note)

        return await self._change(robot, step)

    async def release(self, robot: str, caller: Caller) -> LeaseRecord:
        """Give a robot back: to who asked for it, else to nobody.

        Raises:
            Problem: 404 for an unknown robot; 409 if the caller is not in charge.
        """
        holder = await self.holder(caller)

        def step(session: Session, before: LeaseRecord) -> None:
            self._only_holder(before, holder)
            self._release(session, before)

        return await self._change(robot, step)

    async def release_all(self, caller: Caller) -> list[LeaseRecord]:
        """Give every robot back that somebody is in charge of: the end of a shift."""
        holder = await self.holder(caller)

        def write(session: Session) -> list[LeaseRecord]:
            mine = [lease for lease in list_leases(session) if holder.holds(lease)]
            for lease in mine:
                self._release(session, lease)
            return [get_lease(session, lease.robot) for lease in mine]

        return await self._store.write(write)

    async def let_script(self, robot: str, caller: Caller, token: str | None) -> LeaseRecord:
        """Let a script act under the lease of the person in charge, or none; it ends with that.

        Raises:
            Problem: 404 for an unknown robot; 409 if the caller is no person in charge, or no such
                script was refused.
        """
        holder, ask = await self.holder(caller), self._asks.get(robot)

        def step(session: Session, before: LeaseRecord) -> None:
            self._only_holder(before, holder)
            if holder.kind == "script":
                raise conflict("A script lets no other script act.")
            if token is None:
                if before.script is not None:
                    text = f"{holder.name} lets {before.script} act on {robot} no more."
                    self._apply(session, robot, LeaseEvidence.SCRIPT_STOPPED, text)
                return
            if ask is None or ask.token != token:
                raise conflict(f"No script {token} has asked to act on {robot}.")
            text = f"{holder.name} lets the script {ask.name} act on {robot}."
            script = Holder(ask.name, "script", token)
            self._apply(session, robot, LeaseEvidence.SCRIPT_LET, text, script)

        return await self._change(robot, step)

    async def run(self) -> None:
        """Grant what nobody answers, and tell who falls silent, until cancelled."""
        while True:
            for robot in await self._looks.next():
                await until_stored(f"lease of {robot}", lambda robot=robot: self._look_at(robot))

    async def _look_at(self, robot: str) -> None:
        lease = self._leases.get(robot)
        if lease is None or lease.holder is None or not self._fleet.knows(robot):
            return
        limits = await self.limits(robot)
        left_s = self.granted_in_s(lease, limits)
        if left_s is not None and left_s <= 0.0:
            await self._time_out(lease)
            return
        silent_in_s = self._silent_in_s(lease, limits)
        if silent_in_s is not None and silent_in_s <= 0.0:
            self._feed.mark(_FEED)  # who it is has just fallen silent
            silent_in_s = None
        waits = [one for one in (left_s, silent_in_s) if one is not None]
        self._looks.set_due(robot, self._moment(min(waits)) if waits else None)

    async def _time_out(self, lease: LeaseRecord) -> None:
        """Grant a request that nobody answered, unless it was answered just now."""

        def write(session: Session) -> None:
            if get_lease(session, lease.robot) == lease:
                text = (
                    f"{lease.requested_by} is in charge of {lease.robot}: "
                    f"{lease.holder} did not answer."
                )
                self._apply(session, lease.robot, LeaseEvidence.TIMED_OUT, text)

        await self._store.write(write)

    def granted_in_s(self, lease: LeaseRecord, limits: LeaseConfig) -> float | None:
        """Return when a request is granted by itself, s of the wall; ``None`` without one.

        Once who is in charge is silent, or has neither answered nor done anything else for long.
        What another ground station asks is never granted by itself.
        """
        if lease.requested_at is None or lease.requested_system is not None:
            return None
        asked_s = (self._clock.now() - lease.requested_at).total_seconds() / self._clock.speed
        unanswered_s = min(max(0.0, asked_s), self._presence.idle_s(_who(lease)))
        silent_in_s = self._silent_in_s(lease, limits)
        left_s = limits.answer_s - unanswered_s
        return max(0.0, left_s if silent_in_s is None else min(left_s, silent_in_s))

    def _silent_in_s(self, lease: LeaseRecord, limits: LeaseConfig) -> float | None:
        """Return when who is in charge counts as silent, ``None`` while a page is open."""
        if lease.holder_kind == "station":
            return None
        if self._presence.is_open(_who(lease)):
            return None
        return limits.silent_s - self.silent_s(lease)

    def _moment(self, in_s: float) -> datetime:
        return self._clock.now() + timedelta(seconds=(in_s + _LEAST_S) * self._clock.speed)

    def _tell(self, robot: str) -> None:
        self._feed.mark(_FEED)
        self._looks.wake(robot)

    def _note_ask(self, lease: LeaseRecord, holder: Holder) -> None:
        """Note that a script would act, so that the person in charge can let it."""
        if holder.token is not None and lease.holder_kind == "person":
            before = self._asks.get(lease.robot)
            self._asks[lease.robot] = ScriptAsk(holder.name, holder.token, monotonic_s())
            if before is None or before.token != holder.token:
                self._feed.mark(_FEED)

    def _has_left(self, session: Session, lease: LeaseRecord, limits: LeaseConfig) -> bool:
        """Tell whether nobody need wait for who is in charge: silent, or may pilot no more."""
        if lease.holder is None or self.silent_s(lease) >= limits.silent_s:
            return True
        return lease.holder_kind == "person" and not may_pilot(
            session, lease.holder, robot=lease.robot
        )

    def _can_be_led(self, robot: str) -> bool:
        """Tell whether a robot is one of which somebody can be in charge."""
        if not self._fleet.knows(robot):
            return False
        status = self._fleet.status(robot)
        return status.record.system_id is not None and not status.is_retired

    def _only_holder(self, lease: LeaseRecord, holder: Holder) -> None:
        if not holder.holds(lease):
            raise conflict(f"{holder_words(lease)}; only who is in charge can do this.")

    def _put_in_charge(
        self, session: Session, before: LeaseRecord, holder: Holder, text: str, note: str = ""
    ) -> None:
        if before.holder is None:
            self._apply(session, before.robot, LeaseEvidence.TAKEN, text, holder, note)
            return
        script = "the script " if before.holder_kind == "script" else ""
        text = f"{text.rstrip('.')}; it was {script}{before.holder} before."
        self._apply(session, before.robot, LeaseEvidence.TAKEN_OVER, text, holder, note)

    def _release(self, session: Session, lease: LeaseRecord) -> None:
        text = f"{lease.holder} gave {lease.robot} back; nobody is in charge of it."
        if lease.requested_by is not None:
            text = f"{lease.holder} gave {lease.robot} to {lease.requested_by}, who asked for it."
        self._apply(session, lease.robot, LeaseEvidence.RELEASED, text)

    def _apply(
        self,
        session: Session,
        robot: str,
        evidence: LeaseEvidence,
        text: str,
        to: Holder | None = None,
        note: str = "",
    ) -> None:
        if apply(session, robot, evidence, text, self._clock.now(), to=to, note=note) is None:
            raise conflict(f"{robot} is not in a state that allows this; look at it again.")

    async def _change(self, robot: str, step: Step) -> LeaseRecord:
        """Take one step in a transaction, and return what the lease is then.

        Raises:
            Problem: 404 for an unknown robot, 409 for a recording, and what the step raises.
        """
        refuse_recording(self._fleet.status(robot), "has nobody in charge")

        def write(session: Session) -> LeaseRecord:
            step(session, get_lease(session, robot))
            return get_lease(session, robot)

        return await self._store.write(write)


def _who(lease: LeaseRecord) -> Who:
    return "token" if lease.holder_kind == "script" else "session", lease.holder or ""


def _acts_under(lease: LeaseRecord, holder: Holder) -> bool:
    """Tell whether somebody holds a lease, or is the script that its holder lets act."""
    is_let = holder.token is not None and lease.script_token == holder.token
    return is_let or holder.holds(lease)


def _yields(lease: LeaseRecord, holder: Holder) -> bool:
    """Tell whether another ground station holds a lease, from which a person takes it back."""
    return lease.holder_kind == "station" and holder.kind == "person"


def _must_ask(lease: LeaseRecord, holder: Holder, *, overrules: bool) -> str:
    if holder.kind == "script":
        return f"{holder_words(lease)}; a script takes over from nobody who is there."
    how = "give a reason to take over at once" if overrules else "request it from them"
    return f"{holder_words(lease)} and is there; {how}."


def _quoted(note: str) -> str:
    return f": “{note}”" if note else ""
