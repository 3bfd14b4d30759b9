"""Drafts: the mission that a trajectory becomes, and what speaks against flying it now."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

from autonomy.configuration import Configuration
from autonomy.field.config import FieldConfig
from autonomy.planner.check.check import outdated, violations
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import surfacings
from autonomy.planner.plan import Candidate, Leg
from autonomy.planner.work import joules_per_unit
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.glide import NoSteadyGlideError
from autonomy.vehicle.trim import TrimConfig, trim_flaw
from db.query.mission.plans import PlanRecord
from robot_link.mission import Mission, MissionSettings
from robot_link.onboard_settings import OnboardSettings
from robot_link.satellite.config import Tariff
from robot_link.surfacing_order import SurfacingOrder
from server.base.configuration import CurrentConfiguration
from server.base.configuration_kind import ONBOARD_CONTROLLER
from server.fleet.status import FOLLOW_TARGET, RobotStatus
from server.plan.chance import too_likely
from server.plan.document import Draft, dry_run_view, legs_of
from server.plan.expected import OUT_OF_BOUNDS
from server.plan.target_check import outdated_target
from server.plan.view import ViolationView

_J_PER_WH = 3600.0
SENDABLE = ("draft", "on_board")
"""States of a plan that can be sent; one that is on board already is only started."""


def draft_of(
    status: RobotStatus,
    vehicle: Vehicle | None,
    config: PlannerConfig,
    trim: CurrentConfiguration,
    best: Candidate,
    *,
    controller: Configuration,
    field: FieldConfig,
    tariff: Tariff,
    rules: SurfacingOrder | None = None,
) -> Draft:
    """Return a trajectory as a mission, with the account that an operator decides by.

    Args:
        status: The robot that is to fly it.
        vehicle: Its model, if it is known.
        config: Settings that it was planned with.
        trim: The robot's trim, which the mission brings on board.
        best: The trajectory.
        controller: Gains that the mission brings on board, of ``ONBOARD_CONTROLLER``.
        field: The robot's map, by which it chooses the samples that it sends by satellite.
        tariff: What sending the mission by satellite costs.
        rules: By what the robot comes up by itself.
    """
    first = best.legs[0].start_ned
    offsets = trim.value_as(TrimConfig)
    comes_up = surfacings(best.legs)
    settings = MissionSettings.of(config, offsets, first, best.duration_s)
    onboard, unfit = _onboard_settings(controller, config, field)
    return Draft(
        mission=Mission.from_legs(settings, best.legs, onboard=onboard, rules=rules),
        points=best.points,
        energy=best.energy,
        duration_s=best.duration_s,
        worst_std_m=best.worst_std_m,
        violations=(*broken_limits(status, vehicle, config, settings, best.legs), *unfit),
        trim_id=trim.id,
        trim_at=trim.changed_at,
        surfacings=comes_up,
        satellite_bytes=comes_up * config.mission.surfacing_bytes,
        energy_wh=None if vehicle is None else _watt_hours(vehicle, config, best.energy),
        tariff=tariff,
    )


def _watt_hours(vehicle: Vehicle, config: PlannerConfig, units: float) -> float | None:
    try:
        return units * joules_per_unit(vehicle, config.primitives, config.energy) / _J_PER_WH
    except NoSteadyGlideError:
        return None


def _onboard_settings(
    controller: Configuration, config: PlannerConfig, field: FieldConfig
) -> tuple[OnboardSettings | None, tuple[ViolationView, ...]]:
    """Return what the mission brings on board, or why that cannot travel."""
    try:
        return OnboardSettings.of(ONBOARD_CONTROLLER, controller, config, field), ()
    except ValueError as error:
        text = f"The robot cannot be given these settings: {error}."
        return None, (ViolationView(ONBOARD_CONTROLLER, text),)


def broken_limits(
    status: RobotStatus,
    vehicle: Vehicle | None,
    config: PlannerConfig,
    settings: MissionSettings,
    legs: Sequence[Leg],
) -> tuple[ViolationView, ...]:
    """Return every limit that legs and trim break, whatever the time."""
    found = violations(tuple(legs), config, status.record.site)
    views = [ViolationView(one.field, one.message) for one in found]
    if vehicle is not None:
        offsets = (settings.net_buoyancy_offset_kg, settings.mass_position_offset_m)
        flaw = trim_flaw(*offsets, vehicle.limits)
        if flaw:
            views.append(ViolationView("trim", f"{flaw[0].upper()}{flaw[1:]}."))
    return tuple(views)


def outdated_by(status: RobotStatus, plan: PlanRecord, now: datetime) -> tuple[ViolationView, ...]:
    """Return why a plan that waits to be flown no longer fits the robot.

    The robot may have drifted, or the water changed; a person may let it fly all the same.
    """
    state = status.state
    if plan.state not in SENDABLE or state is None:
        return ()
    if plan.kind == FOLLOW_TARGET:
        return tuple(outdated_target(plan, status, now))
    found = outdated(
        legs_of(plan.document),
        PlannerConfig.model_validate(plan.config),
        status.begins_ne_m() or state.position_ned[:2],
        (now - plan.created_at).total_seconds(),
        status.record.site,
    )
    return tuple(ViolationView(one.field, one.message) for one in found)


def ages_at(plan: PlanRecord, now: datetime) -> datetime | None:
    """Return when time alone changes what ``outdated_by`` says, ``None`` if it never does."""
    if plan.state not in SENDABLE:
        return None
    if plan.kind == FOLLOW_TARGET:
        limit_s: float = plan.document["draft_age_s"]
    else:
        limit_s = PlannerConfig.model_validate(plan.config).mission.draft_age_s
    age_s = (now - plan.created_at).total_seconds()
    said_min = round(age_s / 60.0)  # how old it is said to be once it is too old
    next_s = limit_s if age_s <= limit_s else 60.0 * (said_min + 0.5)
    return plan.created_at + timedelta(seconds=next_s, microseconds=1)


def broken_off(plan: PlanRecord) -> tuple[ViolationView, ...]:
    """Return what the dry run of a plan that waits says if the robot did not fly it as it must.

    It did not if it came not to its end or into a keep-out, if its expected track leaves the safe
    water, as no leg may, or if it is likelier to be out of that than the settings allow.

    The station sends no such plan by itself; a person may.
    """
    dry_run = plan.document.get("rehearsal") or {}
    if plan.state not in SENDABLE:
        return ()
    said: list[str] = []
    chance = _too_likely(plan, dry_run)
    if dry_run.get("completed") is False or dry_run.get("entered"):
        said.append(dry_run["message"])
    broken = dry_run.get("broken", ())
    said += [one["message"] for one in broken if one["field"] in OUT_OF_BOUNDS]
    rehearsed = f"Its rehearsal says: {' '.join(said)}"
    return (
        *([ViolationView("adaptive.rehearse", rehearsed)] if said else []),
        *([ViolationView("adaptive.greatest_chance", chance)] if chance else []),
    )


def _too_likely(plan: PlanRecord, dry_run: Mapping[str, Any]) -> str:
    """Return why a plan is likelier to leave the water than it may; "" for one that follows."""
    if plan.kind == FOLLOW_TARGET:  # its settings name no chance: its way is not known before
        return ""
    config = PlannerConfig.model_validate(plan.config)
    return too_likely(dry_run_view(dry_run) if dry_run else None, config)
