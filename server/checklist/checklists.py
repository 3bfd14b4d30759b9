"""Runs of robots through their checklists: begun, ticked, completed, overruled, expired."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.query.fleet.deployments import deployment_in_water
from db.query.mission import checklists as query
from db.query.mission.checklists import ChecklistRun, Tick
from db.query.station.events import add_event
from robot_link.checklist_config import ChecklistConfig
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, conflict, unprocessable
from server.base.retry_queue import until_stored
from server.base.wakeups import Wakeups
from server.checklist.check import Finding, Situation
from server.checklist.judging import (
    ItemStanding,
    findings_of,
    kept,
    listed,
    open_blocking,
    standing_of,
    why_over,
)
from server.checklist.state import RunEvidence, apply, told
from server.checklist.template import ChecklistItem, ChecklistTemplate, template_of
from server.checklist.templates import KnownTemplate, Templates
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.fleet.panel import FleetViews
from server.fleet.status import RobotStatus

log = logging.getLogger(__name__)
_REST_S: Final = 0.5
_NO_RUN: Final = "not begun"


@dataclass(frozen=True, slots=True)
class ListStanding:
    """A robot's list now: its newest run, or that there is none that counts."""

    known: KnownTemplate
    """As it is today; a run keeps the version that it was begun with."""
    run: ChecklistRun | None
    items: list[ItemStanding]

    @property
    def state(self) -> str:
        """State of the run; "not begun" without one."""
        return _NO_RUN if self.run is None else self.run.state

    @property
    def template(self) -> ChecklistTemplate:
        """The version that counts."""
        return self.known.template if self.run is None else template_of(self.run.document)

    @property
    def open_now(self) -> list[ItemStanding]:
        """Blocking items that are open now, but those against which it was overruled."""
        overruled = ()
        if self.run is not None and self.run.state == "overruled":
            overruled = self.run.found.get("open", ())
        return [one for one in open_blocking(self.items) if one.item.key not in overruled]

    @property
    def open_items(self) -> list[ItemStanding]:
        """Everything that is left to do, what blocks and what does not."""
        return [one for one in self.items if not one.is_done]

    @property
    def words(self) -> str:
        """How it stands, in one sentence."""
        run, missing = self.run, self.open_now
        count = "1 blocking item is" if len(missing) == 1 else f"{len(missing)} blocking items are"
        if run is None:
            return "It was not begun."
        if run.state == "open":
            return f"{count} open." if missing else "Nothing that blocks is open; complete it."
        who = f"{run.settled_by} {'completed' if run.state == 'complete' else 'overruled'} it"
        why = f": {run.reason.rstrip('.')}" if run.reason else ""
        if missing:
            return f"{who}{why}. Since then {count} open again."
        return f"{who}{why}."

    @property
    def lets_start(self) -> bool:
        """Whether a plan may be started, as far as this list goes."""
        is_settled = self.run is not None and self.run.state in ("complete", "overruled")
        return is_settled and not self.open_now


