"""What robots say of the plans on board, as evidence for the station's plans."""

import math
from bisect import bisect_right
from contextlib import suppress
from dataclasses import asdict, replace
from datetime import timedelta

from sqlalchemy.orm import Session

from db.query.measured.telemetry import flown_legs, newest_plan_report, track
from db.query.mission.plans import PlanRecord, PlanStateError, plan_by_hash
from db.store import Store
from robot_link.messages import (
    SURFACED_BY_COMMAND,
    OnboardPlanState,
    PlanHash,
    PlanQueue,
    PlanReport,
)
from server.base.retry_queue import RetryQueue
from server.fleet.status import FOLLOW_TARGET
from server.fleet.words import TEACHING
from server.plan.document import legs_of, onboard_by, teaches
from server.plan.expected import expected_of, is_on_leg, off_track_m
from server.plan.ledger import PlanLedger
from server.plan.state import PlanEvidence, leads_on
from server.plan.view import OnboardView

_SAID = {
    OnboardPlanState.ON_BOARD: PlanEvidence.ROBOT_HAS_IT,
    OnboardPlanState.RUNNING: PlanEvidence.ROBOT_FLIES_IT,
    OnboardPlanState.DONE: PlanEvidence.ROBOT_IS_DONE,
    OnboardPlanState.FAILED: PlanEvidence.ROBOT_GAVE_UP,
}
_ROUNDED = timedelta(seconds=2)
"""What the times of two words of a robot may be off, one of them by satellite."""
_MOMENTS_MAX = 5000
"""Of a flight, to be held against its track."""
_OVERSPENT = 0.05
"""Energy units beyond the account that are worth a word."""


