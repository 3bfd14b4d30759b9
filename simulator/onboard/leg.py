"""The legs of a plan that change depth: glide, spiral, dive."""

import math

from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind
from robot_link.messages import RobotMode
from simulator.onboard.course import anchored_end, is_surface, wrap
from simulator.onboard.depth_profile import DepthProfile
from simulator.onboard.hardware import SetPoints
from simulator.onboard.maneuver import SURFACED_M, Flight, Maneuver, Swim, bearing, distance
from simulator.onboard.navigation import Estimate
from simulator.onboard.pilot import DepthReference, forward_speed
from simulator.onboard.polar import GlidePolar

_AHEAD_RAD = math.radians(50.0)
_AIM_INTERVAL_S = 1.0
_THRUST_ON, _THRUST_OFF = 1.4, 1.15
"""Ratio of the speed that is needed to the fastest glide, at which the tail begins and ceases to
help."""
_DEPTH_TIMEOUT_S = 60.0


def begin_leg(flight: Flight, legs: tuple[Leg, ...], estimate: Estimate) -> Maneuver:
    """Return the maneuver that flies the first of these legs from where the robot is.

    Args:
        flight: The robot.
        legs: The leg to fly, and those after it until the next surfacing.
        estimate: Where the robot is.
    """
    leg = legs[0]
    end = anchored_end(legs, *estimate.position_ned[:2])
    match leg.kind:
        case PrimitiveKind.SWIM:
            return Swim(
                flight,
                end[:2],
                estimate,
                speed_m_s=leg.speed_m_s,
                depth_m=0.0 if is_surface(end[2]) else end[2],
            )
        case PrimitiveKind.GLIDE:
            return Glide(flight, end, leg.speed_m_s, estimate)
        case PrimitiveKind.SPIRAL:
            return Spiral(flight, leg, estimate)
        case PrimitiveKind.DIVE:
            return Dive(flight, leg, estimate)


