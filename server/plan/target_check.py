"""What speaks against following a target, before anything is sent: limits, and what to know."""

import math
from collections.abc import Iterator
from datetime import datetime

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import Site
from autonomy.tracking.config import BarrierConfig, TrackingConfig
from autonomy.tracking.target_path import place
from db.query.mission.plans import PlanRecord
from robot_link.station.gateway.address import acoustic_address, is_acoustic
from server.fleet.status import SURFACE_DEPTH_M, RobotStatus
from server.plan.view import ViolationView

TEACHING = "teaching"
"""Field of the warning that marks a plan which lets the estimate diverge."""
_ADDRESS_MAX = 15
"""Micro-Modem addresses are 0..15."""
_CLASS_K = ("linear", "cubic")
_LEAST_CHARGE = 0.2
_PATH_POINTS, _PATH_POINTS_MAX = 301, 1001
_POINTS_OF_A_SWING = 16
_CRESTS = (0.25, 0.75)
"""Where in its period a sine is farthest from its middle."""

TargetPath = list[tuple[float, float, float]]


def target_path(config: TrackingConfig) -> TargetPath:
    """Return where a virtual target will be, time s, north, east m; nothing for a real one.

    Of a circle it is one round at the most, of a sine as many swings as its points can show.
    """
    if config.target.kind != "virtual":
        return []
    return _places(config, _path_times(config))


def _path_times(config: TrackingConfig) -> FloatArray:
    """Return moments of the mission, s, close enough for the path not to look like another."""
    target, until_s, points = config.target, config.motion.duration_s, _PATH_POINTS
    if target.path == "circle" and target.speed_m_s > 0.0:
        until_s = min(until_s, 2.0 * math.pi * target.width_m / target.speed_m_s)
    elif target.path == "sine":
        point_s = target.period_s / _POINTS_OF_A_SWING
        until_s = min(until_s, point_s * (_PATH_POINTS_MAX - 1))
        points = max(points, math.ceil(until_s / point_s) + 1)
    return np.linspace(0.0, until_s, points)


def _farthest_times(config: TrackingConfig) -> FloatArray:
    """Return moments between which the target goes no farther out of the water, s."""
    target, duration_s = config.target, config.motion.duration_s
    if target.path != "sine":
        return _path_times(config)
    begins_s = np.floor(np.linspace(0.0, duration_s, _PATH_POINTS) / target.period_s)
    crests_s = [(begins_s + crest) * target.period_s for crest in _CRESTS]
    times = np.unique(np.concatenate([_path_times(config), *crests_s, [duration_s]]))
    return times[times <= duration_s]


def _places(config: TrackingConfig, times: FloatArray) -> TargetPath:
    places = [(t_s, place(config.target, t_s)) for t_s in times.tolist()]
    return [
        (round(t_s, 3), round(there.north_m, 4), round(there.east_m, 4)) for t_s, there in places
    ]


def target_violations(status: RobotStatus, config: TrackingConfig) -> list[ViolationView]:
    """Return every limit that a mission to follow a target breaks now, by its field's path."""
    site = status.record.site
    found = [
        *_of_target(site, config),
        *_of_address(status, config),
        *_of_motion(site, config),
        *_of_robot(status),
    ]
    return [ViolationView(field, message) for field, message in found]


def target_warnings(
    status: RobotStatus, config: TrackingConfig, *, is_quiet: bool
) -> list[ViolationView]:
    """Return what a person should know before the mission is sent; none of it forbids that.

    Args:
        status: The robot.
        config: The mission.
        is_quiet: Whether the robot was told not to ping.
    """
    site = status.record.site
    found = list(_of_barrier(config.barrier))
    if is_quiet:
        found.append(
            (
                "quiet",
                f"{status.record.id} was told not to ping; let it ping again, or it hears no "
                "range.",
            )
        )
    if config.motion.depth_m > SURFACE_DEPTH_M and not site.radio_under_water:
        found.append(
            (
                "motion.depth_m",
                "There is no radio under water here: orders reach the robot when it comes up.",
            )
        )
    return [ViolationView(field, message) for field, message in found]


def _of_barrier(barrier: BarrierConfig) -> Iterator[tuple[str, str]]:
    if barrier.is_teaching:
        yield (
            TEACHING,
            "For teaching: the barrier is off. Nothing keeps the target observable, so the "
            "estimate may diverge, often by metres within some minutes.",
        )
    elif barrier.controller == "mpc_none":
        yield (
            "barrier.controller",
            "This controller does nothing to keep the target observable; it is for comparison.",
        )
    if barrier.controller != "barrier":
        return
    if barrier.alpha not in _CLASS_K:
        yield (
            "barrier.alpha",
            f"{barrier.alpha} is not class K: the robot may run away from its target.",
        )
    if barrier.fallback == "nominal":
        yield (
            "barrier.fallback",
            "Once the barrier cannot be kept the robot may not get out of that again.",
        )


