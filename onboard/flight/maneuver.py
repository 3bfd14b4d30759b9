"""What the robot does at the surface and on its way up; the legs of a plan are in ``leg``."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from autonomy.site import Box, Site
from autonomy.vehicle.config import Vehicle
from onboard.flight.hardware import SetPoints
from onboard.flight.navigation import Estimate
from onboard.flight.pilot import DepthReference, Pilot, forward_speed, heading_error
from onboard.profile import FlightProfile
from robot_link.messages import RobotMode

ALIGNED_RAD = math.radians(15.0)
ALIGNED_S = 1.0
TURN_TIMEOUT_S = 90.0
SWIM_TIMEOUT_S = 60.0
CRAB_MOST = 0.7
"""Greatest part of a swim's speed that is spent against the current from aside."""


@dataclass(frozen=True, slots=True)
class Gait:
    """How gently the legs of a plan are flown, for actuators that follow no faster."""

    speed_share: float = 1.0
    """Vertical speed of a leg as a share of the planned one."""
    pitch_rate_rad_s: float = math.inf
    """How fast the wanted pitch may change; the profile's limit holds as well."""
    pitch_acceleration_rad_s2: float = math.inf
    """How fast that speed may change."""

    def is_near(self, other: "Gait") -> bool:
        """Tell whether a change to another is too small to be made."""
        return math.isclose(self.speed_share, other.speed_share, rel_tol=0.15) and math.isclose(
            self.pitch_rate_rad_s, other.pitch_rate_rad_s, rel_tol=0.15
        )


@dataclass(frozen=True, slots=True)
class Flight:
    """What every maneuver needs: the robot, its manners, where it is, and who moves it."""

    vehicle: Vehicle
    profile: FlightProfile
    site: Site
    pilot: Pilot
    gait: Gait = Gait()

    def is_surfaced(self, estimate: Estimate) -> bool:
        """Tell whether the robot lies at the surface."""
        return estimate.depth_m < self.profile.surfaced_m


class Maneuver(Protocol):
    """One activity of the robot; made anew each time it begins."""

    @property
    def mode(self) -> RobotMode:
        """What the robot says that it is doing."""
        ...

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Return the set points for the next ``dt_s`` seconds."""
        ...

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the aim is reached, or cannot be reached in reasonable time."""
        ...


class LegManeuver(Maneuver, Protocol):
    """A leg of a plan being flown."""

    def share(self, estimate: Estimate) -> float:
        """Return the part (0..1) of the leg that is flown."""
        ...


class Turn:
    """Turns at the surface, by swimming, until the nose points along a course at some speed.

    A glide that begins at rest would lose half a dive on gathering speed.
    """

    mode = RobotMode.TURNING

    def __init__(self, flight: Flight, course_rad: Callable[[Estimate], float]) -> None:
        self._flight = flight
        self._course_rad = course_rad
        self._aligned_s = 0.0
        self._elapsed_s = 0.0

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Swim towards the course."""
        course = self._course_rad(estimate)
        self._elapsed_s += dt_s
        aligned = abs(heading_error(estimate, course)) < ALIGNED_RAD
        aligned = aligned and forward_speed(estimate) > self._flight.profile.entry_speed_m_s
        self._aligned_s = self._aligned_s + dt_s if aligned else 0.0
        return self._flight.pilot.swim(estimate, course)

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the robot has swum along the course for a moment."""
        return self._aligned_s >= ALIGNED_S or self._elapsed_s > TURN_TIMEOUT_S


