"""What a robot will do by itself: by the plan on board as proved, and by its own rules."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from autonomy.estimation.energy_use import EnergyEstimate
from autonomy.tracking.config import TrackingConfig
from autonomy.vehicle.battery import RESERVE
from db.query.fleet.onboard import ParameterRecord
from db.query.mission.plans import PlanRecord
from onboard.profile import FlightProfile
from robot_link.messages import OnboardPlanState, RobotMode
from robot_link.mission import Mission
from robot_link.satellite.config import SatelliteConfig
from server.fleet.status import RobotStatus
from server.fleet.words import clock_time
from server.plan.document import mission_of, rule_texts
from server.prediction.basis import Basis
from server.prediction.view import OwnActView

_BUILT = "as the program on board is built"


@dataclass(frozen=True, slots=True)
class Known:
    """What the list is made of."""

    status: RobotStatus
    basis: Basis
    plan: PlanRecord | None
    """The plan whose hash the robot echoed, ``None`` where the station has none of that hash."""
    ends_s: Sequence[float]
    """When each of its legs ends, s since its start; empty where it has none."""
    parameters: Mapping[str, ParameterRecord]
    """As the robot said them last."""
    profile: FlightProfile
    satellite: SatelliteConfig | None
    """``None`` of a robot without a modem."""
    uncertain_at: datetime | None
    """When it takes its position for too uncertain, if no fix comes before."""
    rate_w: EnergyEstimate | None
    """What it draws at today's rate."""
    capacity_wh: float


def own_acts(known: Known) -> list[OwnActView]:
    """Return what a robot does by itself, what has a time first and in order of that."""
    report = known.basis.plan_report
    found: list[OwnActView] = []
    is_running = report is not None and report.state is OnboardPlanState.RUNNING
    if known.plan is not None and is_running:
        mission = mission_of(known.plan)
        found += _of_mission(known, known.plan, mission)
        found += _of_dives(known, mission)
    elif is_running:
        text = "It flies a plan that this station does not know; what that sets is not told."
        found.append(OwnActView("plan", text, None, "the robot's word"))
    elif report is not None and report.state is OnboardPlanState.ON_BOARD:
        text = "It waits with a plan on board and begins it only when it is told to start."
        found.append(OwnActView("start", text, None, "the robot's word"))
    if known.basis.state.mode is RobotMode.HOLDING:
        text = "It holds at the surface until it is told to resume; its mission's time goes on."
        found.append(OwnActView("hold", text, None, "the robot's word"))
    found += _battery(known, is_running=is_running)
    found += _calls(known)
    timed = sorted((one for one in found if one.at is not None), key=lambda one: str(one.at))
    return [*timed, *(one for one in found if one.at is None)]


def _of_mission(known: Known, plan: PlanRecord, mission: Mission) -> list[OwnActView]:
    settings, source = mission.settings, f"{plan.id} on board"
    begun = plan.running_at
    found: list[OwnActView] = []
    up_at = known.status.next_surfacing()
    if mission.tracking is not None:
        found += _of_target(mission.tracking.config(), begun, source)
    elif up_at is not None:
        found.append(OwnActView("surface", "It comes up as planned.", up_at, source))
    leg, begins_at = known.status.leg_now, known.status.leg_begins_at()
    if leg is not None and begins_at is not None and leg < len(known.ends_s):
        flown_s = known.ends_s[leg - 1] if leg else 0.0
        end = begins_at + timedelta(seconds=known.ends_s[-1] - flown_s)
        if end != up_at:
            text = "It has flown its plan, lies at the surface and drifts."
            found.append(OwnActView("end", text, end, source))
    text = f"It ends its mission and comes up for good, {settings.timeout_s:.0f} s after it began."
    timeout_at = None if begun is None else begun + timedelta(seconds=settings.timeout_s)
    found.append(OwnActView("timeout", text, timeout_at, source))
    found += [
        OwnActView(f"rule-{number}", f"It comes up early when {one}.", None, source)
        for number, one in enumerate(rule_texts(plan.document), start=1)
    ]
    limit_m = settings.max_uncertainty_m
    text = f"It comes up for a fix once it takes its position for uncertain by {limit_m:g} m."
    at = known.uncertain_at
    if at is not None and up_at is not None and at > up_at:
        text += f" That is not before it comes up as planned, at {clock_time(up_at)}."
        at = None
    found.append(OwnActView("uncertainty", text, at, source))
    return found


