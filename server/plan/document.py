"""A plan as the document that the database keeps, and back."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any, Self

import numpy as np
from pydantic import TypeAdapter

from autonomy.arrays import FloatArray
from autonomy.channel import CHANNELS
from autonomy.planner.leg.edge import POINT_STD
from autonomy.planner.plan import Candidate, Leg, ObjectivePoint
from db.query.mission.plans import PlanRecord
from db.record import same
from robot_link.messages import OnboardPlanState, PlanReport
from robot_link.mission import Mission, MissionSettings
from robot_link.onboard_settings import OnboardSettings
from robot_link.satellite.config import Tariff
from robot_link.surfacing_order import SurfacingOrder
from robot_link.target_settings import TargetSettings
from server.plan.expected import expected_of
from server.plan.target_check import TEACHING
from server.plan.view import (
    AccountView,
    BatteryView,
    ChanceView,
    ComesUpView,
    DryRunView,
    FailedFlightView,
    FlightBandView,
    InheritedView,
    LadderView,
    LegOutView,
    LegView,
    LivePlanView,
    NearestView,
    ObjectiveView,
    OnboardView,
    PlanSummaryView,
    PlanView,
    ProgressView,
    RunnerUpView,
    SafetyView,
    SurfacingBandView,
    ViolationView,
    WayThereView,
)
from server.satellite.cost import mission_credits

OBJECTIVE_UNITS = {"information_gain": "nat"}
"""Of the objectives that have a unit."""
_RULES = "surfacing_rules"
"""Integers of the rules by which the robot comes up by itself; absent where there are none."""
SEARCHED_OBJECTIVE = "searched_objective"
"""What the search itself took a trajectory to be worth; documents of earlier versions lack it."""
_DECIMALS = 4
_PARTS = ("battery", "way_there")
_WAY_THERE = TypeAdapter(WayThereView)
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
    trim_at: datetime | None
    """When that version was saved."""
    surfacings: int
    satellite_bytes: int
    energy_wh: float | None
    """About what the energy units are in watt-hours, ``None`` where nobody knows."""
    tariff: Tariff
    """By which sending it by satellite is charged."""
    battery: BatteryView | None = None
    """What it takes from the robot's battery, ``None`` where nobody knows."""
    way_there: Leg | None = None
    """From where the robot was, ``None`` where it was there, or where that is not known."""

    def renamed(self) -> Self:
        """Return the same trajectory under another name: the robot waits a second longer.

        A plan's name is the hash of its bytes. If two plans of a robot had the same, neither its
        word nor an order to start would say which of them is meant.
        """
        old = self.mission
        settings = replace(old.settings, timeout_s=old.settings.timeout_s + 1.0)
        mission = Mission.from_legs(
            settings, old.legs, old.format, onboard=old.onboard, rules=old.rules
        )
        return replace(self, mission=mission)


def draft_document(draft: Draft) -> dict[str, Any]:
    """Return the part of a plan's document that a draft fills."""
    onboard, rules = draft.mission.onboard, draft.mission.rules
    return {
        "format": draft.mission.format,
        "settings": asdict(draft.mission.settings),
        "onboard_settings": None if onboard is None else list(onboard.integers()),
        **({} if rules is None else {_RULES: list(rules.integers())}),
        "trim_id": draft.trim_id,
        "trim_at": None if draft.trim_at is None else draft.trim_at.isoformat(),
        "legs": [asdict(leg) for leg in draft.mission.legs],
        "points": np.round(draft.points, _DECIMALS).tolist(),
        "account": asdict(
            AccountView(
                energy=draft.energy,
                duration_s=draft.duration_s,
                worst_std_m=draft.worst_std_m,
                bytes=len(draft.mission.canonical_bytes()),
                credits=mission_credits(draft.mission, draft.tariff),
                surfacings=draft.surfacings,
                satellite_bytes=draft.satellite_bytes,
                energy_wh=draft.energy_wh,
                battery=draft.battery,
                way_there=None if draft.way_there is None else way_there_view(draft.way_there),
            )
        ),
        "violations": [asdict(violation) for violation in draft.violations],
    }


