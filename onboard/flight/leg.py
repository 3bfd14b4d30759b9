"""The legs of a plan, flown: glide, spiral, dive; swim and keep are maneuvers of their own."""

import math
from typing import Protocol

from autonomy.planner.plan import Leg, PrimitiveKind
from onboard.flight.course import adrift_s, anchored_end, is_surface, wrap
from onboard.flight.depth_change import DepthChange
from onboard.flight.hardware import SetPoints
from onboard.flight.keep import Keep
from onboard.flight.maneuver import (
    Flight,
    LegManeuver,
    Swim,
    bearing,
    carried,
    distance,
)
from onboard.flight.navigation import Estimate
from onboard.flight.pilot import DepthReference
from onboard.flight.pitch_aim import GlidePolar, PitchAim
from robot_link.messages import RobotMode

AHEAD_RAD = math.radians(50.0)
SETTLING_S = 5.0


_NorthEast = tuple[float, float]
_STILL: _NorthEast = (0.0, 0.0)


def begin_leg(
    flight: Flight,
    legs: tuple[Leg, ...],
    estimate: Estimate,
    planned_ne_m_s: _NorthEast = _STILL,
    passed_s: float = 0.0,
) -> LegManeuver:
    """Return the maneuver that flies the first of these legs from where the robot is.

    Args:
        flight: The robot.
        legs: The leg to fly, and those after it until the next surfacing.
        estimate: Where the robot is.
        planned_ne_m_s: Current that the plan counts on.
        passed_s: Time of a stay at the surface that is over already.
    """
    leg = legs[0]
    if leg.kind is PrimitiveKind.KEEP:
        return Keep(flight, leg, passed_s)
    end = anchored_end(legs, *estimate.position_ned[:2])
    if leg.kind in {PrimitiveKind.GLIDE, PrimitiveKind.SWIM}:
        end = (*upstream(end[:2], legs[1:], estimate, planned_ne_m_s), end[2])
    if leg.kind is PrimitiveKind.SWIM:
        return Swim(flight, end[:2], estimate, 0.0 if is_surface(end[2]) else end[2])
    speed_m_s = flight.gait.speed_share * leg.speed_m_s
    rate_m_s = math.copysign(speed_m_s, end[2] - estimate.depth_m)
    if leg.kind is PrimitiveKind.DIVE:
        depth = DepthChange(flight, legs, rate_m_s, estimate)
        return DepthLeg(RobotMode.DIVING, depth, FlatDive(flight, depth, end[:2]))
    polar = GlidePolar(flight.vehicle, rate_m_s)
    depth = DepthChange(flight, legs, polar.rate_m_s, estimate)
    stops = any(after.kind is PrimitiveKind.DIVE for after in legs[1:2])
    aim = PitchAim(flight, polar, depth, estimate, stops=stops)
    if leg.kind is PrimitiveKind.GLIDE:
        glide = Glide(flight, depth, aim, end[:2], estimate)
        return DepthLeg(RobotMode.GLIDING, depth, glide)
    return DepthLeg(RobotMode.SPIRALLING, depth, Spiral(flight, depth, aim, leg))


def upstream(
    place_ne_m: _NorthEast,
    legs: tuple[Leg, ...],
    estimate: Estimate,
    planned_ne_m_s: _NorthEast,
) -> _NorthEast:
    """Return where to begin these legs instead, so that the water carries them along the plan.

    Bends and flat dives are not steered: half of what a current carries them beyond what the plan
    counts on is kept in hand.

    Args:
        place_ne_m: Where the plan has the first one begin.
        legs: Up to the next surfacing.
        estimate: Which current the robot believes in.
        planned_ne_m_s: Which one the plan counts on.
    """
    believed = estimate.current.sure_ne_m_s
    if believed == _STILL:
        return place_ne_m
    half_s = 0.5 * adrift_s(legs)
    return (
        place_ne_m[0] - half_s * (believed[0] - planned_ne_m_s[0]),
        place_ne_m[1] - half_s * (believed[1] - planned_ne_m_s[1]),
    )


class Motion(Protocol):
    """How a leg moves horizontally while it changes depth."""

    def step(self, estimate: Estimate, depth: DepthReference, dt_s: float) -> SetPoints:
        """Return the set points for the next ``dt_s`` seconds, with this depth to be at."""
        ...