class Checklists:
    """The runs of a station's robots. Belongs to one event loop."""

    def __init__(
        self, foundation: Foundation, fleet: Fleet, views: FleetViews, templates: Templates
    ) -> None:
        self._store = foundation.store
        self._clock = foundation.clock
        self._alarms = foundation.alarms
        self._configurations = foundation.configurations
        self._fleet = fleet
        self._views = views
        self._templates = templates
        self._looks = Wakeups(foundation.clock, _REST_S)

    async def load(self) -> None:
        """Take up what stood when the station stopped."""
        for run in await self._store.query(query.standing_runs):
            self._looks.wake(run.robot)

    def wake(self, robot: str | None) -> None:
        """Look again at whether a robot's runs still count: a deployment may have ended."""
        if robot is not None and self._fleet.knows(robot):
            self._looks.wake(robot)

    async def run(self) -> None:
        """End the runs that count no more, until cancelled."""
        while True:
            for robot in await self._looks.next():
                await until_stored(
                    f"checklists of {robot}", lambda robot=robot: self._expire(robot)
                )

    async def demand(self, robot: str) -> str:
        """Return what a start asks of a robot's lists: ``off``, ``told`` or ``required``."""
        current = await self._configurations.current("checklist", robot)
        return current.value_as(ChecklistConfig).start

    def situation(self, robot: str) -> Situation:
        """Return all that the checks look at, of one robot, as it is now."""
        standing = [
            (alarm.level, alarm.text)
            for alarm in self._alarms.open
            if alarm.robot == robot and alarm.cleared_at is None
        ]
        return Situation(
            self._fleet.status(robot),
            self._views.state_view(robot).channels,
            standing,
            self._clock.now(),
            self._clock.speed,
        )

    def applying(self, robot: str) -> list[KnownTemplate]:
        """Return the templates that a robot goes through."""
        status = self._fleet.status(robot)
        return [] if status.record.system_id is None else self._templates.applying(status.record)

    async def standing(self, robot: str) -> list[ListStanding]:
        """Return how each of a robot's lists stands now.

        Raises:
            UnknownIdError: If there is no such robot.
        """
        lists = self.applying(robot)

        def read(session: Session) -> list[tuple[ChecklistRun, list[Tick]]]:
            runs = query.standing_runs(session, robot)
            return [(run, query.ticks_of(session, run.id)) for run in runs]

        runs = {run.template: (run, ticks) for run, ticks in await self._store.query(read)}
        known = [one.key for one in lists]
        for key in runs:
            if key not in known:
                lists += [self._entry_of(runs[key][0])]
        situation = self.situation(robot)
        return [self._stands(one, situation, *runs.get(one.key, (None, []))) for one in lists]

    def _stands(
        self,
        known: KnownTemplate,
        situation: Situation,
        run: ChecklistRun | None,
        ticks: Sequence[Tick],
    ) -> ListStanding:
        """Return how a list stands by a run of it; one that is over is as none."""
        template = known.template if run is None else template_of(run.document)
        if run is not None and why_over(
            run, template.act, _deployment(situation.status), situation.now
        ):
            run, ticks, template = None, (), known.template
        findings = findings_of(template, situation)
        items = standing_of(template, findings, ticks, is_flying=is_flying(situation.status))
        return ListStanding(known, run, items)

    async def begin(self, robot: str, template: str, *, by: str) -> ChecklistRun:
        """Begin a run through a list; one that was settled before counts no more.

        Raises:
            UnknownIdError: If there is no such robot.
            Problem: 404 if there is no such list; 409 for a recording, a list that is not of this
                robot, or one that is open.
        """
        status = self._fleet.status(robot)
        refuse_recording(status, "goes through no checklist")
        known = self._templates.get(template)
        if known.key not in [one.key for one in self.applying(robot)]:
            water = status.record.site.kind
            raise conflict(f"{known.template.title} is not for {robot} in a {water}.")
        at, deployment = self._clock.now(), _deployment(status)

        def write(session: Session) -> ChecklistRun:
            for run in query.standing_runs(session, robot):
                if run.template != template:
                    continue
                act = template_of(run.document).act
                if run.state == "open" and not why_over(run, act, deployment, at):
                    raise conflict(f"{known.template.title} of {robot} is open already: {run.id}.")
                text = f"{by} begins {known.template.title} of {robot} anew."
                apply(session, run.id, RunEvidence.EXPIRED, text, at, reason="begun anew")
            return begin_run(session, known, robot, deployment, at, by)

        return await self._store.write(write)

    async def tick(
        self, run: str, item: str, *, is_ticked: bool, note: str, by: str
    ) -> ChecklistRun:
        """Tick an item, or untick it; what was ticked before is kept.

        Raises:
            UnknownIdError: If there is no such run.
            Problem: 409 if the run has expired; 422 if it has no such item, or a robot answers it.
        """
        at = self._clock.now()

        def write(session: Session) -> ChecklistRun:
            record = query.get_run(session, run)
            wanted = _manual_item(template_of(record.document), item)
            self._refuse_over(session, record)
            before = [one for one in query.ticks_of(session, run) if one.item == item]
            is_same = bool(before) and (before[-1].is_ticked, before[-1].note) == (is_ticked, note)
            if is_same or (not before and not is_ticked):
                return record
            query.add_tick(session, run, Tick(item, is_ticked, at, by, note))
            verb = "ticked" if is_ticked else "unticked"
            text = f"{by} {verb} for {record.robot}: {wanted.text}" + (f" ({note})" if note else "")
            data = {"checklist": run, "item": item, "note": note}
            add_event(session, at, f"checklist.{verb}", text, robot=record.robot, data=data)
            if not is_ticked and wanted.blocking and record.state == "complete":
                again = f"{wanted.text}: {by} unticked it, {record.robot} has an open item again."
                return apply(session, run, RunEvidence.UNTICKED, again, at)
            return told(session, record)

        return await self._store.write(write)

    async def complete(self, run: str, *, by: str) -> ChecklistRun:
        """Complete a run: its automatic values are kept as they are at this moment.

        Raises:
            UnknownIdError: If there is no such run.
            Problem: 409 if a blocking item is open, listed; or the run is not open.
        """
        found = await self._judged(run)
        at = self._clock.now()

        def write(session: Session) -> ChecklistRun:
            record = query.get_run(session, run)
            self._refuse_over(session, record)
            template = template_of(record.document)
            items = standing_of(template, found, query.ticks_of(session, run))
            if missing := open_blocking(items):
                raise refusal(template, record.robot, missing, record.state)
            left = [one for one in items if not one.is_done]
            warning = f" Left open: {listed(left)}." if left else ""
            text = f"{by} completed {template.title} of {record.robot}.{warning}"
            return apply(session, run, RunEvidence.COMPLETED, text, at, by=by, found=kept(items))

        return await self._store.write(write)

    async def overrule(self, run: str, reason: str, *, by: str) -> ChecklistRun:
        """Let plans be started although items of a run are open, with a reason that is logged.

        Raises:
            UnknownIdError: If there is no such run.
            Problem: 409 if nothing is open, or the run has expired.
        """
        found = await self._judged(run)
        at = self._clock.now()

        def write(session: Session) -> ChecklistRun:
            record = query.get_run(session, run)
            self._refuse_over(session, record)
            template = template_of(record.document)
            items = standing_of(template, found, query.ticks_of(session, run))
            if not open_blocking(items):
                raise conflict(f"{template.title} has no open blocking item; complete it.")
            return overrule_run(session, record, items, reason, at, by)

        return await self._store.write(write)

    async def _judged(self, run: str) -> Mapping[str, Finding]:
        record = await self._store.query(lambda session: query.get_run(session, run))
        return findings_of(template_of(record.document), self.situation(record.robot))

    def _refuse_over(self, session: Session, run: ChecklistRun) -> None:
        act = template_of(run.document).act
        why = why_over(run, act, _deployment_now(session, run.robot), self._clock.now())
        if run.ended_at is not None or why:
            raise conflict(f"{run.id} has expired: {why or run.reason}; begin the list anew.")

    @staticmethod
    def _entry_of(run: ChecklistRun) -> KnownTemplate:
        """Return the list of a run that does not apply to its robot any more, as it was begun."""
        return KnownTemplate(run.template, template_of(run.document), run.version, "own")

    async def _expire(self, robot: str) -> None:
        if not self._fleet.knows(robot):
            return
        now = self._clock.now()

        def write(session: Session) -> list[datetime]:
            deployment, due = _deployment_now(session, robot), list[datetime]()
            for run in query.standing_runs(session, robot):
                template = template_of(run.document)
                if why := why_over(run, template.act, deployment, now):
                    text = f"{template.title} of {robot} counts no more: {why}."
                    apply(session, run.id, RunEvidence.EXPIRED, text, now, reason=why)
                elif run.expires_at is not None:
                    due.append(run.expires_at)
            return due

        try:
            self._looks.set_due(robot, min(await self._store.write(write), default=None))
        except UnknownIdError:
            log.info("%s is gone", robot)


