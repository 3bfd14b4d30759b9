"""Suggestions: searched for at a surfacing or when asked, judged, and offered as a draft."""

import asyncio
import logging
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import legs_duration_s, legs_energy
from autonomy.planner.outcome import least_energy
from autonomy.planner.plan import ObjectivePoint
from autonomy.vehicle.trim import TrimConfig
from db.query.mission.missions import get_mission
from db.query.mission.plans import PlanRecord
from db.query.mission.scheduled_sends import waits_for_plan
from db.query.station.events import EventRecord, add_event, newest_of_kinds
from robot_link.dry_run import DryRunProblem
from robot_link.messages import LinkState
from robot_link.mission import Mission, MissionSettings
from server.base.decision.decisions import Cause
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import Problem, conflict
from server.base.worker import WORKER_FAILURES
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.link.moments import SURFACED
from server.map.field_maps import FieldMaps
from server.plan.document import search_document
from server.plan.dry_run import DryRuns
from server.plan.ledger import PlanLedger
from server.plan.planning import Planning
from server.plan.primitive_legs import candidate_of
from server.plan.search.request import SearchRequest, as_set
from server.plan.state import PlanChanged
from server.schedule.condition import AtTime, Condition, NextSurfacing
from server.schedule.replan.contacts import Contacts
from server.schedule.replan.decided import SUGGESTION
from server.schedule.replan.opportunity import Opportunity, opportunity_of
from server.schedule.replan.present import Present
from server.schedule.replan.problem import SuggestionFound, SuggestionProblem
from server.schedule.replan.told import SUGGESTED, Told, inputs_of, told_of
from server.schedule.replan.words import MEASURES, basis_text, gain_of, verdict_text
from server.schedule.schedule import Schedule

log = logging.getLogger(__name__)

STATION = "the station"
QUIET_S = 0.8
QUIET_LIMIT_S = 4.0
"""Wall time without a sample after which a dive's samples count as received, and the most."""
_SEARCHED = 0.7
"""Part of the job that is done once the search is."""
_SENT_WITHIN_S = 600.0
"""So long a suggestion may be sent by itself where nobody can say how long the robot stays."""


