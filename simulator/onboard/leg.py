"""The legs of a plan that change depth: glide, spiral, dive."""

import math

from autonomy.planner.plan import Leg, PrimitiveKind
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
_SETTLING_S = 5.0


def begin_leg(flight: Flight, legs: tuple[Leg, ...], estimate: Estimate) -> Maneuver:
    """Return the maneuver that flies the first of these legs from where the robot is.

    Args:
        flight: The robot.
        legs: The leg to fly, and those after it until the next surfacing.
        estimate: Where the robot is.
    """
    leg = legs[0]
    end = anchored_end(legs, *estimate.position_ned[:2])
    if leg.kind is PrimitiveKind.SWIM:
        depth_m = 0.0 if is_surface(end[2]) else end[2]
        return Swim(flight, end[:2], estimate, speed_m_s=leg.speed_m_s, depth_m=depth_m)
    depth = DepthChange(flight, legs, estimate)
    if leg.kind is PrimitiveKind.GLIDE:
        return Glide(flight, depth, end[:2], estimate)
    if leg.kind is PrimitiveKind.SPIRAL:
        return Spiral(flight, depth, leg, estimate)
    return Dive(flight, depth, end[:2])


class DepthChange:
    """The vertical part of a leg: how deep to be, how long it takes, when it is over.

    Args:
        flight: The robot.
        legs: The leg, and those after it until the next surfacing.
        estimate: Where it begins.
    """

    def __init__(self, flight: Flight, legs: tuple[Leg, ...], estimate: Estimate) -> None:
        end_m, speed_m_s = legs[0].end_ned[2], legs[0].speed_m_s
        self._start_m = estimate.depth_m
        self._end_m = end_m
        self._speed_m_s = speed_m_s
        self._reversal_m_s2 = flight.profile.reversal_m_s2
        self._pump_kg_s = flight.vehicle.limits.m0_rate_kg_s
        after_m = legs[1].end_ned[2] if len(legs) > 1 else end_m
        self._goes_on = (after_m - end_m) * (end_m - self._start_m) > 0.0
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
        """Tell whether the depth is reached, or will be while the robot turns round."""
        if self._left_s < 0.0:
            return True
        if is_surface(self._end_m):
            return estimate.depth_m < SURFACED_M
        down = math.copysign(1.0, self.rate_m_s)
        coasting_m = 0.0
        if not self._goes_on:
            approach = max(down * estimate.velocity_ned[2], 0.0)
            pumping_s = max(down * estimate.readings.net_buoyancy_kg, 0.0) / self._pump_kg_s
            coasting_m = approach * (approach / (2.0 * self._reversal_m_s2) + 0.6 * pumping_s)
        return down * (self._end_m - estimate.depth_m) <= coasting_m

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        whole = self._end_m - self._start_m
        return 1.0 if whole == 0.0 else (estimate.depth_m - self._start_m) / whole


class PitchAim:
    """Chooses the path angle of a glide anew each second, so that the leg ends at its distance.

    The robot gathers speed slowly (its added mass forward is three times its mass), so the angle
    comes from the distance that is left after what the present speed will still carry it.

    Args:
        flight: The robot.
        depth: The vertical part of the leg.
        estimate: Where it begins.
    """

    def __init__(self, flight: Flight, depth: DepthChange, estimate: Estimate) -> None:
        self._depth = depth
        self._polar = GlidePolar(flight.vehicle, depth.rate_m_s)
        self._slew_rad_s = flight.profile.pitch_rate_rad_s
        self._wanted_rad = self._pitch_rad = estimate.pitch_rad
        self._next_s = 0.0
        p = flight.vehicle.parameters
        gliding_m_s = math.sqrt(2.0) * abs(depth.rate_m_s)
        self._speeding_up_s = p.mass_1_kg / (
            p.water_density_kg_m3 * p.area_m2 * p.drag_0 * gliding_m_s
        )
        self.falls_short = False
        """Whether even the flattest glide ends well before the target."""

    def step(self, estimate: Estimate, left_m: float, dt_s: float) -> float:
        """Return the pitch to hold when ``left_m`` metres of horizontal way are left."""
        self._next_s -= dt_s
        if self._next_s <= 0.0:
            self._next_s = _AIM_INTERVAL_S
            self._aim(estimate, left_m)
        slew = self._slew_rad_s * dt_s
        self._pitch_rad += min(max(self._wanted_rad - self._pitch_rad, -slew), slew)
        return self._pitch_rad

    def _aim(self, estimate: Estimate, left_m: float) -> None:
        left_s = max(self._depth.time_left_s(estimate), _AIM_INTERVAL_S)
        # speed nears that of the steady glide exponentially
        coasting_s = self._speeding_up_s * -math.expm1(-left_s / self._speeding_up_s)
        carried_m = max(forward_speed(estimate), 0.0) * coasting_s
        needed = (left_m - carried_m) / max(left_s - coasting_s, 0.2 * left_s)
        vertical = abs(self._depth.rate_m_s)
        steepness = math.atan2(vertical, needed) if needed > 0.0 else math.pi / 2.0
        self._wanted_rad = self._polar.trim(steepness).pitch_rad
        fastest = vertical / math.tan(self._polar.flattest_rad)
        self.falls_short = needed > fastest * (_THRUST_OFF if self.falls_short else _THRUST_ON)


