"""The plans of the fleet: kept, and what of them is in memory only."""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy.orm import Session

from db.query.mission import plans as query
from db.query.mission.plans import ENDED_STATES, PlanRecord, PlanStateError
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.live_feed import PARTS_PER_SECTION
from server.base.wakeups import Wakeups
from server.fleet.fleet import Fleet
from server.fleet.status import PlanInHand
from server.plan.document import legs_of, live_plan_view, plan_view, points_of
from server.plan.drafting import SENDABLE, ages_at, outdated_by
from server.plan.dry_run import WORKING
from server.plan.expected import expected_ends_s, expected_of, is_on_leg, off_track_m
from server.plan.search.survey_round import AHEAD_OF
from server.plan.state import ON_THE_WAY, PlanChanged, PlanEvidence, PlanSeen, apply, begin, note
from server.plan.view import (
    LivePlanView,
    OnboardView,
    PlanView,
    ProgressView,
    TransferView,
    ViolationView,
)

_REST_S = 1.0
"""Wall time between two looks at whether plans that wait still fit robots that keep reporting."""


@dataclass(frozen=True, slots=True)
class PlanOutdated:
    """What speaks against flying the plan that waits for a robot changed."""

    robot: str


class PlanLedger:
    """Keeps plans, and what of them is in memory only. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._bus = foundation.bus
        self._fleet = fleet
        self._progress: dict[str, ProgressView] = {}
        self._transfers: dict[str, TransferView] = {}
        """The newest of the plans that the live stream has room for, the last changed last."""
        self._rehearsing: set[str] = set()
        """Drafts that are flown ahead once more; what the last dry run found stands meanwhile."""
        self._said_outdated: dict[str, tuple[ViolationView, ...]] = {}
        self._said_off_m: dict[str, float] = {}
        """By robot, how far it was last said to be from the track that it flies."""
        self._looks = Wakeups(foundation.clock, _REST_S)

    async def load(self) -> None:
        """Take up the plan of each robot that concerns the operator now."""
        for status in list(self._fleet.statuses):
            robot = status.record.id
            plans = await self._store.query(
                lambda session, robot=robot: query.list_plans(session, robot=robot, limit=20)
            )
            for plan in reversed(plans):
                self._take_in_hand(plan)
                self._note_next(plan)
                self._bus.publish(PlanSeen(plan))

    def take(self, event: PlanChanged) -> None:
        """Take that a plan was changed in the database, in whosever transaction."""
        plan = event.plan
        if plan.state != "planning":
            self._progress.pop(plan.id, None)
        self._take_in_hand(plan)
        self._note_next(plan)

    def _note_next(self, plan: PlanRecord) -> None:
        """Keep which plan waits on board; it is in hand once nothing else is flown."""
        status = self._fleet.status(plan.robot)
        known = status.next_plan
        if plan.state == "waiting":
            self._fleet.set_next_plan(plan.robot, plan)
        elif known is not None and known.id == plan.id:
            self._fleet.set_next_plan(plan.robot, None)
        waiting, hand = status.next_plan, status.plan
        if waiting is not None and (hand is None or hand.state in ENDED_STATES):
            self._fleet.set_plan(plan.robot, in_hand(waiting))

    async def add(
        self,
        robot: str,
        kind: str,
        *,
        config: Mapping[str, Any],
        config_id: str | None,
        by: str,
        mission: str | None = None,
        round_number: int = 1,
        document: Mapping[str, Any] | None = None,
    ) -> PlanRecord:
        """Add a plan that is about to be planned, with what is known of it already."""
        at = self._clock.now()
        known = {"config_id": config_id, "message": "", **(document or {})}

        def write(session: Session) -> PlanRecord:
            plan = query.add_plan(
                session,
                robot,
                kind,
                config=config,
                at=at,
                by=by,
                mission=mission,
                round_number=round_number,
            )
            return begin(session, plan, known, at)

        return await self._store.write(write)

    async def move(
        self,
        plan: str,
        evidence: PlanEvidence,
        text: str,
        document: Mapping[str, Any] | None = None,
    ) -> PlanRecord:
        """Move a plan by evidence, as of ``server.plan.state``.

        Raises:
            PlanStateError: If it leads nowhere from the plan's state; nothing is changed.
            UnknownIdError: If there is no such plan.
        """
        at = self._clock.now()
        return await self._store.write(
            lambda session: apply(session, plan, evidence, text, at, document=document)
        )

    async def note(
        self,
        plan: str,
        document: Mapping[str, Any],
        *,
        only_from: tuple[str, ...],
        sha256: str | None = None,
    ) -> PlanRecord:
        """Keep more about a plan whose state does not change.

        Raises:
            PlanStateError: If it is not in one of ``only_from``; nothing is changed.
            UnknownIdError: If there is no such plan.
        """
        at = self._clock.now()
        return await self._store.write(
            lambda session: note(session, plan, document, at, only_from=only_from, sha256=sha256)
        )

    async def log_event(self, plan: PlanRecord, event: str, text: str) -> None:
        """Write down what happened on a flight that moves no state."""
        at = self._clock.now()
        await self._store.write(
            lambda session: add_event(
                session, at, event, text, robot=plan.robot, data={"plan": plan.id}
            )
        )

    async def is_taken(self, plan: PlanRecord, sha256: str) -> bool:
        """Tell whether another plan of the robot has this name."""
        found = await self._store.query(
            lambda session: query.plan_by_hash(session, plan.robot, sha256)
        )
        return found is not None and found.id != plan.id

    async def make_draft(
        self, plan: str, text: str, document: Mapping[str, Any], *, replaces: str | None
    ) -> PlanRecord:
        """Make a plan a draft, and end the draft whose place it takes, both or neither.

        Args:
            plan: A plan that is being made, with its legs and its hash already.
            text: What the event says.
            document: Parts of the document that are new.
            replaces: The draft that it takes the place of.

        Raises:
            PlanStateError: If the plan was ended meanwhile, or the other is no draft any more;
                nothing is changed.
            UnknownIdError: If there is no such plan.
        """
        at = self._clock.now()

        def write(session: Session) -> PlanRecord:
            if replaces is not None:
                ended = f"{plan} took the place of {replaces}."
                why = {"message": ended}
                apply(session, replaces, PlanEvidence.REPLACED, ended, at, document=why)
            return apply(session, plan, PlanEvidence.MADE, text, at, document=document)

        return await self._store.write(write)

    async def advance(
        self,
        plan: str,
        evidence: PlanEvidence,
        text: str,
        document: Mapping[str, Any] | None = None,
    ) -> None:
        """Move a plan by evidence, unless someone was faster and it is further already."""
        with suppress(PlanStateError):
            await self.move(plan, evidence, text, document)

    async def get(self, plan: str) -> PlanRecord:
        """Return a plan.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        return await self._store.query(lambda session: query.get_plan(session, plan))

    async def of_robot(self, robot: str, states: tuple[str, ...]) -> list[PlanRecord]:
        """Return the plans of a robot that are in one of these states, the newest first."""
        return await self._store.query(
            lambda session: query.list_plans(session, robot=robot, states=states)
        )

    def view(self, plan: PlanRecord) -> PlanView:
        """Return a plan as REST says it."""
        status = self._fleet.status(plan.robot)
        progress, outdated = self._progress.get(plan.id), self._outdated(plan)
        view = plan_view(plan, progress, status.plan_report, outdated)
        view = replace(view, onboard=self._followed(plan, view.onboard))
        if not self._is_rehearsed_again(plan):
            return view
        last = view.rehearsal or WORKING
        return replace(view, stage="rehearsing", rehearsal=replace(last, state=WORKING.state))

    def live_view(self, plan: PlanRecord) -> LivePlanView:
        """Return what the live stream says of a plan."""
        report = self._fleet.status(plan.robot).plan_report
        progress, outdated = self._progress.get(plan.id), self._outdated(plan)
        view = live_plan_view(plan, progress, report, outdated)
        stage = "rehearsing" if self._is_rehearsed_again(plan) else view.stage
        onboard = self._followed(plan, view.onboard)
        return replace(view, stage=stage, onboard=onboard, transfer=self._transfers.get(plan.id))

    def _followed(self, plan: PlanRecord, onboard: OnboardView | None) -> OnboardView | None:
        """Return what a robot says of a plan, with how far it says to be from the leg it flies."""
        status = self._fleet.status(plan.robot)
        state, hand, leg = status.state, status.plan, status.leg_now
        is_flown = hand is not None and hand.plan_id == plan.id and plan.state == "running"
        if onboard is None or hand is None or not is_flown or leg is None or state is None:
            return onboard
        if leg >= len(hand.legs) or not is_on_leg(state.mode, hand.legs[leg]):
            return onboard
        off_m = off_track_m(hand.expected, hand.legs, leg, state.position_ned[:2])
        return replace(onboard, off_track_m=round(off_m, 2))

    def set_progress(self, plan: PlanRecord, progress: ProgressView | None) -> None:
        """Say how far planning is; ``None`` when it has ended."""
        newest = self._newest(plan)
        if progress is None:
            self._progress.pop(plan.id, None)
        elif newest.state == "planning":
            self._progress[plan.id] = progress
        self._bus.publish(PlanSeen(newest))

    def set_rehearsing(self, plan: PlanRecord, *, is_on: bool) -> None:
        """Say whether a draft is flown ahead once more; its document keeps the last dry run."""
        if is_on == (plan.id in self._rehearsing):
            return
        if is_on:
            self._rehearsing.add(plan.id)
        else:
            self._rehearsing.discard(plan.id)
        self._bus.publish(PlanSeen(self._newest(plan)))

    def _is_rehearsed_again(self, plan: PlanRecord) -> bool:
        return plan.state == "draft" and plan.id in self._rehearsing

    def set_transfer(self, plan: PlanRecord, transfer: TransferView) -> None:
        """Say how far a plan is on its way."""
        if self._transfers.get(plan.id) != transfer:
            self._transfers.pop(plan.id, None)
            self._transfers[plan.id] = transfer
            if len(self._transfers) > PARTS_PER_SECTION:
                del self._transfers[next(iter(self._transfers))]
            self._bus.publish(PlanSeen(self._newest(plan)))

    def _newest(self, plan: PlanRecord) -> PlanRecord:
        """Return a plan as it was committed last, if it is in hand; the one given may be older."""
        hand = self._fleet.status(plan.robot).plan
        return hand.record if hand is not None and hand.plan_id == plan.id else plan

    def robot_said_more(self, robot: str) -> None:
        """Take that a robot got further with the plan on board."""
        hand = self._fleet.status(robot).plan
        if hand is not None:
            self._bus.publish(PlanSeen(hand.record))

    def robot_changed(self, robot: str) -> None:
        """Take that a robot may have moved: away from where its plan begins, or along it."""
        hand = self._fleet.status(robot).plan
        if hand is None:
            return
        is_watched = hand.state in SENDABLE or robot in self._said_outdated
        if is_watched or hand.state == "running":
            self._looks.wake(robot)

    async def watch_drafts(self) -> None:
        """Tell everyone when a plan that waits no longer fits its robot, and how one is followed.

        It goes on until it is cancelled.
        """
        while True:
            for robot in await self._looks.next():
                hand = self._fleet.status(robot).plan
                if hand is not None:
                    self._look_at(robot, hand.record)

    def _look_at(self, robot: str, plan: PlanRecord) -> None:
        outdated = self._outdated(plan)
        self._looks.set_due(robot, ages_at(plan, self._clock.now()))
        if self._said_outdated.pop(robot, ()) != outdated:
            self._bus.publish(PlanSeen(plan), PlanOutdated(robot))
        if outdated:
            self._said_outdated[robot] = outdated
        onboard = self.live_view(plan).onboard
        off_m = None if onboard is None else onboard.off_track_m
        if self._said_off_m.pop(robot, None) != off_m:
            self._bus.publish(PlanSeen(plan))
        if off_m is not None:
            self._said_off_m[robot] = off_m

    def _outdated(self, plan: PlanRecord) -> tuple[ViolationView, ...]:
        """Return why a plan that waits no longer fits its robot.

        One that begins where the robot's flight is about to end is not held against it before.
        """
        status = self._fleet.status(plan.robot)
        flown = status.plan
        if (
            flown is not None
            and flown.state == "running"
            and flown.plan_id == plan.document.get(AHEAD_OF)
        ):
            return ()
        return outdated_by(status, plan, self._clock.now())

    def _take_in_hand(self, plan: PlanRecord) -> None:
        hand = self._fleet.status(plan.robot).plan
        flies_another = hand is not None and hand.state == "running" and hand.plan_id != plan.id
        if flies_another and plan.state in ("sent", "waiting"):
            return  # it comes behind the one that is flown
        if (
            hand is None
            or hand.plan_id == plan.id
            or plan.state in ON_THE_WAY
            or (hand.state not in ON_THE_WAY and plan.created_at >= hand.record.created_at)
        ):
            self._fleet.set_plan(plan.robot, in_hand(plan))


def in_hand(plan: PlanRecord) -> PlanInHand:
    """Return a plan with its legs and points unpacked."""
    return PlanInHand(
        record=plan,
        legs=legs_of(plan.document),
        points=points_of(plan.document),
        round_text=_round_text(plan),
        expected=expected_of(plan.document),
        expected_ends_s=expected_ends_s(plan.document),
        swim_speed_m_s=plan.config.get("primitives", {}).get("swim_speed_m_s"),
    )


def _round_text(plan: PlanRecord) -> str:
    if plan.mission is None:
        return ""
    rounds = math.ceil(plan.config["total_budget"] / plan.config["round_budget"])
    return f"round {plan.round} of {max(rounds, plan.round)}"