def way_there_view(way: Leg) -> WayThereView:
    """Return the swim to where a plan begins as it is shown."""
    return same(WayThereView, way, distance_m=math.dist(way.start_ned[:2], way.end_ned[:2]))


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
        SEARCHED_OBJECTIVE: None if best is None else best.searched,
        "objective_unit": OBJECTIVE_UNITS.get(objective, ""),
        "runners_up": [_candidate_document(one) for one in runners_up],
        "history": [asdict(point) for point in history],
        "message": message,
    }


def _candidate_document(one: Candidate) -> dict[str, Any]:
    return {
        "objective": one.objective,
        SEARCHED_OBJECTIVE: one.searched,
        "energy": one.energy,
        "duration_s": one.duration_s,
        "worst_std_m": one.worst_std_m,
        "legs": [asdict(leg) for leg in one.legs],
        "points": np.round(one.points, _DECIMALS).tolist(),
    }


def candidates_of(document: Mapping[str, Any]) -> tuple[Candidate, ...]:
    """Return the runners-up of a plan's document; those of an earlier version have no legs."""
    return tuple(
        Candidate(
            legs=legs_of(one),
            points=points_of(one),
            objective=one["objective"],
            energy=one["energy"],
            duration_s=one["duration_s"],
            worst_std_m=one["worst_std_m"],
            searched=one.get(SEARCHED_OBJECTIVE),
        )
        for one in document.get("runners_up", ())
    )


def candidate_of_draft(document: Mapping[str, Any]) -> Candidate:
    """Return the trajectory of a draft itself."""
    account = document["account"]
    return Candidate(
        legs=legs_of(document),
        points=points_of(document),
        objective=document["objective"],
        energy=account["energy"],
        duration_s=account["duration_s"],
        worst_std_m=account["worst_std_m"],
        searched=document.get(SEARCHED_OBJECTIVE),
    )


def legs_of(document: Mapping[str, Any]) -> tuple[Leg, ...]:
    """Return the legs of a plan's document; none while it is being planned."""
    return _LEGS.validate_python(document.get("legs", ()))


def points_of(document: Mapping[str, Any]) -> FloatArray:
    """Return the promised trajectory of a plan's document, shape ``(n, 5)``."""
    return np.array(document.get("points", ()), dtype=np.float64).reshape(-1, 5)


def mission_of(plan: PlanRecord) -> Mission:
    """Return what travels to the robot; its hash is the plan's.

    A document that names no format is of the first, which had no trim; one without onboard
    settings is of a format that brought none.
    """
    document = plan.document
    settings = MissionSettings(**document["settings"])
    order = document.get("tracking")
    if order is not None:
        return Mission.for_target(settings, TargetSettings.from_integers(order))
    integers, rules = document.get("onboard_settings"), document.get(_RULES)
    return Mission.from_legs(
        settings,
        legs_of(document),
        document.get("format", 1),
        onboard=None if integers is None else OnboardSettings.from_integers(integers),
        rules=None if rules is None else SurfacingOrder.from_integers(rules),
    )


def rule_texts(document: Mapping[str, Any]) -> list[str]:
    """Return by what the robot of a plan comes up by itself, in words; a channel by its title."""
    if document.get(_RULES) is None:
        return []
    order = SurfacingOrder.from_integers(document[_RULES])
    texts = [f"{order.samples_waiting:,} samples wait"] if order.samples_waiting else []
    for one in order.on_value:
        channel = CHANNELS.numbered(one.channel)
        title = f"channel {one.channel}" if channel is None else channel.title.lower()
        unit = "" if channel is None or channel.unit == "1" else f" {channel.unit}"
        texts.append(f"{title} is {'above' if one.is_above else 'below'} {one.limit:g}{unit}")
    return texts


