"""The legs of a plan, flown: glide, spiral, dive; a swim is the maneuver of that name."""

import math
from typing import Protocol

from autonomy.planner.plan import Leg, PrimitiveKind
from onboard.flight.course import anchored_end, is_surface, wrap
from onboard.flight.depth_change import DepthChange
from onboard.flight.hardware import SetPoints
from onboard.flight.maneuver import Flight, LegManeuver, Swim, bearing, distance
from onboard.flight.navigation import Estimate
from onboard.flight.pilot import DepthReference
from onboard.flight.pitch_aim import GlidePolar, PitchAim
from robot_link.messages import RobotMode

_AHEAD_RAD = math.radians(50.0)
_SETTLING_S = 5.0


def begin_leg(flight: Flight, legs: tuple[Leg, ...], estimate: Estimate) -> LegManeuver:
    """Return the maneuver that flies the first of these legs from where the robot is.

    Args:
        flight: The robot.
        legs: The leg to fly, and those after it until the next surfacing.
        estimate: Where the robot is.
    """
    leg = legs[0]
    end = anchored_end(legs, *estimate.position_ned[:2])
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
        glide = Glide(flight, aim, end[:2], bearing(estimate, end[:2]))
        return DepthLeg(RobotMode.GLIDING, depth, glide)
    return DepthLeg(RobotMode.SPIRALLING, depth, Spiral(flight, depth, aim, leg))


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
    """Glides to a point; the tail helps where even the flattest glide falls short."""

    def __init__(
        self,
        flight: Flight,
        aim: PitchAim,
        target_ne_m: tuple[float, float],
        course_rad: float,
    ) -> None:
        self._flight = flight
        self._aim = aim
        self._target = target_ne_m
        self._course = course_rad

    def step(self, estimate: Estimate, depth: DepthReference, dt_s: float) -> SetPoints:
        """Glide on; a target that is passed early is not turned back to."""
        left_m = distance(estimate, self._target)
        off = wrap(bearing(estimate, self._target) - self._course)
        if abs(off) < _AHEAD_RAD and left_m > self._flight.profile.near_m:
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
        off = bearing(estimate, self._target) - estimate.course_heading_rad
        along_m = distance(estimate, self._target) * math.cos(off)
        left_s = self._depth.time_left_s(estimate) + _SETTLING_S
        return self._flight.pilot.sink(estimate, depth, along_m / left_s)


def first_course(flight: Flight, legs: tuple[Leg, ...], headed: Leg, estimate: Estimate) -> float:
    """Return the course of the first leg that has one, from where the robot is now."""
    if headed is legs[0] and headed.kind is PrimitiveKind.GLIDE:
        end = anchored_end(legs, *estimate.position_ned[:2])[:2]
        if distance(estimate, end) > flight.profile.aim_m:
            return bearing(estimate, end)
    return headed.heading_rad