def _of_target(config: TrackingConfig, begun: datetime | None, source: str) -> list[OwnActView]:
    duration_s = config.motion.duration_s
    at = None if begun is None else begun + timedelta(seconds=duration_s)
    lost_s = config.ranging.give_up_after_s
    return [
        OwnActView("end", "It ends following its target and comes up.", at, source),
        OwnActView(
            "lost",
            f"It gives up a target that it has not held for {lost_s:g} s, and comes up.",
            None,
            source,
        ),
    ]


def _of_dives(known: Known, mission: Mission) -> list[OwnActView]:
    floor_m, floor_by = _manner(known, "FLOOR_MARGIN_M", known.profile.floor_margin_m)
    shore_m, shore_by = _manner(known, "SHORE_MARGIN_M", known.profile.shore_margin_m)
    least_s, waits_by = _manner(known, "SURF_MIN_S", known.profile.surface_min_s)
    most_s, _ = _manner(known, "SURF_MAX_S", known.profile.surface_max_s)
    waits = (
        f"Between two dives it stays up for {least_s:g} s at least, and while samples are not "
        f"acknowledged for {most_s:g} s at most; unheard, it goes on by itself."
    )
    found = [
        OwnActView("floor", f"It comes up {floor_m:g} m above the floor.", None, floor_by),
        OwnActView(
            "shore",
            f"It comes up nearer than {shore_m:g} m to walls or shore, or than twice the standard "
            "deviation of its position.",
            None,
            shore_by,
        ),
    ]
    return found if mission.tracking is not None else [*found, _wait(waits, waits_by)]


def _wait(text: str, source: str) -> OwnActView:
    return OwnActView("wait", text, None, source)


def _battery(known: Known, *, is_running: bool) -> list[OwnActView]:
    left, rate = known.basis.state.battery_fraction, known.rate_w
    what = "It ends its mission and comes up" if is_running else "It begins no mission any more"
    text = f"{what} when its battery falls below {RESERVE:.0%}."
    at = None
    if rate is not None and np.isfinite(left) and left > RESERVE:
        hours = (left - RESERVE) * known.capacity_wh / max(rate.mean_wh, 1e-9)
        at = known.basis.state.measured_at + timedelta(hours=min(hours, 24.0 * 366.0))
        text += f" At today's rate of {rate.mean_wh:.2g} W that is then."
    return [OwnActView("battery", text, at, _BUILT)]


def _calls(known: Known) -> list[OwnActView]:
    config = known.satellite
    if config is None:
        return []
    silence_s, source = _manner(known, "SAT_SILENCE_S", config.radio_silence_s, "the settings")
    period_s, _ = _manner(known, "SAT_PERIOD_S", config.session_period_s)
    most, _ = _manner(known, "SAT_DAY_MAX", float(config.messages_per_day))
    text = (
        f"At the surface it calls by satellite once it has not heard its station by radio for "
        f"{silence_s:g} s, and every {period_s:g} s again; after {most:g} calls of a day only once "
        "an hour."
    )
    status = known.status.satellite
    return [OwnActView("call", text, None if status is None else status.next_session_at, source)]


def _manner(known: Known, name: str, built: float, else_by: str = _BUILT) -> tuple[float, str]:
    """Return a parameter of the robot, and who says so."""
    told = known.parameters.get(name)
    if told is None:
        return built, else_by
    return told.value, f"parameter {name}, read at {clock_time(told.read_at)}"
