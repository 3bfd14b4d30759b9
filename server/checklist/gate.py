"""The gate of a start: a plan waits for the checklists that its robot's settings require.

Every way of starting a plan asks here (``server.transfer.transfers.Transfers``), in the transaction
that begins it, so that whoever unticks an item at the same moment comes before or after it. So does
the start of a deployment (``server.deployment.deployments.Deployments``), for the lists of a
launch. An order to surface is no start and never comes here.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from db.query.mission import checklists as query
from db.query.mission.checklists import ChecklistRun
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, conflict
from server.checklist.check import Finding
from server.checklist.checklists import (
    Checklists,
    begin_run,
    is_flying,
    overrule_run,
    refusal,
)
from server.checklist.judging import findings_of, open_blocking, standing_of, why_over
from server.checklist.template import GATING, LAUNCHING, ChecklistTemplate, template_of
from server.checklist.templates import KnownTemplate
from server.deployment.deployments import Launch
from server.fleet.fleet import Fleet


@dataclass(frozen=True, slots=True)
class Overrule:
    """Why a plan is started although an item is open, and by whom."""

    reason: str
    by: str


Pass = Callable[[Session], str]
"""Raises 409 in the transaction of a start; returns what is to be said of the plan, "" if nothing:
by whom which list was overruled."""


@dataclass(frozen=True, slots=True)
class _Judged:
    """What the checks found of a list, and by which document."""

    template: ChecklistTemplate
    findings: Mapping[str, Finding]


@dataclass(frozen=True, slots=True)
class _Look:
    """A robot at the moment in which it was asked to start."""

    robot: str
    lists: tuple[KnownTemplate, ...]
    now: datetime
    deployment: str | None
    is_flying: bool
    judged: Mapping[str, _Judged]
    """By run, and by template for lists without one."""


class StartGate:
    """Says whether a robot may start a plan. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet, checklists: Checklists) -> None:
        self._store = foundation.store
        self._fleet = fleet
        self._checklists = checklists

    async def look(
        self, robot: str, overrule: Overrule | None = None, acts: Collection[str] = GATING
    ) -> Pass:
        """Look at a robot now; what is returned is to be called in the transaction of the start.

        Args:
            robot: Whose plan is started.
            overrule: A person's word that it shall start all the same.
            acts: Whose lists are asked for.
        """
        lists = [one for one in self._checklists.applying(robot) if one.template.act in acts]
        if not lists or await self._checklists.demand(robot) != "required":
            return lambda _: ""
        runs = await self._store.query(lambda session: query.standing_runs(session, robot))
        situation = self._checklists.situation(robot)
        documents = {run.id: template_of(run.document) for run in runs}
        documents |= {one.key: one.template for one in lists}
        deployment = situation.status.deployment
        look = _Look(
            robot,
            tuple(lists),
            situation.now,
            None if deployment is None else deployment.id,
            is_flying(situation.status),
            {key: _Judged(one, findings_of(one, situation)) for key, one in documents.items()},
        )
        return lambda session: _pass(session, look, overrule)

    async def look_at_launch(self, robot: str, reason: str, by: str) -> Launch:
        """Look at a robot that is about to be launched, as a ``LaunchGate``.

        What was gone through in the workshop is of the deployment that begins: it ends with it.
        """
        passes = await self.look(robot, Overrule(reason, by) if reason else None, LAUNCHING)

        def launch(session: Session, deployment: str) -> str:
            said = passes(session)
            for run in query.standing_runs(session, robot):
                if run.deployment is None and template_of(run.document).act in GATING:
                    query.join_deployment(session, run.id, deployment)
            return said

        return launch


def _pass(session: Session, look: _Look, overrule: Overrule | None) -> str:
    """Refuse a start, or let it pass, in its own transaction."""
    runs = {
        run.template: run
        for run in query.standing_runs(session, look.robot)
        if not why_over(run, template_of(run.document).act, look.deployment, look.now)
    }
    faults: list[Problem] = []
    said: list[str] = []
    for known in look.lists:
        run = runs.get(known.key)
        try:
            said.append(_pass_list(session, look, known, run, overrule))
        except Problem as problem:
            faults.append(problem)
    if faults:
        errors: list[FieldError] = [one for fault in faults for one in fault.errors or ()]
        text = " ".join(fault.detail for fault in faults)
        raise conflict(f"{text} Complete it, or overrule it with a reason.", errors)
    return " ".join(one for one in said if one)


def _pass_list(
    session: Session,
    look: _Look,
    known: KnownTemplate,
    run: ChecklistRun | None,
    overrule: Overrule | None,
) -> str:
    judged = look.judged.get(known.key if run is None else run.id)
    if judged is None:
        raise conflict(f"{known.template.title} of {look.robot} was begun meanwhile; look again.")
    ticks = () if run is None else query.ticks_of(session, run.id)
    items = standing_of(judged.template, judged.findings, ticks, is_flying=look.is_flying)
    missing = open_blocking(items)
    if run is not None and run.state == "overruled":
        missing = [one for one in missing if one.item.key not in run.found["open"]]
    if run is not None and run.state in ("complete", "overruled") and not missing:
        return _said(run) if run.state == "overruled" else ""
    if overrule is None:
        if not missing:
            field = FieldError(loc=["checklist", known.key], msg="nobody has completed it")
            raise conflict(
                f"{judged.template.title} of {look.robot} is not completed: all blocking items are"
                " done.",
                [field],
            )
        raise refusal(judged.template, look.robot, missing, "" if run is None else run.state)
    if run is None:
        run = begin_run(session, known, look.robot, look.deployment, look.now, overrule.by)
    after = overrule_run(session, run, items, overrule.reason, look.now, overrule.by)
    return _said(after)


def _said(run: ChecklistRun) -> str:
    title = template_of(run.document).title
    return f"{run.settled_by} overruled {title}: {run.reason.rstrip('.')}."