def plan_view(
    plan: PlanRecord,
    progress: ProgressView | None,
    report: PlanReport | None,
    outdated: Sequence[ViolationView],
) -> PlanView:
    """Return a plan as REST says it.

    Args:
        plan: The plan.
        progress: How far planning is, while it runs.
        report: What the robot says of the plan on board, of this plan or another.
        outdated: Why it no longer fits the robot while it waits.
    """
    document = plan.document
    dry_run = document.get("rehearsal")
    return same(
        PlanView,
        plan,
        mission_id=plan.mission,
        config_id=document.get("config_id"),
        config=_told(plan.config),
        trim_id=document.get("trim_id"),
        trim_at=_moment(document.get("trim_at")),
        legs=[_leg_view(leg) for leg in legs_of(document)],
        points=document.get("points", []),
        account=account_of(document),
        objective=document.get("objective"),
        objective_unit=document.get("objective_unit", ""),
        violations=[ViolationView(**one) for one in document.get("violations", ())],
        outdated=list(outdated),
        stage=stage_of(plan, progress),
        progress=progress,
        history=[ObjectiveView(**point) for point in document.get("history", ())],
        runners_up=[_runner_up_view(one) for one in document.get("runners_up", ())],
        rehearsal=None if dry_run is None else dry_run_view(dry_run),
        exploitation=document.get("exploitation"),
        replaces=document.get("replaces"),
        message=document.get("message", ""),
        current_text=document.get("current_text", ""),
        checklist=document.get("checklist", ""),
        comes_up=[ComesUpView(**one) for one in document.get("comes_up", ())],
        ladder=ladder_view(plan),
        onboard=onboard_view(plan, report),
        tracking=None if document.get("tracking") is None else dict(plan.config),
        target_path=document.get("target_path", []),
        warnings=[
            ViolationView(**one) for one in (*document.get("warnings", ()), *_broken(document))
        ],
        teaches=teaches(plan),
        inherited=[InheritedView(**one) for one in document.get("inherited", ())],
        searched_objective=document.get(SEARCHED_OBJECTIVE),
        rules=rule_texts(document),
    )