class Swim:
    """Swims straight to a point, at the surface or at a depth."""

    mode = RobotMode.SWIMMING

    def __init__(
        self,
        flight: Flight,
        target_ne_m: tuple[float, float],
        estimate: Estimate,
        depth_m: float = 0.0,
    ) -> None:
        self._flight = flight
        self._target = target_ne_m
        self._depth = DepthReference(depth_m)
        self._distance_m = max(distance(estimate, target_ne_m), flight.profile.arrival_m)
        self._course = self._towards(estimate)
        self._closest_m = self._distance_m
        expected_s = self._distance_m / flight.profile.swimming_speed_m_s
        self._left_s = 2.0 * expected_s + SWIM_TIMEOUT_S

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Swim on."""
        self._left_s -= dt_s
        if distance(estimate, self._target) > self._flight.profile.near_m:
            self._course = self._towards(estimate)
        pilot = self._flight.pilot
        if self._depth.depth_m == 0.0:
            return pilot.swim(estimate, self._course)
        return pilot.swim_at_depth(estimate, self._course, self._depth)

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the point is reached, or was passed closely."""
        left_m = distance(estimate, self._target)
        arrival_m = self._flight.profile.arrival_m
        self._closest_m = min(self._closest_m, left_m)
        passed = self._closest_m < 2.0 * arrival_m and left_m > self._closest_m + 0.25 * arrival_m
        return left_m < arrival_m or passed or self._left_s < 0.0

    def share(self, estimate: Estimate) -> float:
        """Return the part of the distance that is done."""
        return 1.0 - distance(estimate, self._target) / self._distance_m

    def _towards(self, estimate: Estimate) -> float:
        """Return the heading that leads straight to the target over ground."""
        course = bearing(estimate, self._target)
        north, east = estimate.current.sure_ne_m_s
        aside_m_s = east * math.cos(course) - north * math.sin(course)
        share = aside_m_s / self._flight.profile.swimming_speed_m_s
        return course - math.asin(min(max(share, -CRAB_MOST), CRAB_MOST))


class Float:
    """Lies at the surface, and swims back when the water has carried it out of the domain."""

    def __init__(self, flight: Flight, mode: RobotMode) -> None:
        self.mode = mode
        self._flight = flight
        self._return: Swim | None = None

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Stay where it is."""
        domain = self._flight.site.domain
        slack_m = self._flight.profile.arrival_m
        north, east, _ = estimate.position_ned
        if self._return is None and not domain.contains(north, east, 0.0, slack_m):
            self._return = Swim(self._flight, nearest_inside(domain, north, east), estimate)
        if self._return is not None and self._return.is_done(estimate):
            self._return = None
        if self._return is None:
            return self._flight.pilot.rest()
        return self._return.step(estimate, dt_s)

    def is_done(self, estimate: Estimate) -> bool:
        """Return False: somebody else ends it."""
        return False


class Rise:
    """Comes up at once, wherever that is."""

    mode = RobotMode.ABORTING

    def __init__(self, flight: Flight) -> None:
        self._flight = flight

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Rise."""
        return self._flight.pilot.rise()

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether it lies at the surface."""
        return self._flight.is_surfaced(estimate)


def distance(estimate: Estimate, target_ne_m: tuple[float, float]) -> float:
    """Return the horizontal distance to a point."""
    north, east, _ = estimate.position_ned
    return math.hypot(target_ne_m[0] - north, target_ne_m[1] - east)


def bearing(estimate: Estimate, target_ne_m: tuple[float, float]) -> float:
    """Return the course to a point."""
    north, east, _ = estimate.position_ned
    return math.atan2(target_ne_m[1] - east, target_ne_m[0] - north)


def carried(
    place_ne_m: tuple[float, float], estimate: Estimate, time_s: float
) -> tuple[float, float]:
    """Return where the believed current carries what is at a place, in a time; m."""
    north, east = estimate.current.sure_ne_m_s
    return place_ne_m[0] + north * time_s, place_ne_m[1] + east * time_s


def nearest_inside(box: Box, north_m: float, east_m: float) -> tuple[float, float]:
    """Return the horizontal point of a box that is nearest to a position."""
    return (
        min(max(north_m, box.x_min_m), box.x_max_m),
        min(max(east_m, box.y_min_m), box.y_max_m),
    )
