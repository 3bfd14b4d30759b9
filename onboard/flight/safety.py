"""Limits that bring the robot up: for good, or for the rest of one dive."""

from autonomy.planner.plan import PrimitiveKind
from autonomy.site import Site
from autonomy.tracking.config import TrackingConfig
from autonomy.vehicle.battery import RESERVE
from autonomy.vehicle.config import ActuatorLimits
from autonomy.vehicle.trim import trim_flaw
from onboard.flight.course import is_surface
from onboard.flight.maneuver import Flight
from onboard.flight.navigation import Estimate
from robot_link.mission import Mission, MissionSettings


def mission_over(settings: MissionSettings, elapsed_s: float, estimate: Estimate) -> str:
    """Return why the whole mission must end, or "".

    Args:
        settings: Limits of the mission.
        elapsed_s: Time since it began.
        estimate: Where the robot is.
    """
    if elapsed_s > settings.timeout_s:
        return f"the mission took longer than {settings.timeout_s:.0f} s"
    if estimate.readings.battery_fraction < RESERVE:
        return f"the battery is below {RESERVE:.0%}"
    return ""


DOUBT_STDS = 2.0
"""So many standard deviations of the position are kept from walls and shore at least."""


def danger(flight: Flight, settings: MissionSettings, estimate: Estimate) -> str:
    """Return why this dive must end, or "": uncertainty, floor, or walls and shore.

    Kept from walls and shore is the profile's margin, or twice the standard deviation of the
    position where that is more.
    """
    north, east, depth = estimate.position_ned
    if flight.is_surfaced(estimate):
        return ""
    if settings.is_too_uncertain(estimate.position_std_m):
        return "the position is too uncertain"
    profile = flight.profile
    if depth > float(flight.site.floor_m(north, east)) - profile.floor_margin_m:
        return "the floor is near"
    if flight.site.clearance_m(north, east) < kept_from_walls_m(flight, estimate):
        return "a wall or the shore is near"
    return ""


def kept_from_walls_m(flight: Flight, estimate: Estimate) -> float:
    """Return how far the robot keeps from walls and shore, as sure as it is of its position."""
    return max(flight.profile.shore_margin_m, DOUBT_STDS * estimate.position_std_m)


def plan_flaw(mission: Mission, site: Site, limits: ActuatorLimits) -> str:
    """Return why a plan cannot be flown here by this robot at all, or ""."""
    settings = mission.settings
    trim = trim_flaw(settings.net_buoyancy_offset_kg, settings.mass_position_offset_m, limits)
    if mission.tracking is not None:
        return _target_flaw(mission.tracking.config(), site) or trim
    if not mission.legs:
        return "the plan has no legs"
    for number, leg in enumerate(mission.legs, start=1):
        if not site.water.contains(*leg.end_ned):
            return f"leg {number} leaves the water of {site.name}"
        if leg.speed_m_s <= 0.0:
            return f"leg {number} has no speed"
        if leg.kind is PrimitiveKind.KEEP and (leg.duration_s <= 0.0 or leg.radius_m <= 0.0):
            return f"leg {number} keeps a place for no time or within no radius"
        if leg.kind is PrimitiveKind.KEEP and not is_surface(leg.end_ned[2]):
            return f"leg {number} keeps a place under water"
    return trim


def _target_flaw(config: TrackingConfig, site: Site) -> str:
    """Return why a target cannot be followed here at all, or ""."""
    target = config.target
    if (
        site.clearance_m(target.north_m, target.east_m) < 0.0
        or target.depth_m > site.water.depth_max_m
    ):
        return f"the target is not in the water of {site.name}"
    if config.motion.depth_m > site.water.depth_max_m:
        return f"{config.motion.depth_m:g} m is deeper than the water of {site.name}"
    if config.filter.target_velocity == "known" and target.kind == "tag":
        return "the velocity of a tag is not known on board"
    return ""
