"""A design laid out in its water for a robot: legs, account, and what speaks against it.

A pure function of what it is given, so that it can run beside the event loop.
"""

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from datetime import datetime

from autonomy.channel import CHANNELS, ChannelCatalogue
from autonomy.design.document import Design, Manner, SurfacingRules, Waypoint
from autonomy.design.glide_path import LaidOut, lay_out, rules_of, way_there, with_patience
from autonomy.design.way import waypoints_of
from autonomy.estimation.energy_use import Use
from autonomy.estimation.position import blind_time_s
from autonomy.planner.check.check import violations
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import dives_of, doubts, legs_duration_s, legs_energy, surfacings
from autonomy.planner.plan import Leg, PositionNed
from autonomy.planner.work import joules_per_unit
from autonomy.site import Site
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.glide import NoSteadyGlideError
from autonomy.vehicle.trim import TrimConfig
from db.record import same
from robot_link.mission import Mission, MissionSettings
from robot_link.satellite.config import Tariff
from robot_link.surfacing_order import SurfacingOrder, ValueLimit
from server.base.problem import conflict
from server.battery.battery_use import Battery
from server.battery.flown import hours_of_legs
from server.battery.lasting import battery_after
from server.battery.view import BatteryAfterView
from server.design.view import (
    OutlineAccountView,
    OutlineLegView,
    OutlineNoteView,
    OutlineView,
    OutlineViolationView,
    OutlineWaypointView,
    WayThereView,
)
from server.plan.document import way_there_view
from server.satellite.cost import mission_credits

_J_PER_WH = 3600.0
_S_PER_H = 3600.0
_NUMBERED = re.compile(r"^(legs|waypoints)\.(\d+)")


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a design is laid out with."""

    config: PlannerConfig
    """What holds for the robot, in the current that a plan of now reckons with."""
    current_text: str
    """Where that current comes from; "" where it was typed."""
    site: Site
    spacing_m: float
    """Correlation length of the robot's map."""
    robot_ned: PositionNed | None
    """Where the robot said that it is."""
    battery_left: float | None
    vehicle: Vehicle | None
    tariff: Tariff
    now: datetime
    battery: Battery | None = None
    """What it draws, and what is left; ``None`` where its vehicle is not known."""
    home_ne_m: tuple[float, float] | None = None
    """Where it was put into the water; ``None`` where nobody knows."""
    channels: ChannelCatalogue = field(default_factory=lambda: CHANNELS)
    """By which rules of surfacing name what the robot measures."""
    announced: frozenset[int] | None = None
    """Numbers of the channels that the robot announced and means as the catalogue does; ``None`` of
    one that announced none."""


@dataclass(frozen=True, slots=True)
class Outline:
    """A design laid out."""

    waypoints: tuple[Waypoint, ...]
    laid_out: LaidOut
    rules: PlannerConfig
    """The planner's settings as they hold for it."""
    flaw: tuple[str, str] | None
    """Field and reason, if it could not be laid out."""
    order: SurfacingOrder | None = None
    """Rules by which the robot comes up by itself, if there are any."""


def lay(design: Design, around: Surroundings) -> Outline:
    """Lay a design out."""
    rules = rules_of(around.config, design, around.site)
    waypoints: tuple[Waypoint, ...] = ()
    order = None
    try:
        order = surfacing_order(design.surfacing, around.channels, around.announced)
        waypoints = waypoints_of(design, around.site, around.spacing_m)
        due_s = [(at - around.now).total_seconds() for at in design.surfacing.times]
        laid_out = lay_out(
            design,
            waypoints,
            rules,
            around.site,
            usual_deep_m=_usual_deep_m(around.config, rules),
            due_s=due_s,
        )
    except ValueError as error:
        field, colon, reason = str(error).partition(": ")
        flaw = (field, reason) if colon and " " not in field else ("content", str(error))
        return Outline(waypoints, LaidOut(), rules, flaw)
    return Outline(waypoints, laid_out, rules, None, order)