class DepthLeg:
    """A leg that ends when its depth is reached."""

    def __init__(self, mode: RobotMode, depth: DepthChange, motion: Motion) -> None:
        self.mode = mode
        self._depth = depth
        self._motion = motion

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Fly on."""
        return self._motion.step(estimate, self._depth.step(estimate, dt_s), dt_s)

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached."""
        return self._depth.is_done(estimate)

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        return self._depth.share(estimate)


class Glide:
    """Glides to a point; the tail helps where even the flattest glide falls short.

    It steers and holds its speed through the water for the point from which the water carries it to
    its target in the time that is left: so its way over ground is straight in any current.
    """

    def __init__(
        self,
        flight: Flight,
        depth: DepthChange,
        aim: PitchAim,
        target_ne_m: tuple[float, float],
        estimate: Estimate,
    ) -> None:
        self._flight = flight
        self._depth = depth
        self._aim = aim
        self._target = target_ne_m
        self._course = bearing(estimate, self._aimed_at(estimate))

    def step(self, estimate: Estimate, depth: DepthReference, dt_s: float) -> SetPoints:
        """Glide on; a target that is passed early is not turned back to."""
        target = self._aimed_at(estimate)
        left_m = distance(estimate, target)
        off = wrap(bearing(estimate, target) - self._course)
        if abs(off) < AHEAD_RAD and left_m > self._flight.profile.near_m:
            self._course = wrap(self._course + off)
            off = 0.0
        return self._flight.pilot.glide(
            estimate,
            self._course,
            depth,
            self._aim.step(estimate, left_m * math.cos(off), dt_s),
            net_buoyancy_max_kg=self._aim.net_buoyancy_max_kg,
            thrust=self._aim.falls_short,
        )

    def _aimed_at(self, estimate: Estimate) -> tuple[float, float]:
        return carried(self._target, estimate, -self._depth.time_left_s(estimate))


class Spiral:
    """Glides around a bend that begins where the robot is; the depth tells how far along it is."""

    def __init__(self, flight: Flight, depth: DepthChange, aim: PitchAim, leg: Leg) -> None:
        self._flight = flight
        self._depth = depth
        self._aim = aim
        self._leg = leg
        self._arc_m = abs(leg.radius_m * leg.turn_rad)

    def step(self, estimate: Estimate, depth: DepthReference, dt_s: float) -> SetPoints:
        """Follow the heading that belongs to the depth."""
        done = self._depth.share(estimate)
        turn = self._leg.turn_rad
        return self._flight.pilot.spiral(
            estimate,
            self._leg.heading_rad + done * turn,
            math.copysign(1.0, turn),
            depth,
            self._aim.step(estimate, (1.0 - done) * self._arc_m, dt_s),
            net_buoyancy_max_kg=self._aim.net_buoyancy_max_kg,
        )


class FlatDive:
    """Keeps the hull nearly level, and the path as straight as the speed brought along allows."""

    def __init__(
        self, flight: Flight, depth: DepthChange, target_ne_m: tuple[float, float]
    ) -> None:
        self._flight = flight
        self._depth = depth
        self._target = target_ne_m

    def step(self, estimate: Estimate, depth: DepthReference, dt_s: float) -> SetPoints:
        """Sink or rise on."""
        left_s = self._depth.time_left_s(estimate) + SETTLING_S
        target = carried(self._target, estimate, -left_s)
        off = bearing(estimate, target) - estimate.course_heading_rad
        along_m = distance(estimate, target) * math.cos(off)
        return self._flight.pilot.sink(estimate, depth, along_m / left_s)


def first_course(flight: Flight, legs: tuple[Leg, ...], headed: Leg, estimate: Estimate) -> float:
    """Return the course of the first leg that has one, from where the robot is now."""
    if headed is legs[0] and headed.kind is PrimitiveKind.GLIDE:
        end = anchored_end(legs, *estimate.position_ned[:2])[:2]
        end = carried(end, estimate, -headed.duration_s / flight.gait.speed_share)
        if distance(estimate, end) > flight.profile.aim_m:
            return bearing(estimate, end)
    return headed.heading_rad