def _told(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings without the table of a current, which nobody reads."""
    current = config.get("current")
    if not isinstance(current, Mapping) or "flow" not in current:
        return dict(config)
    others = {key: value for key, value in current.items() if key != "flow"}
    return {**config, "current": others}


def plan_summary(plan: PlanRecord) -> PlanSummaryView:
    """Return a plan as a list shows it."""
    document = plan.document
    return same(
        PlanSummaryView,
        plan,
        mission_id=plan.mission,
        account=account_of(document),
        objective=document.get("objective"),
        objective_unit=document.get("objective_unit", ""),
        violations=len(document.get("violations", ())),
        message=document.get("message", ""),
        ladder=ladder_view(plan),
        teaches=teaches(plan),
    )


def live_plan_view(
    plan: PlanRecord,
    progress: ProgressView | None,
    report: PlanReport | None,
    outdated: Sequence[ViolationView],
) -> LivePlanView:
    """Return what the live stream says of a plan."""
    return LivePlanView(
        state=plan.state,
        stage=stage_of(plan, progress),
        progress=progress,
        ladder=ladder_view(plan),
        onboard=onboard_view(plan, report),
        outdated=list(outdated),
        message=plan.document.get("message", ""),
    )


def account_of(document: Mapping[str, Any]) -> AccountView | None:
    """Return what the plan of a document costs, ``None`` before that is known.

    It costs what its dry run expects. What is kept is the planner's own account.
    """
    account = document.get("account")
    if account is None:
        return None
    battery, way = account.get("battery"), account.get("way_there")
    figures = {name: value for name, value in account.items() if name not in _PARTS}
    view = AccountView(
        **figures,
        battery=None if battery is None else BatteryView(**battery),
        way_there=None if way is None else _WAY_THERE.validate_python(way),
    )
    expected = expected_of(document)
    if expected is None:
        return view
    dry_run = document["rehearsal"]
    return replace(
        view,
        duration_s=dry_run["duration_s"],
        worst_std_m=float(expected[:, POINT_STD].max()),
        expected_from=dry_run["runs"],
        planned_duration_s=view.duration_s,
    )


def teaches(plan: PlanRecord) -> bool:
    """Tell whether a plan lets the estimate of its target diverge, to show that."""
    return any(one["field"] == TEACHING for one in plan.document.get("warnings", ()))


def stage_of(plan: PlanRecord, progress: ProgressView | None) -> str | None:
    """Return what planning does now, ``None`` once it has ended."""
    if plan.state != "planning":
        return None
    if "rehearsal" in plan.document:
        return "rehearsing"
    is_searching = progress is not None or not plan.document.get("in_turn")
    return "searching" if is_searching else "waiting"


def ladder_view(plan: PlanRecord) -> LadderView:
    """Return when each state was proved."""
    return LadderView(
        plan.draft_at,
        plan.sent_at,
        plan.on_board_at,
        plan.running_at,
        plan.ended_at,
        plan.waiting_at,
    )


def report_of(plan: PlanRecord, report: PlanReport | None) -> PlanReport | None:
    """Return what a robot says of the plan on board if that is this plan."""
    if report is None or plan.sha256 is None or report.sha256 != plan.sha256:
        return None
    return report


def onboard_view(plan: PlanRecord, report: PlanReport | None) -> OnboardView | None:
    """Return how far the robot says it is with this plan, from its word or from the records.

    One that was switched off as it flew says of the plan that waits again nothing of that flight.
    """
    said, last = report_of(plan, report), plan.document.get("onboard")
    has_begun_anew = said is not None and said.state is OnboardPlanState.ON_BOARD
    if said is not None and not (has_begun_anew and plan.running_at is not None):
        flown_off_m = None if last is None else last.get("off_track_rms_m")
        return replace(onboard_by(plan, said), off_track_rms_m=flown_off_m)
    return None if last is None else OnboardView(**last)


def onboard_by(plan: PlanRecord, report: PlanReport) -> OnboardView:
    """Return how far a report says that the robot is with this plan, and what it overspent."""
    account = plan.document.get("account")
    planned = report.energy_used if account is None else account["energy"]
    over = max(0.0, report.energy_used - planned)
    return OnboardView(report.leg, report.legs, report.energy_used, over)


def _leg_view(leg: Leg) -> LegView:
    return same(LegView, leg)


def _runner_up_view(one: Mapping[str, Any]) -> RunnerUpView:
    return RunnerUpView(
        objective=one["objective"],
        energy=one["energy"],
        duration_s=one["duration_s"],
        worst_std_m=one["worst_std_m"],
        legs=[_leg_view(leg) for leg in legs_of(one)],
        points=one.get("points", []),
        searched_objective=one.get(SEARCHED_OBJECTIVE),
    )


def dry_run_view(found: Mapping[str, Any]) -> DryRunView:
    """Return a dry run as its document says it; one of an earlier version expects no track."""
    fields = dict(found)
    fields["nearest"] = [NearestView(**one) for one in found.get("nearest", ())]
    fields["broken"] = [ViolationView(**one) for one in found.get("broken", ())]
    fields["band"] = _band_view(found.get("band"))
    fields["safety"] = _safety_view(found.get("safety"))
    fields["failed"] = [FailedFlightView(**one) for one in found.get("failed", ())]
    return DryRunView(**fields)


def _band_view(band: Mapping[str, Any] | None) -> FlightBandView | None:
    if band is None:
        return None
    parts: dict[str, Any] = {
        "touches": [ChanceView(**one) for one in band["touches"]],
        "outcomes": [ChanceView(**one) for one in band["outcomes"]],
        "surfacings": [SurfacingBandView(**one) for one in band["surfacings"]],
    }
    return FlightBandView(**{**band, **parts})


def _safety_view(safety: Mapping[str, Any] | None) -> SafetyView | None:
    if safety is None:
        return None
    parts: dict[str, Any] = {"legs": [LegOutView(**one) for one in safety["legs"]]}
    return SafetyView(**{**safety, **parts})


def _broken(document: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the limits that the expected track of a plan breaks."""
    return (document.get("rehearsal") or {}).get("broken") or []


def _moment(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text)