def surfacing_order(
    rules: SurfacingRules, channels: ChannelCatalogue, announced: Collection[int] | None = None
) -> SurfacingOrder | None:
    """Return the rules that the robot itself keeps, ``None`` if there are none.

    The program on board knows the delivered channels alone, whatever a team added ashore.

    Args:
        rules: The rules.
        channels: By which they name what is measured.
        announced: Numbers of what the robot measures, ``None`` if it announced nothing.

    Raises:
        ValueError: If a rule names a channel that is not in the catalogue, does not travel, or that
            the robot does not know or measure; the field is named.
    """
    if rules.samples_waiting is None and not rules.on_value:
        return None
    limits: list[ValueLimit] = []
    for number, rule in enumerate(rules.on_value):
        field, channel = f"surfacing.on_value.{number}", channels.get(rule.channel)
        if channel is None or not channel.wire_number:
            said = "is computed ashore" if channel else "is not in the catalogue"
            raise ValueError(f"{field}.channel: the channel {rule.channel} {said}")
        if CHANNELS.numbered(channel.wire_number) is None:
            said = "is the team's own, which the program on board does not know"
            raise ValueError(f"{field}.channel: the channel {rule.channel} {said}")
        if announced is not None and channel.wire_number not in announced:
            said = "is not among those that the robot announced to measure"
            raise ValueError(f"{field}.channel: the channel {rule.channel} {said}")
        if channel.fault(rule.value) is not None:
            span = f"{channel.low:g} to {channel.high:g} {channel.unit}"
            raise ValueError(f"{field}.value: {channel.title.lower()} lies within {span}")
        limits.append(ValueLimit(channel.wire_number, rule.side == "above", rule.value))
    return SurfacingOrder.of(rules.samples_waiting, rules.hold_off_s, limits)


def _usual_deep_m(config: PlannerConfig, rules: PlannerConfig) -> float:
    """Return how deep a robot dives where nobody says it, m.

    As deep as its surveys go, but not deeper than it may come down and up again before its position
    is less certain than the rules allow.
    """
    motion, deepest_m = config.primitives, config.domain.depth_max_m - config.floor_margin_m
    certain_s = blind_time_s(config.position_filter, rules.max_uncertainty_m**2)
    by_certainty_m = 0.5 * (certain_s - motion.point_interval_s) * motion.glide_speed_m_s
    return min(deepest_m, max(by_certainty_m, motion.depth_change_min_m))


def _usual_angle_rad(config: PlannerConfig) -> float:
    """Return how steep a robot glides where nobody says it: in the middle of its range."""
    return 0.5 * (config.primitives.glide_angle_min_rad + config.primitives.glide_angle_max_rad)


def whole_manner(design: Design, around: Surroundings) -> Manner:
    """Return how a design is flown, with nothing left to the robot."""
    manner = design.manner
    rules = rules_of(around.config, design, around.site)
    deep_m, angle_rad = _usual_deep_m(around.config, rules), _usual_angle_rad(around.config)
    said = {
        "deep_m": deep_m if manner.deep_m is None else manner.deep_m,
        "glide_angle_rad": angle_rad if manner.glide_angle_rad is None else manner.glide_angle_rad,
    }
    return manner.model_copy(update=said)


def outline_view(design: Design, around: Surroundings) -> OutlineView:
    """Return a design laid out, with its account and all that speaks against flying it."""
    found = lay(design, around)
    legs, rules = tuple(found.laid_out.legs), found.rules
    way, notes = _way(found, around)
    broken = (
        [OutlineViolationView(*found.flaw, _waypoint_of(found.flaw[0]), None, None)]
        if found.flaw
        else []
    )
    if legs:
        broken += _violations(legs, found, around.site)
    return OutlineView(
        waypoints=_waypoint_views(found),
        legs=leg_views(legs, found.laid_out.waypoint),
        way_there=way,
        account=None if not legs else _account(legs, rules, way, around),
        violations=broken,
        notes=[OutlineNoteView(one.waypoint, one.text) for one in found.laid_out.remarks] + notes,
        spacing_m=around.spacing_m,
        usual_deep_m=_usual_deep_m(around.config, rules),
        usual_angle_rad=_usual_angle_rad(around.config),
    )


def leg_views(legs: Sequence[Leg], waypoints: Sequence[int] | None = None) -> list[OutlineLegView]:
    """Return legs as a design shows them; those of a plan lead to waypoints of their own."""
    return [
        same(
            OutlineLegView,
            leg,
            number=number,
            waypoint=number if waypoints is None else waypoints[number],
        )
        for number, leg in enumerate(legs)
    ]


def _waypoint_views(found: Outline) -> list[OutlineWaypointView]:
    first: dict[int, int] = {}
    for number, waypoint in enumerate(found.laid_out.waypoint):
        first.setdefault(waypoint, number)
    return [
        same(OutlineWaypointView, one, number=number, first_leg=first.get(number))
        for number, one in enumerate(found.waypoints)
    ]