class PlanFollower:
    """Hands plan reports on as evidence, in order. Belongs to one event loop."""

    def __init__(self, store: Store, ledger: PlanLedger) -> None:
        self._store = store
        self._ledger = ledger
        self._queue = RetryQueue("plan reports")
        self._heard: dict[str, tuple[str | None, OnboardPlanState]] = {}
        self._queues: dict[str, tuple[object, ...]] = {}
        self._flying: dict[str, PlanReport] = {}
        """The newest of each robot that said that it flies a plan."""
        self._came_up: dict[str, tuple[str | None, set[str]]] = {}
        """Plan of each robot, and which dives of it were told to have ended early."""

    async def run(self) -> None:
        """Follow until cancelled."""
        await self._queue.run()

    def take(self, report: PlanReport) -> None:
        """Take a report; robots repeat themselves, and only news is worked on."""
        if report.state is OnboardPlanState.RUNNING:
            self._flying[report.robot] = report
        news = (report.sha256, report.state)
        if self._heard.get(report.robot) != news:
            self._heard[report.robot] = news
            self._queue.add(lambda: self._follow(report))
        if report.state is OnboardPlanState.RUNNING and report.reason:
            sha256, told = self._came_up.get(report.robot, (None, set[str]()))
            if sha256 != report.sha256:
                told = set[str]()
            if _ended_leg(report) not in told:
                self._came_up[report.robot] = report.sha256, told | {_ended_leg(report)}
                self._queue.add(lambda: self._tell_early(report))
        self._ledger.robot_said_more(report.robot)

    def take_queue(self, queue: PlanQueue) -> None:
        """Take what a robot says of the plans beside the one on board."""
        news = (queue.sha256, queue.next_sha256, queue.next_starts, queue.last_sha256)
        if self._queues.get(queue.robot) != news:
            self._queues[queue.robot] = news
            self._queue.add(lambda: self._follow_queue(queue))

    async def _tell_early(self, report: PlanReport) -> None:
        """Tell that a dive ended early, and why; the plan goes on with the next."""
        sha256 = report.sha256
        if sha256 is None:
            return
        plan = await self._store.query(lambda session: plan_by_hash(session, report.robot, sha256))
        if plan is None:
            return
        text = f"{report.robot} came up early in {plan.id}: {report.reason}."
        await self._ledger.log_event(plan, "plan.came_up", text)

    async def _follow_queue(self, queue: PlanQueue) -> None:
        await self._ended_before(queue)
        following = queue.next_sha256
        plan = None
        if following is not None:
            plan = await self._store.query(lambda s: plan_by_hash(s, queue.robot, following))
        if plan is not None and leads_on(plan.state, PlanEvidence.ROBOT_KEEPS_IT):
            text = f"{plan.id} waits on board of {plan.robot} for the next surfacing."
            await self._ledger.advance(plan.id, PlanEvidence.ROBOT_KEEPS_IT, text)
        for other in await self._ledger.of_robot(queue.robot, ("waiting",)):
            came_later = other.waiting_at is not None and other.waiting_at > queue.received_at
            is_named = other.sha256 in (queue.next_sha256, queue.sha256)
            if not came_later and not is_named:
                text = f"{other.robot} keeps {other.id} waiting no longer; it is a draft again."
                await self._end(other, PlanEvidence.ROBOT_DROPPED_IT, text)
        self._ledger.robot_said_more(queue.robot)

    async def _ended_before(self, queue: PlanQueue) -> None:
        """Take how the plan ended whose place the one on board took."""
        last = queue.last_sha256
        if last is None:
            return
        plan = await self._store.query(lambda s: plan_by_hash(s, queue.robot, last))
        if plan is None:
            return
        if queue.last_done:
            text = f"{plan.robot} {_completed(plan)} before it began the next."
            await self._ledger.advance(plan.id, PlanEvidence.ROBOT_HAD_FLOWN_IT, text)
            with suppress(PlanStateError):  # ended as superseded: this word was lost until now
                message = {"message": text}
                await self._ledger.note(plan.id, message, only_from=("superseded",))
        else:
            text = f"{plan.robot} ended {plan.id} at a surfacing and flies the plan that waited."
            await self._end(plan, PlanEvidence.ROBOT_CHANGED_OVER, text)

    async def _follow(self, report: PlanReport) -> None:
        said = _evidence_of(report)
        if said is None or report.sha256 is None:
            await self._lost(report)
            return
        sha256 = report.sha256
        plan = await self._store.query(lambda session: plan_by_hash(session, report.robot, sha256))
        if plan is not None and leads_on(plan.state, said):
            await self._advance(plan, said, report)
        elif plan is not None and (plan.state, said) == ("running", PlanEvidence.ROBOT_HAS_IT):
            await self._interrupted(plan, report)
        await self._supersede(report, None if plan is None else plan.id)

    async def _advance(self, plan: PlanRecord, said: PlanEvidence, report: PlanReport) -> None:
        onboard = onboard_by(plan, report)
        mark = f" ({TEACHING})" if teaches(plan) else ""
        texts = {
            PlanEvidence.ROBOT_HAS_IT: f"{plan.robot} has {plan.id} on board.",
            PlanEvidence.ROBOT_FLIES_IT: f"{plan.robot} flies {plan.id}{mark}.",
            PlanEvidence.ROBOT_IS_DONE: f"{plan.robot} {_completed(plan)}{_overspending(onboard)}.",
            PlanEvidence.ROBOT_GAVE_UP: f"{plan.robot} ended {plan.id} early: "
            f"{report.reason or 'no reason given'}",
            PlanEvidence.ROBOT_SURFACED: f"{plan.robot} came up as ordered; that ended {plan.id}.",
        }
        if said is PlanEvidence.ROBOT_IS_DONE:
            off_m = await self._store.query(lambda session: flown_off_m(session, plan))
            onboard = replace(onboard, off_track_rms_m=off_m)
            if off_m is not None:
                off = f"by its own word {off_m:.2g} m (rms) beside its track"
                texts[said] = f"{texts[said][:-1]}, {off}."
        document: dict[str, object] = {"onboard": asdict(onboard)}
        if said in {PlanEvidence.ROBOT_GAVE_UP, PlanEvidence.ROBOT_SURFACED}:
            document["message"] = texts[said]
        if said in {PlanEvidence.ROBOT_FLIES_IT, PlanEvidence.ROBOT_IS_DONE}:
            has_it = PlanEvidence.ROBOT_HAS_IT
            await self._ledger.advance(plan.id, has_it, texts[has_it])
        await self._ledger.advance(plan.id, said, texts[said], document)

    async def _interrupted(self, plan: PlanRecord, report: PlanReport) -> None:
        """End a plan that waits on board again: its robot was switched off while it flew it."""
        flown = self._flying.get(plan.robot)
        if flown is None or flown.sha256 != plan.sha256:
            flown = await self._store.query(
                lambda session: newest_plan_report(session, plan.robot, flying=report.sha256)
            )
        if flown is None or report.measured_at <= flown.measured_at + _ROUNDED:
            return  # an older word that took longer
        text = f"{plan.robot} was switched off while it flew {plan.id}, and flies it no longer."
        restarted, onboard = PlanEvidence.ROBOT_RESTARTED, asdict(onboard_by(plan, flown))
        await self._end(plan, restarted, text, onboard=onboard)

    async def _supersede(self, report: PlanReport, holder: str | None) -> None:
        """End the plans that the robot no longer holds, now that it names another."""
        for plan in await self._ledger.of_robot(report.robot, ("on_board", "running")):
            came_later = plan.on_board_at is not None and plan.on_board_at > report.received_at
            if plan.id != holder and not came_later:
                text = f"{plan.robot} holds another plan now; {plan.id} ended."
                await self._end(plan, PlanEvidence.ROBOT_HOLDS_ANOTHER, text)

    async def _lost(self, report: PlanReport) -> None:
        """End the plans of a robot that says it holds none."""
        if report.state is not OnboardPlanState.NONE:
            return
        for plan in await self._ledger.of_robot(report.robot, ("on_board", "running")):
            text = f"{plan.robot} says that it no longer holds {plan.id}."
            await self._end(plan, PlanEvidence.ROBOT_HOLDS_NONE, text)

    async def _end(self, plan: PlanRecord, said: PlanEvidence, text: str, **more: object) -> None:
        await self._ledger.advance(plan.id, said, text, {"message": text, **more})