def outdated_target(plan: PlanRecord, status: RobotStatus, now: datetime) -> list[ViolationView]:
    """Return why a plan that was made some time ago is not to be sent as it is.

    How far the robot is from where it was does not matter: it swims to its target from anywhere.
    """
    found = [ViolationView(field, message) for field, message in _of_robot(status)]
    limit_s = plan.document["draft_age_s"]
    age_s = (now - plan.created_at).total_seconds()
    if age_s > limit_s:
        text = f"The plan was made {age_s / 60.0:.0f} min ago; the limit is {limit_s / 60.0:g} min."
        found.append(ViolationView("mission.draft_age_s", text))
    return found


def _of_target(site: Site, config: TrackingConfig) -> Iterator[tuple[str, str]]:
    target = config.target
    north_m, east_m = target.north_m, target.east_m
    if not in_water(site, north_m, east_m):
        yield (
            "target.north_m",
            f"The target is at {north_m:g} m north, {east_m:g} m east, outside of the water of "
            f"{site.name} ({water_text(site)}).",
        )
        return
    floor_m = float(site.floor_m(north_m, east_m))
    if target.depth_m > floor_m:
        yield (
            "target.depth_m",
            f"The target is {target.depth_m:g} m deep; the floor there is {floor_m:.3g} m deep.",
        )
    way = _places(config, _farthest_times(config)) if target.kind == "virtual" else []
    for t_s, path_north_m, path_east_m in way:
        if not in_water(site, path_north_m, path_east_m):
            yield (
                "target.path",
                f"The target leaves the water of {site.name} ({water_text(site)}) after "
                f"{t_s:.0f} s, at {path_north_m:.4g} m north, {path_east_m:.4g} m east.",
            )
            break
    if target.kind == "tag" and config.filter.target_velocity == "known":
        yield (
            "filter.target_velocity",
            "The velocity of a tag is not known; have it estimated.",
        )
    speed_m_s = fastest_m_s(config)
    if speed_m_s >= config.motion.speed_max_m_s:
        yield (
            "target.speed_m_s",
            f"The target moves at up to {speed_m_s:.3g} m/s; the robot's speed cap is "
            f"{config.motion.speed_max_m_s:g} m/s.",
        )


def fastest_m_s(config: TrackingConfig) -> float:
    """Return the greatest speed of a virtual target, 0 for one that nobody knows."""
    target = config.target
    if target.kind != "virtual" or target.path == "static":
        return 0.0
    if target.path != "sine":
        return target.speed_m_s
    return math.hypot(target.speed_m_s, target.width_m * 2.0 * math.pi / target.period_s)


def _of_address(status: RobotStatus, config: TrackingConfig) -> Iterator[tuple[str, str]]:
    target = config.target
    if target.kind == "virtual":
        return
    if target.address > _ADDRESS_MAX:
        yield (
            "target.address",
            f"Acoustic modems have addresses of 0 to {_ADDRESS_MAX}, unlike {target.address}.",
        )
    for uri in status.record.links:
        if not is_acoustic(uri):
            continue
        known = acoustic_address(uri)
        if target.address == known.peer:
            owner = f"the modem of {status.record.id} itself"
        elif target.address == known.us:
            owner = "the station's modem"
        else:
            continue
        yield ("target.address", f"Address {target.address} is that of {owner}.")


def _of_motion(site: Site, config: TrackingConfig) -> Iterator[tuple[str, str]]:
    motion, water = config.motion, site.water
    if motion.depth_m > water.depth_max_m:
        yield (
            "motion.depth_m",
            f"The robot would swim {motion.depth_m:g} m deep; the water of {site.name} is "
            f"{water.depth_max_m:g} m deep.",
        )
    narrow_m = min(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m)
    if 2.0 * motion.margin_m >= narrow_m:
        yield (
            "motion.margin_m",
            f"{motion.margin_m:g} m from every side leaves no water: it is {narrow_m:g} m wide.",
        )


def _of_robot(status: RobotStatus) -> Iterator[tuple[str, str]]:
    state = status.state
    if state is None:
        return
    site, robot = status.record.site, status.record.id
    north_m, east_m = state.position_ned[:2]
    if not in_water(site, north_m, east_m, 2.0 * state.position_std_m):
        yield (
            "start",
            f"{robot} is at {north_m:.4g} m north, {east_m:.4g} m east, outside of the water of "
            f"{site.name} ({water_text(site)}).",
        )
    if state.battery_fraction < _LEAST_CHARGE:
        yield (
            "start",
            f"{robot} has {state.battery_fraction:.0%} of its battery left; it begins to follow a "
            f"target with {_LEAST_CHARGE:.0%} or more.",
        )


def in_water(site: Site, north_m: float, east_m: float, margin_m: float = 0.0) -> bool:
    """Tell whether a point of the surface is water, or at most so far outside of it."""
    if not site.water.contains(north_m, east_m, 0.0, margin_m):
        return False
    shore = site.shore
    return shore is None or float(shore.distance_m(north_m, east_m)) <= margin_m


def water_text(site: Site) -> str:
    """Return the extent of a site's water for a sentence."""
    water = site.water
    return (
        f"{water.x_min_m:g} to {water.x_max_m:g} m north, "
        f"{water.y_min_m:g} to {water.y_max_m:g} m east"
    )