def _way(found: Outline, around: Surroundings) -> tuple[WayThereView | None, list[OutlineNoteView]]:
    """Return the way from the robot to the first waypoint, or why it is not known."""
    if around.robot_ned is None:
        text = "The robot has not said where it is: the way to the first waypoint is not counted."
        return None, [OutlineNoteView(None, text)]
    start = around.robot_ned[:2]
    try:
        leg = way_there(found.rules, start, found.waypoints)
    except ValueError as error:
        return None, [OutlineNoteView(0, f"On the way to the first waypoint the {error}.")]
    if leg is None:
        return None, []
    return way_there_view(leg), []


def patient(found: Outline, around: Surroundings) -> PlannerConfig:
    """Return the settings that a design's plan travels with.

    Raises:
        Problem: 409 if the robot cannot get to the first waypoint.
    """
    if around.robot_ned is None:
        return found.rules
    try:
        way = way_there(found.rules, around.robot_ned[:2], found.waypoints)
    except ValueError as error:
        raise conflict(f"On the way to the first waypoint the {error}.") from error
    return with_patience(found.rules, way)


def _violations(legs: tuple[Leg, ...], found: Outline, site: Site) -> list[OutlineViolationView]:
    views: list[OutlineViolationView] = []
    for one in violations(legs, found.rules, site):
        matched = _NUMBERED.match(one.field)
        leg = int(matched[2]) if matched and matched[1] == "legs" else None
        views.append(
            OutlineViolationView(
                one.field,
                one.message,
                None if leg is None else found.laid_out.waypoint[leg],
                leg,
                None if leg is None else _middle(legs[leg]),
            )
        )
    return views


def _waypoint_of(field: str) -> int | None:
    matched = _NUMBERED.match(field)
    return int(matched[2]) if matched and matched[1] == "waypoints" else None


def _middle(leg: Leg) -> PositionNed:
    (a, b, c), (x, y, z) = leg.start_ned, leg.end_ned
    return (a + x) / 2.0, (b + y) / 2.0, (c + z) / 2.0


def _account(
    legs: tuple[Leg, ...], rules: PlannerConfig, way: WayThereView | None, around: Surroundings
) -> OutlineAccountView:
    energy = legs_energy(rules, legs) + (0.0 if way is None else way.energy)
    duration_s = legs_duration_s(rules, legs)
    comes_up = surfacings(legs)
    after = _battery_after(legs, rules, duration_s, way, around)
    return OutlineAccountView(
        energy=energy,
        energy_wh=_watt_hours(around.vehicle, rules, energy)
        if after is None
        else after.used_wh.mean,
        duration_s=duration_s + (0.0 if way is None else way.duration_s),
        distance_m=sum(math.dist(leg.start_ned[:2], leg.end_ned[:2]) for leg in legs),
        surfacings=comes_up,
        worst_std_m=worst_std_m(legs, rules),
        satellite_bytes=comes_up * rules.mission.surfacing_bytes,
        credits=_credits(legs, rules, duration_s, around.tariff),
        battery_left=around.battery_left,
        battery_after=after,
    )


def _battery_after(
    legs: tuple[Leg, ...],
    rules: PlannerConfig,
    duration_s: float,
    way: WayThereView | None,
    around: Surroundings,
) -> BatteryAfterView | None:
    """Return what the battery has left at the end of legs, the way there flown before."""
    if around.battery is None:
        return None
    hours = hours_of_legs(legs, duration_s, rules.energy)
    there_h = 0.0 if way is None else way.duration_s / _S_PER_H
    hours[Use.SWIM] += there_h
    home = None
    if around.home_ne_m is not None:
        home_m = math.dist(around.home_ne_m, legs[-1].end_ned[:2])
        home = (home_m, home_m / rules.primitives.swim_speed_m_s / _S_PER_H)
    dives = 1 + sum(leg.start_ned[2] <= 0.0 for leg in legs[1:])
    return battery_after(around.battery, hours, dives, there_h, home)


def _watt_hours(vehicle: Vehicle | None, rules: PlannerConfig, units: float) -> float | None:
    if vehicle is None:
        return None
    try:
        return units * joules_per_unit(vehicle, rules.primitives, rules.energy) / _J_PER_WH
    except NoSteadyGlideError:
        return None


def _credits(
    legs: tuple[Leg, ...], rules: PlannerConfig, duration_s: float, tariff: Tariff
) -> int | None:
    settings = MissionSettings.of(rules, TrimConfig(), legs[0].start_ned, duration_s)
    try:
        return mission_credits(Mission.from_legs(settings, legs), tariff)
    except ValueError:
        return None


def worst_std_m(legs: Sequence[Leg], rules: PlannerConfig) -> float:
    """Return the greatest standard deviation of the position between two surfacings, m."""
    return max((float(std_m.max()) for _, std_m in doubts(rules, dives_of(legs))), default=0.0)
