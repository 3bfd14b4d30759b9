"""A plan as the document that the database keeps, and back."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from autonomy.arrays import FloatArray
from autonomy.planner.plan import Candidate, Leg, ObjectivePoint
from db.query.plans import PlanRecord
from robot_link.messages import PlanReport
from robot_link.mission import Mission, MissionSettings
from server.service.view.plan import (
    AccountView,
    LadderView,
    LegView,
    LivePlanView,
    ObjectiveView,
    OnboardView,
    PlanSummaryView,
    PlanView,
    ProgressView,
    RunnerUpView,
    ViolationView,
)

OBJECTIVE_UNITS = {"information_gain": "nat", "ergodic": ""}
_DECIMALS = 4
_LEGS = TypeAdapter(tuple[Leg, ...])


@dataclass(frozen=True, slots=True)
class Draft:
    """A trajectory that may be sent, with the account that an operator decides by."""

    mission: Mission
    points: FloatArray
    """Promised trajectory, shape ``(n, 5)``: time s, north, east, down m, position std m."""
    energy: float
    duration_s: float
    worst_std_m: float
    violations: tuple[ViolationView, ...]
    trim_id: str | None
    """Version of the trim in the mission; ``None`` for the preset."""


def draft_document(draft: Draft) -> dict[str, Any]:
    """Return the part of a plan's document that a draft fills."""
    return {
        "format": draft.mission.format,
        "settings": asdict(draft.mission.settings),
        "trim_id": draft.trim_id,
        "legs": [asdict(leg) for leg in draft.mission.legs],
        "points": np.round(draft.points, _DECIMALS).tolist(),
        "account": asdict(
            AccountView(
                energy=draft.energy,
                duration_s=draft.duration_s,
                worst_std_m=draft.worst_std_m,
                bytes=len(draft.mission.canonical_bytes()),
                credits=0,
            )
        ),
        "violations": [asdict(violation) for violation in draft.violations],
    }


def search_document(
    objective: str,
    message: str,
    best: Candidate | None,
    runners_up: Sequence[Candidate],
    history: Sequence[ObjectivePoint],
) -> dict[str, Any]:
    """Return the part of a plan's document that a search fills."""
    return {
        "objective": None if best is None else best.objective,
        "objective_unit": OBJECTIVE_UNITS[objective],
        "runners_up": [
            asdict(RunnerUpView(one.objective, one.energy, one.duration_s, one.worst_std_m))
            for one in runners_up
        ],
        "history": [asdict(point) for point in history],
        "message": message,
    }


def legs_of(document: Mapping[str, Any]) -> tuple[Leg, ...]:
    """Return the legs of a plan's document; none while it is being planned."""
    return _LEGS.validate_python(document.get("legs", ()))


def points_of(document: Mapping[str, Any]) -> FloatArray:
    """Return the promised trajectory of a plan's document, shape ``(n, 5)``."""
    return np.array(document.get("points", ()), dtype=np.float64).reshape(-1, 5)


def mission_of(plan: PlanRecord) -> Mission:
    """Return what travels to the robot; its hash is the plan's.

    A document that names no format is of the first, which had no trim.
    """
    document = plan.document
    settings = MissionSettings(**document["settings"])
    return Mission.from_legs(settings, legs_of(document), document.get("format", 1))


def plan_view(
    plan: PlanRecord, progress: ProgressView | None, report: PlanReport | None
) -> PlanView:
    """Return a plan as REST says it.

    Args:
        plan: The plan.
        progress: How far planning is, while it runs.
        report: What the robot says of the plan on board, of this plan or another.
    """
    document = plan.document
    account = document.get("account")
    return PlanView(
        id=plan.id,
        robot=plan.robot,
        kind=plan.kind,
        mission_id=plan.mission,
        round=plan.round,
        state=plan.state,
        sha256=plan.sha256,
        config_id=document.get("config_id"),
        config=dict(plan.config),
        trim_id=document.get("trim_id"),
        created_at=plan.created_at,
        legs=[_leg_view(leg) for leg in legs_of(document)],
        points=document.get("points", []),
        account=None if account is None else AccountView(**account),
        objective=document.get("objective"),
        objective_unit=document.get("objective_unit", ""),
        violations=[ViolationView(**one) for one in document.get("violations", ())],
        progress=progress,
        history=[ObjectiveView(**point) for point in document.get("history", ())],
        runners_up=[RunnerUpView(**one) for one in document.get("runners_up", ())],
        message=document.get("message", ""),
        ladder=ladder_view(plan),
        onboard=onboard_view(plan, report),
    )


def plan_summary(plan: PlanRecord) -> PlanSummaryView:
    """Return a plan as a list shows it."""
    document = plan.document
    account = document.get("account")
    return PlanSummaryView(
        id=plan.id,
        robot=plan.robot,
        kind=plan.kind,
        mission_id=plan.mission,
        round=plan.round,
        state=plan.state,
        sha256=plan.sha256,
        created_at=plan.created_at,
        account=None if account is None else AccountView(**account),
        objective=document.get("objective"),
        objective_unit=document.get("objective_unit", ""),
        violations=len(document.get("violations", ())),
        message=document.get("message", ""),
        ladder=ladder_view(plan),
    )


def live_plan_view(
    plan: PlanRecord, progress: ProgressView | None, report: PlanReport | None
) -> LivePlanView:
    """Return what the live stream says of a plan."""
    return LivePlanView(
        state=plan.state,
        progress=progress,
        ladder=ladder_view(plan),
        onboard=onboard_view(plan, report),
        message=plan.document.get("message", ""),
    )


def ladder_view(plan: PlanRecord) -> LadderView:
    """Return when each state was proved."""
    return LadderView(plan.draft_at, plan.sent_at, plan.on_board_at, plan.running_at, plan.ended_at)


def onboard_view(plan: PlanRecord, report: PlanReport | None) -> OnboardView | None:
    """Return how far the robot says it is with this plan, from its word or from the records."""
    if report is not None and plan.sha256 is not None and report.sha256 == plan.sha256:
        return onboard_by(plan, report)
    last = plan.document.get("onboard")
    return None if last is None else OnboardView(**last)


def onboard_by(plan: PlanRecord, report: PlanReport) -> OnboardView:
    """Return how far a report says that the robot is with this plan, and what it overspent."""
    account = plan.document.get("account")
    planned = report.energy_used if account is None else account["energy"]
    over = max(0.0, report.energy_used - planned)
    return OnboardView(report.leg, report.legs, report.energy_used, over)


def _leg_view(leg: Leg) -> LegView:
    return LegView(
        kind=leg.kind.value,
        start_ned=leg.start_ned,
        end_ned=leg.end_ned,
        speed_m_s=leg.speed_m_s,
        duration_s=leg.duration_s,
        energy=leg.energy,
        heading_rad=leg.heading_rad,
        radius_m=leg.radius_m,
        turn_rad=leg.turn_rad,
    )