class Suggestions:
    """Suggestions for all robots. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        ledger: PlanLedger,
        planning: Planning,
        maps: FieldMaps,
        schedule: Schedule,
        contacts: Contacts,
    ) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._clock = foundation.clock
        self._fleet = fleet
        self._ledger = ledger
        self._planning = planning
        self._maps = maps
        self._schedule = schedule
        self._contacts = contacts
        self._dry_runs = DryRuns(fleet, foundation.workers)
        self._jobs = JobPerKey[str](foundation.jobs, "suggestion")
        self._told: dict[str, Told] = {}
        self._failed: dict[str, str] = {}
        """By robot, why the newest search came to nothing."""
        self._drafted: dict[str, asyncio.Event] = {}
        """Set once the plan is no longer being made."""

    async def load(self) -> None:
        """Take up the newest suggestion of each robot."""
        for status in list(self._fleet.statuses):
            robot = status.record.id
            last = await self._store.query(
                lambda session, robot=robot: newest_of_kinds(session, robot, (SUGGESTED,))
            )
            if last is not None:
                self._told[robot] = told_of(dict(last.data))

    def take_event(self, event: EventRecord) -> None:
        """Take that something happened: a robot that surfaced may be suggested for."""
        robot = event.robot
        if robot is None or event.kind != SURFACED or not self._fleet.knows(robot):
            return
        hand = self._fleet.status(robot).plan
        if hand is not None and hand.state == "running":
            work = self._at_surfacing(robot)
            self._foundation.background.start(f"suggestion for {robot}", work)

    def take_plan(self, event: PlanChanged) -> None:
        """Take that a plan changed."""
        if event.plan.state != "planning":
            drafted = self._drafted.get(event.plan.id)
            if drafted is not None:
                drafted.set()
        self._foundation.feed.mark("suggestion", event.plan.robot)

    def newest(self, robot: str) -> Told | None:
        """Return what the newest search for a robot came to, ``None`` before the first."""
        return self._told.get(robot)

    def failure(self, robot: str) -> str:
        """Return why the newest search came to nothing, "" if it did not."""
        return self._failed.get(robot, "")

    def job(self, robot: str) -> str | None:
        """Return the search under way."""
        return self._jobs.get(robot)

    async def opportunity(self, robot: str) -> Opportunity:
        """Return what can be suggested to a robot now.

        Raises:
            Problem: 404 if there is no such robot, 409 if nothing can be; the sentence says why.
        """
        status = self._fleet.status(robot)
        refuse_recording(status, "flies no plans")
        contact = await self._contacts.of(robot)
        planner = await self._foundation.configurations.current("planner", robot)
        planning_s = planner.value_as(PlannerConfig).planning_time_s
        speed = max(1.0, self._clock.speed)
        return opportunity_of(status, contact, self._clock.now(), speed, planning_s)

    async def ask(self, robot: str, *, by: str) -> str:
        """Begin to search; return the id of the job, that of the one under way if there is one.

        Raises:
            Problem: 404, 409 as of ``opportunity``, 503 while storage fails.
            StoreError: Nothing was begun.
        """
        self._planning.settings.refuse_while_storage_fails()
        chance = await self.opportunity(robot)
        config = PlannerConfig.model_validate(chance.present.plan.config)
        budget, least = legs_energy(config, chance.present.rest), least_energy(config)
        if budget < least:
            raise conflict(
                f"What is left of {chance.present.plan.id} is {budget:.3g} energy units; the "
                f"cheapest plan takes {least:.3g}."
            )

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            try:
                return await self._work(chance, progress, by)
            except JobError as error:
                self._failed[robot] = str(error)
                raise
            except asyncio.CancelledError:
                self._failed[robot] = "The search was cancelled; the present plan goes on."
                raise
            finally:
                self._foundation.feed.mark("suggestion", robot)

        job = await self._jobs.start(robot, work, by=by, robot=robot)
        self._foundation.feed.mark("suggestion", robot)
        return job

    async def _at_surfacing(self, robot: str) -> None:
        """Suggest at a surfacing if the robot's settings want it; silent where nothing can be."""
        if self._schedule.is_held:
            log.info("no suggestion for %s: automation is held", robot)
            return
        config = (await self._schedule.allowance(robot)).config
        hand = self._fleet.status(robot).plan
        if config.suggestions == "asked" or hand is None:
            return
        mission = hand.record.mission
        if mission is not None:
            record = await self._store.query(lambda session: get_mission(session, mission))
            if record.automation:
                return  # the survey plans its next round by itself
        try:
            await self.ask(robot, by=STATION)
        except Problem as problem:
            log.info("no suggestion for %s: %s", robot, problem.detail)

    async def _work(self, chance: Opportunity, progress: JobProgress, by: str) -> Mapping[str, Any]:
        present = chance.present
        robot = present.plan.robot
        self._failed.pop(robot, None)
        if present.surfacing == "now":
            progress.report(0.0, "Waiting for the last samples of the dive")
            await self._maps.quiet(robot, QUIET_S, QUIET_LIMIT_S)
            await self._maps.settle(robot)
        before = await self._replaced(robot)
        request = await self._request(chance, by, before)
        problem = await self._problem(chance, request)
        cause = Cause(robot, present.plan.id, {"planner": request.config_id})
        found = await self._search(problem, cause, chance.search_s, progress)
        gain = None
        if found.new is not None:
            gain = gain_of(request.config.objective, found.keep, found.new)
        told = await self._verdict(chance, problem, found, gain)
        best = found.result.best
        if told.verdict == "replace" and best is not None:
            progress.report(_SEARCHED, "The new plan is flown ahead")
            inputs = inputs_of(present, request.config.seed, chance.search_s)
            document = search_document(
                request.config.objective,
                found.result.message,
                best,
                found.result.runners_up,
                found.result.history,
            )
            plan = await self._drafted_of(
                await self._planning.take_candidate(
                    request, best, {**document, "suggestion": inputs}
                )
            )
            told = replace(told, plan=plan.id)
        await self._tell(robot, told)
        if told.plan is not None and by == STATION:
            await self._send(robot, told)
        return {"verdict": told.verdict, "plan": told.plan, "gain": told.gain}

    async def _replaced(self, robot: str) -> str | None:
        """Return the draft of the suggestion before, whose place the new one takes."""
        last = self._told.get(robot)
        if last is None or last.plan is None:
            return None
        plan = await self._ledger.get(last.plan)
        waits = await self._store.query(lambda session: waits_for_plan(session, plan.id))
        return plan.id if plan.state == "draft" and not waits else None

    async def _request(self, chance: Opportunity, by: str, replaces: str | None) -> SearchRequest:
        """Return the request of a round that spends what is left of the present plan."""
        present, plan = chance.present, chance.present.plan
        now = await self._foundation.configurations.current("planner", plan.robot)
        effort = {"planning_time_s": chance.search_s, "search": now.value_as(PlannerConfig).search}
        settings = as_set(plan).model_copy(update=effort)
        water = await self._planning.in_water(plan.robot, settings, chance.ahead_s)
        config = water.config
        if config.time_budget_s > 0.0:
            left_s = legs_duration_s(config, present.rest)
            config = config.model_copy(update={"time_budget_s": max(left_s, 1.0)})
        return SearchRequest(
            robot=plan.robot,
            config=config,
            config_id=plan.document["config_id"],
            by=by,
            round_number=plan.round,
            budget=legs_energy(config, present.rest),
            start_xy=present.begins_ne_m,
            attempt=plan.document.get("attempt", 0) + 1,
            replaces=replaces,
            settings_filter=settings.position_filter,
            current_text=water.text,
        )

    async def _problem(self, chance: Opportunity, request: SearchRequest) -> SuggestionProblem:
        present = chance.present
        survey = await self._planning.problems.survey(
            present.plan,
            request.config,
            present.begins_ne_m,
            request.energy,
            warm=(),
            attempt=request.attempt,
            flown=present.before,
        )
        return SuggestionProblem(survey, present.rest, await self._flight(present, request.config))

    async def _flight(self, present: Present, config: PlannerConfig) -> DryRunProblem | None:
        """Return the robot and the water in which both plans are flown ahead."""
        robot = present.plan.robot
        trim = (await self._foundation.configurations.current("trim", robot)).value_as(TrimConfig)
        candidate = await asyncio.to_thread(candidate_of, config, present.rest)
        first = present.rest[0].start_ned
        settings = MissionSettings.of(config, trim, first, candidate.duration_s)
        try:
            mission = Mission.from_legs(settings, present.rest)
        except ValueError as error:
            log.info("%s is judged as planned: %s", present.plan.id, error)
            return None
        found = self._dry_runs.problem(robot, mission, candidate.points, config)
        return None if found is None else replace(found, start_ne_m=present.begins_ne_m)

    async def _search(
        self, problem: SuggestionProblem, cause: Cause, search_s: float, progress: JobProgress
    ) -> SuggestionFound:
        def tell(point: ObjectivePoint) -> None:
            share = _SEARCHED * min(1.0, point.elapsed_s / search_s)
            progress.report(share, f"Searching: {point.candidates:,} plans seen")

        progress.report(0.0, "Searching")
        try:
            return await self._foundation.decisions.make(
                SUGGESTION, problem, cause, self._foundation.workers, on_progress=tell
            )
        except WORKER_FAILURES as error:
            raise JobError(f"Nothing was suggested: {error} The present plan goes on.") from error

    async def _verdict(
        self,
        chance: Opportunity,
        problem: SuggestionProblem,
        found: SuggestionFound,
        gain: float | None,
    ) -> Told:
        present, now = chance.present, self._clock.now()
        status = self._fleet.status(present.plan.robot)
        config = (await self._schedule.allowance(present.plan.robot)).config
        is_better = gain is not None and gain >= config.least_gain
        newest = _newest_at(problem)
        hand = status.plan
        return Told(
            verdict="replace" if is_better else "keep",
            text=verdict_text(
                present,
                found,
                gain,
                least_gain=config.least_gain,
                water=status.record.site.kind,
            )
            + _of_survey(present),
            basis=basis_text(
                present,
                found,
                newest_age_s=_age_s(newest, now),
                fix_age_s=_age_s(present.fix_at, now),
            ),
            measure=MEASURES[problem.survey.planner.objective],
            instead_of=present.plan.id,
            flown=present.plan.id if hand is None else hand.plan_id,
            leg=present.leg,
            surfacing=present.surfacing,
            begins_ne_m=present.begins_ne_m,
            gain=gain,
            keep=found.keep,
            new=found.new,
            samples=found.samples,
            plan=None,
            judged_at=now,
            fix_at=present.fix_at,
            fix_std_m=present.fix_std_m,
            newest_sample_at=newest,
            until=chance.until,
        )

    async def _drafted_of(self, plan: PlanRecord) -> PlanRecord:
        """Wait until a plan is a draft.

        Raises:
            JobError: It did not become one.
        """
        drafted = self._drafted[plan.id] = asyncio.Event()
        try:
            newest = await self._ledger.get(plan.id)
            if newest.state == "planning":
                await drafted.wait()
                newest = await self._ledger.get(plan.id)
        except asyncio.CancelledError:
            cancel = self._planning.cancel(plan.id, "The suggestion was cancelled.")
            self._foundation.background.start(f"cancel {plan.id}", _quietly(cancel))
            raise
        finally:
            del self._drafted[plan.id]
        if newest.state in {"failed", "cancelled"}:
            raise JobError(f"{plan.id} was not made: {newest.document.get('message', '')}")
        return newest

    async def _tell(self, robot: str, told: Told) -> None:
        """Keep a verdict: the event is what it is read from after a restart."""
        text, at, document = f"{robot}: {told.text}", self._clock.now(), told.document()
        await self._store.write(
            lambda session: add_event(session, at, SUGGESTED, text, robot=robot, data=document)
        )
        self._told[robot] = told

    async def _send(self, robot: str, told: Told) -> None:
        """Have a suggestion sent by itself if the robot's settings say so, within their limit."""
        config = (await self._schedule.allowance(robot)).config
        if config.suggestions != "sent" or told.plan is None:
            return
        status, now = self._fleet.status(robot), self._clock.now()
        soon = timedelta(seconds=max(1.0, self._clock.speed))
        condition: Condition = NextSurfacing()
        if told.surfacing == "now" or status.radio_state is LinkState.LIVE:
            condition = AtTime(kind="time", at=now + soon)
        expires_at = told.until or now + timedelta(seconds=_SENT_WITHIN_S)
        try:
            if expires_at <= now + soon:
                raise conflict(f"It came too late for this surfacing; {told.instead_of} goes on.")
            await self._schedule.add(
                told.plan,
                condition,
                expires_at=expires_at,
                start=True,
                route="auto",
                confirmed=False,
                by=STATION,
            )
        except Problem as problem:
            text, plan = f"{told.plan} is not sent by itself: {problem.detail}", told.plan
            await self._store.write(
                lambda session: add_event(
                    session, now, "plan.not_sent", text, level="watch", robot=robot,
                    data={"plan": plan},
                )
            )  # fmt: skip


def _newest_at(problem: SuggestionProblem) -> datetime | None:
    samples = problem.survey.samples
    return datetime.fromtimestamp(float(samples.time_s.max()), UTC) if len(samples) else None


def _age_s(moment: datetime | None, now: datetime) -> float | None:
    return None if moment is None else max(0.0, (now - moment).total_seconds())


def _of_survey(present: Present) -> str:
    mission = present.plan.mission
    if mission is None:
        return ""
    return f" It is a plan of its own: taking it stops {mission}, which a person can continue."


async def _quietly(work: Any) -> None:  # noqa: ANN401 - any coroutine
    try:
        await work
    except Problem as problem:
        log.info("nothing to cancel: %s", problem.detail)