def is_flying(status: RobotStatus) -> bool:
    """Tell whether a robot says that it flies the plan that the station shows."""
    return status.leg_now is not None


def begin_run(
    session: Session,
    known: KnownTemplate,
    robot: str,
    deployment: str | None,
    at: datetime,
    by: str,
) -> ChecklistRun:
    """Add a run, with its event."""
    template = known.template
    hours = timedelta(hours=template.valid_h)
    run = query.add_run(
        session,
        robot,
        known.key,
        known.version,
        template.model_dump(mode="json"),
        deployment=deployment,
        at=at,
        by=by,
        expires_at=at + hours if hours else None,
    )
    text = f"{by} begins {template.title} of {robot}."
    data = {"checklist": run.id, "template": known.key}
    add_event(session, at, "checklist.begun", text, robot=robot, data=data)
    return told(session, run)


def overrule_run(
    session: Session,
    run: ChecklistRun,
    items: Sequence[ItemStanding],
    reason: str,
    at: datetime,
    by: str,
) -> ChecklistRun:
    """Overrule what is open in a run, with its event."""
    title = template_of(run.document).title
    text = (
        f"{by} overruled {title} of {run.robot}: {reason.rstrip('.')}. Open: "
        f"{listed(open_blocking(items)) or 'nothing but its completion'}."
    )
    return apply(
        session, run.id, RunEvidence.OVERRULED, text, at, by=by, reason=reason, found=kept(items)
    )  # fmt: skip


def refusal(
    template: ChecklistTemplate, robot: str, missing: Sequence[ItemStanding], state: str
) -> Problem:
    """Return the 409 that lists what is open."""
    count = "1 blocking item is" if len(missing) == 1 else f"{len(missing)} blocking items are"
    was = " although it was complete" if state == "complete" else ""
    text = f"{template.title} of {robot}: {count} open{was}: {listed(missing)}."
    errors = [FieldError(loc=["checklist", one.item.key], msg=one.words_if_open) for one in missing]
    return conflict(text, errors)


def _manual_item(template: ChecklistTemplate, key: str) -> ChecklistItem:
    item = next((one for one in template.items if one.key == key), None)
    if item is None or item.kind != "manual":
        manual = ", ".join(one.key for one in template.items if one.kind == "manual")
        fault = "is answered by the robot" if item is not None else "is no item of this list"
        message = f"{key!r} {fault}; people tick {manual}"
        raise unprocessable("1 field is wrong.", [FieldError(loc=["item"], msg=message)])
    return item


def _deployment(status: RobotStatus) -> str | None:
    return None if status.deployment is None else status.deployment.id


def _deployment_now(session: Session, robot: str) -> str | None:
    """Return it as kept: the fleet hears only after the commit that a robot was let in."""
    found = deployment_in_water(session, robot)
    return None if found is None else found.id