class DepthChange:
    """The vertical part of a leg: how deep to be, how long it takes, when it is over.

    Args:
        flight: The robot.
        end_m: Depth at the end.
        speed_m_s: Vertical speed, a magnitude.
        estimate: Where it begins.
    """

    def __init__(self, flight: Flight, end_m: float, speed_m_s: float, estimate: Estimate) -> None:
        self._start_m = estimate.depth_m
        self._end_m = end_m
        self._speed_m_s = speed_m_s
        self._reversal_m_s2 = flight.profile.reversal_m_s2
        self.rate_m_s = math.copysign(speed_m_s, end_m - self._start_m)
        """Vertical speed of the leg, positive down."""
        self._profile = DepthProfile(
            self._start_m,
            estimate.velocity_ned[2],
            self.rate_m_s,
            self._reversal_m_s2,
            flight.profile.depth_leash_m,
        )
        self._left_s = 2.5 * abs(end_m - self._start_m) / speed_m_s + _DEPTH_TIMEOUT_S

    def step(self, estimate: Estimate, dt_s: float) -> DepthReference:
        """Return the depth to be at."""
        self._left_s -= dt_s
        return self._profile.step(estimate.depth_m, dt_s)

    def time_left_s(self, estimate: Estimate) -> float:
        """Return how long the rest takes at the leg's speed."""
        return abs(self._end_m - estimate.depth_m) / self._speed_m_s

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached, soon enough to turn round before passing it."""
        if self._left_s < 0.0:
            return True
        if is_surface(self._end_m):
            return estimate.depth_m < SURFACED_M
        down = math.copysign(1.0, self.rate_m_s)
        approach = max(down * estimate.velocity_ned[2], 0.0)
        coasting_m = approach**2 / (2.0 * self._reversal_m_s2)
        return down * (self._end_m - estimate.depth_m) <= coasting_m

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        whole = self._end_m - self._start_m
        return 1.0 if whole == 0.0 else (estimate.depth_m - self._start_m) / whole


class Glide:
    """Glides to a point: the path angle is chosen anew each second so that the leg ends there.

    The robot gathers speed slowly (its added mass forward is three times its mass), so the angle
    comes from the distance that is left after what the present speed will still carry it. The
    tail helps where even the flattest glide falls short.
    """

    mode = RobotMode.GLIDING

    def __init__(
        self, flight: Flight, end_ned: PositionNed, speed_m_s: float, estimate: Estimate
    ) -> None:
        self._flight = flight
        self._target = end_ned[:2]
        self._depth = DepthChange(flight, end_ned[2], speed_m_s, estimate)
        self._polar = GlidePolar(flight.vehicle, self._depth.rate_m_s)
        self._course = bearing(estimate, self._target)
        self._pitch_rad = estimate.pitch_rad
        self._wanted_pitch_rad = estimate.pitch_rad
        self._thrust = False
        self._next_aim_s = 0.0
        p = flight.vehicle.parameters
        gliding_speed = math.sqrt(2.0) * speed_m_s
        self._speeding_up_s = p.mass_1_kg / (
            p.water_density_kg_m3 * p.area_m2 * p.drag_0 * gliding_speed
        )

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Glide on."""
        towards = bearing(estimate, self._target)
        ahead = abs(wrap(towards - self._course)) < _AHEAD_RAD
        if ahead and distance(estimate, self._target) > self._flight.profile.near_m:
            self._course = towards
        self._next_aim_s -= dt_s
        if self._next_aim_s <= 0.0:
            self._next_aim_s = _AIM_INTERVAL_S
            self._aim(estimate)
        slew = self._flight.profile.pitch_rate_rad_s * dt_s
        self._pitch_rad += min(max(self._wanted_pitch_rad - self._pitch_rad, -slew), slew)
        return self._flight.pilot.glide(
            estimate,
            self._course,
            self._depth.step(estimate, dt_s),
            self._pitch_rad,
            thrust=self._thrust,
        )

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached."""
        return self._depth.is_done(estimate)

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        return self._depth.share(estimate)

    def _aim(self, estimate: Estimate) -> None:
        """Choose the pitch, and whether the tail helps."""
        north, east, _ = estimate.position_ned
        along_m = (self._target[0] - north) * math.cos(self._course) + (
            self._target[1] - east
        ) * math.sin(self._course)
        left_s = max(self._depth.time_left_s(estimate), _AIM_INTERVAL_S)
        # speed nears that of the steady glide exponentially
        coasting_s = self._speeding_up_s * -math.expm1(-left_s / self._speeding_up_s)
        carried_m = max(forward_speed(estimate), 0.0) * coasting_s
        needed = (along_m - carried_m) / max(left_s - coasting_s, 0.2 * left_s)
        vertical = abs(self._depth.rate_m_s)
        steepness = math.atan2(vertical, needed) if needed > 0.0 else math.pi / 2.0
        self._wanted_pitch_rad = self._polar.trim(steepness).pitch_rad
        fastest = vertical / math.tan(self._polar.flattest_rad)
        self._thrust = needed > fastest * (_THRUST_OFF if self._thrust else _THRUST_ON)


class Spiral:
    """Glides around a bend while it changes depth; where the bend begins is where the robot is."""

    mode = RobotMode.SPIRALLING

    def __init__(self, flight: Flight, leg: Leg, estimate: Estimate) -> None:
        self._flight = flight
        self._leg = leg
        self._depth = DepthChange(flight, leg.end_ned[2], leg.speed_m_s, estimate)
        path = abs(leg.radius_m * leg.turn_rad)
        rise = abs(leg.end_ned[2] - leg.start_ned[2])
        polar = GlidePolar(flight.vehicle, self._depth.rate_m_s)
        self._wanted_pitch_rad = polar.trim(math.atan2(rise, path)).pitch_rad
        self._pitch_rad = estimate.pitch_rad

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Follow the heading that belongs to the depth."""
        slew = self._flight.profile.pitch_rate_rad_s * dt_s
        self._pitch_rad += min(max(self._wanted_pitch_rad - self._pitch_rad, -slew), slew)
        turned = min(max(self._depth.share(estimate), 0.0), 1.0) * self._leg.turn_rad
        return self._flight.pilot.spiral(
            estimate,
            self._leg.heading_rad + turned,
            math.copysign(1.0, self._leg.turn_rad),
            self._depth.step(estimate, dt_s),
            self._pitch_rad,
        )

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached."""
        return self._depth.is_done(estimate)

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        return self._depth.share(estimate)


class Dive:
    """Sinks or rises with level hull."""

    mode = RobotMode.DIVING

    def __init__(self, flight: Flight, leg: Leg, estimate: Estimate) -> None:
        self._flight = flight
        self._depth = DepthChange(flight, leg.end_ned[2], leg.speed_m_s, estimate)

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Sink or rise on."""
        return self._flight.pilot.sink(estimate, self._depth.step(estimate, dt_s))

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached."""
        return self._depth.is_done(estimate)

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        return self._depth.share(estimate)