class Glide:
    """Glides to a point; the tail helps where even the flattest glide falls short."""

    mode = RobotMode.GLIDING

    def __init__(
        self,
        flight: Flight,
        depth: DepthChange,
        target_ne_m: tuple[float, float],
        estimate: Estimate,
    ) -> None:
        self._flight = flight
        self._target = target_ne_m
        self._depth = depth
        self._aim = PitchAim(flight, depth, estimate)
        self._course = bearing(estimate, target_ne_m)

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Glide on; a target that is reached early is not turned back to."""
        left_m = distance(estimate, self._target)
        towards = bearing(estimate, self._target)
        off = wrap(towards - self._course)
        if abs(off) < _AHEAD_RAD and left_m > self._flight.profile.near_m:
            self._course = towards
            off = 0.0
        pitch = self._aim.step(estimate, left_m * math.cos(off), dt_s)
        depth = self._depth.step(estimate, dt_s)
        thrust = self._aim.falls_short
        return self._flight.pilot.glide(estimate, self._course, depth, pitch, thrust=thrust)

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached."""
        return self._depth.is_done(estimate)

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        return self._depth.share(estimate)


class Spiral:
    """Glides around a bend while it changes depth; the bend begins where the robot is."""

    mode = RobotMode.SPIRALLING

    def __init__(self, flight: Flight, depth: DepthChange, leg: Leg, estimate: Estimate) -> None:
        self._flight = flight
        self._leg = leg
        self._depth = depth
        self._aim = PitchAim(flight, depth, estimate)
        self._arc_m = abs(leg.radius_m * leg.turn_rad)

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Follow the heading that belongs to the depth."""
        done = min(max(self._depth.share(estimate), 0.0), 1.0)
        turn = self._leg.turn_rad
        return self._flight.pilot.spiral(
            estimate,
            self._leg.heading_rad + done * turn,
            math.copysign(1.0, turn),
            self._depth.step(estimate, dt_s),
            self._aim.step(estimate, (1.0 - done) * self._arc_m, dt_s),
        )

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached."""
        return self._depth.is_done(estimate)

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        return self._depth.share(estimate)


class Dive:
    """Sinks or rises with nearly level hull, as straight as its speed at the beginning allows."""

    mode = RobotMode.DIVING

    def __init__(
        self, flight: Flight, depth: DepthChange, target_ne_m: tuple[float, float]
    ) -> None:
        self._flight = flight
        self._target = target_ne_m
        self._depth = depth

    def step(self, estimate: Estimate, dt_s: float) -> SetPoints:
        """Sink or rise on."""
        along_m = distance(estimate, self._target) * math.cos(
            bearing(estimate, self._target) - estimate.course_heading_rad
        )
        left_s = self._depth.time_left_s(estimate) + _SETTLING_S
        depth = self._depth.step(estimate, dt_s)
        return self._flight.pilot.sink(estimate, depth, along_m / left_s)

    def is_done(self, estimate: Estimate) -> bool:
        """Tell whether the depth is reached."""
        return self._depth.is_done(estimate)

    def share(self, estimate: Estimate) -> float:
        """Return the part of the depth change that is done."""
        return self._depth.share(estimate)