def flown_off_m(session: Session, plan: PlanRecord) -> float | None:
    """Return how far a robot said to be from the track of a plan that it flew, m.

    It is the root mean square over the moments of its legs, ``None`` where it told of none.
    """
    legs = legs_of(plan.document)
    if plan.running_at is None or plan.sha256 is None or not legs:
        return None
    words = flown_legs(session, plan.robot, PlanHash(plan.sha256))
    expected = expected_of(plan.document)
    flown = track(session, plan.robot, plan.running_at, max_points=_MOMENTS_MAX)
    begun_s = [moment.timestamp() for moment, _ in words]
    squares: list[float] = []
    for moment, place, mode in zip(
        flown.measured_at, flown.position_ned.tolist(), flown.mode, strict=True
    ):
        word = bisect_right(begun_s, moment.timestamp()) - 1
        leg = words[word][1] if word >= 0 else len(legs)
        if leg < len(legs) and is_on_leg(mode, legs[leg]):
            squares.append(off_track_m(expected, legs, leg, (place[0], place[1])) ** 2)
    return round(math.sqrt(sum(squares) / len(squares)), 3) if squares else None


def _evidence_of(report: PlanReport) -> PlanEvidence | None:
    """Return what a report proves of the plan that it names; a person's order is no failure."""
    if report.state is OnboardPlanState.FAILED and report.reason == SURFACED_BY_COMMAND:
        return PlanEvidence.ROBOT_SURFACED
    return _SAID.get(report.state)


def _ended_leg(report: PlanReport) -> str:
    """Return what tells one dive that ended early from the next: its leg, where that is said."""
    return report.reason.partition(",")[0]


def _completed(plan: PlanRecord) -> str:
    """Return what a robot did that reached a plan's end: only time ends a pursuit as planned."""
    if plan.kind == FOLLOW_TARGET:
        return f"followed the target of {plan.id} until its time was over"
    return f"flew {plan.id} to its end"


def _overspending(onboard: OnboardView) -> str:
    if onboard.overspent < _OVERSPENT:
        return ""
    return (
        f" and used {onboard.energy_used:.1f} energy units, "
        f"{onboard.overspent:.1f} more than planned"
    )
