"""How the robot moves: floats, swims, glides; from what is wanted to actuator set points."""

import math
from dataclasses import dataclass

from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.config import BacksteppingConfig
from autonomy.control.controller import (
    BacksteppingController,
    CompiledController,
    Controller,
)
from autonomy.control.trajectory import Reference
from autonomy.tracking.control.inner_loop import TailBeat
from autonomy.vehicle.config import Vehicle
from onboard.flight.course import wrap
from onboard.flight.hardware import SetPoints
from onboard.flight.navigation import Estimate

FLOATING_SHARE = 0.15
"""Part of the greatest buoyancy that keeps the robot at the surface and is quickly pumped away."""
SWIMMING_PITCH_RAD = math.radians(4.0)
"""Nose up at the surface: a swimming robot dives otherwise. Kept by the sliding mass."""
RISING_SHARE = 0.6
RISING_MASS_SHARE = 0.5
"""Parts of buoyancy and sliding mass for coming up: fast, yet far from a vertical attitude."""
SWIMMING_GAIN = 2.0
SWIMMING_BIAS_MAX_RAD = 1.35
"""Tail bias by heading error; a flapping robot turns at a rate nearly proportional to the bias."""
RUDDER_GAIN = 1.5
RUDDER_MAX_RAD = 0.6
SPIRAL_RUDDER_RAD = 0.8
SPIRAL_RUDDER_MAX_RAD = 1.7
FLAP_AT_RAD = math.radians(25.0)
GLIDE_AT_RAD = math.radians(8.0)
"""A gliding robot turns slowly by its rudder: it flaps until the heading error is small again."""
BRAKING_GAIN_S_M = 25.0
BRAKING_PITCH_MAX_RAD = math.radians(35.0)
"""Pitch of a flat dive by the horizontal speed that it should not have."""
PITCH_RATE_MAX_RAD_S, PITCH_ACCELERATION_MAX_RAD_S2 = 0.1, 0.05
"""A wanted pitch that changes faster begins anew; what slews is slower."""
AHEAD_M = 0.1
"""Distance of the tracked point ahead of the robot; it only sets the direction to go."""


@dataclass(frozen=True, slots=True)
class DepthReference:
    """Depth to hold at this moment, and its derivatives; positive down."""

    depth_m: float
    rate_m_s: float = 0.0
    acceleration_m_s2: float = 0.0


class Pilot:
    """Turns what is wanted of the motion into set points.

    Depth and pitch are controlled by a law that tracks a point just ahead on the course; by the
    proposed backstepping law (thesis Eq. 3.19) unless a mission brings another. The tail is the
    pilot's own, because it also flaps.

    Args:
        vehicle: The robot.
        config: Gains of the backstepping law.
        period_s: Time between two steps, for laws that remember.
    """

    def __init__(self, vehicle: Vehicle, config: BacksteppingConfig, period_s: float = 0.1) -> None:
        self._vehicle = vehicle
        self._period_s = period_s
        self.controller: Controller = BacksteppingController(vehicle, config)
        """The law; may be replaced between two steps."""
        self._robust: CompiledController | None = None
        self.wanted_pitch_rad: float | None = None
        """Pitch that the law holds in this step; None while none does."""
        self._last_pitch_rad: float | None = None
        self._last_pitch_rate_rad_s = 0.0
        self._flaps = False

    def know_mass(self, rate_share: float, delay_s: float) -> None:
        """Fly with a sliding mass that is slower or later than the vehicle's, from now on.

        A law that can count on it is told; another gives way to the robust one until
        ``forget_mass``.

        Args:
            rate_share: Its greatest speed as a share of the nominal one.
            delay_s: Time between a command and the beginning of its answer.
        """
        if self.controller.knows_mass:
            self.controller.know_mass(rate_share, delay_s)
            return
        if self._robust is None:
            kind = CONTROLLERS["controller.governor"]
            self._robust = CompiledController(
                kind.law, self._vehicle, kind.packed(kind.preset(self._vehicle.key))
            )
        self._robust.know_mass(rate_share, delay_s)

    def forget_mass(self) -> None:
        """Fly with the law that was chosen: the sliding mass is as the vehicle's model says."""
        self._robust = None
        self.controller.forget_mass()

    def begin_step(self) -> None:
        """Let a step begin: what the last one held is past."""
        self._last_pitch_rad, self.wanted_pitch_rad = self.wanted_pitch_rad, None

    def reset(self) -> None:
        """Forget what the laws learned of an earlier leg."""
        for law in (self.controller, self._robust):
            if law is not None:
                law.reset()

    def rest(self) -> SetPoints:
        """Lie at the surface."""
        return SetPoints(FLOATING_SHARE * self._vehicle.limits.m0_min_kg, self._vehicle.swim.rp1_m)

    def rise(self) -> SetPoints:
        """Come up as fast as is safe, wherever that leads."""
        limits = self._vehicle.limits
        return SetPoints(RISING_SHARE * limits.m0_min_kg, RISING_MASS_SHARE * limits.rp1_min_m)

    def swim(self, estimate: Estimate, course_rad: float) -> SetPoints:
        """Swim at the surface and turn towards a course, on the spot if it is far off.

        Args:
            estimate: Where the robot believes to be.
            course_rad: Wanted heading.
        """
        return self._flapping(estimate, course_rad, self._afloat(estimate))

    def swim_at_depth(
        self, estimate: Estimate, course_rad: float, depth: DepthReference
    ) -> SetPoints:
        """Swim level at a depth; arguments as of ``swim``."""
        level = self._track(estimate, depth, 0.0)
        return self._flapping(estimate, course_rad, level)

    def beat(self, estimate: Estimate, beat: TailBeat, level: SetPoints | None = None) -> SetPoints:
        """Swim with a given beat of the tail, at the surface or at a depth.

        Args:
            estimate: Where the robot believes to be.
            beat: What the tail does.
            level: Net mass and sliding mass that keep the depth; None is the surface.
        """
        trim = self._afloat(estimate) if level is None else level
        return SetPoints(
            trim.net_buoyancy_kg,
            trim.mass_position_m,
            tail_rad=beat.bias_rad,
            tail_amplitude_rad=beat.amplitude_rad,
            tail_frequency_hz=beat.frequency_hz,
        )

    def sink(
        self, estimate: Estimate, depth: DepthReference, forward_speed_m_s: float
    ) -> SetPoints:
        """Change depth with nearly level hull and straight tail.

        A hull that sinks or rises nose up or nose down slides sideways through the water; that is
        the brake against the speed that the robot brought along.

        Args:
            estimate: Where the robot believes to be.
            depth: Depth to be at.
            forward_speed_m_s: Wanted horizontal speed along the heading.
        """
        excess = forward_speed(estimate) - forward_speed_m_s
        down = math.copysign(1.0, depth.rate_m_s)
        pitch = down * _clip(BRAKING_GAIN_S_M * excess, BRAKING_PITCH_MAX_RAD)
        return self._track(estimate, depth, pitch)

    def glide(
        self,
        estimate: Estimate,
        course_rad: float,
        depth: DepthReference,
        pitch_rad: float,
        *,
        net_buoyancy_max_kg: float,
        thrust: bool,
    ) -> SetPoints:
        """Glide towards a course.

        Args:
            estimate: Where the robot believes to be.
            course_rad: Wanted heading.
            depth: Depth to be at.
            pitch_rad: Wanted pitch.
            net_buoyancy_max_kg: Greatest magnitude of the net mass.
            thrust: Whether the tail shall push as well.
        """
        tracked = self._track(estimate, depth, pitch_rad, net_buoyancy_max_kg)
        if self._needs_flap(estimate, course_rad) or thrust:
            return self._flapping(estimate, course_rad, tracked)
        rudder = -RUDDER_GAIN * heading_error(estimate, course_rad)
        return _with_tail(tracked, _clip(rudder, RUDDER_MAX_RAD))

    def spiral(
        self,
        estimate: Estimate,
        heading_rad: float,
        turn_sign: float,
        depth: DepthReference,
        pitch_rad: float,
        *,
        net_buoyancy_max_kg: float,
    ) -> SetPoints:
        """Glide around a bend by the rudder alone.

        Args:
            estimate: Where the robot believes to be.
            heading_rad: Heading at this point of the bend.
            turn_sign: +1 to starboard, -1 to port.
            depth: Depth to be at.
            pitch_rad: Wanted pitch.
            net_buoyancy_max_kg: Greatest magnitude of the net mass.
        """
        error = heading_error(estimate, heading_rad)
        tail = -SPIRAL_RUDDER_RAD * turn_sign - SWIMMING_GAIN * error
        tracked = self._track(estimate, depth, pitch_rad, net_buoyancy_max_kg)
        return _with_tail(tracked, _clip(tail, SPIRAL_RUDDER_MAX_RAD))

    def _afloat(self, estimate: Estimate) -> SetPoints:
        """Return net mass and sliding mass of swimming at the surface."""
        limits = self._vehicle.limits
        excess = estimate.pitch_rad - SWIMMING_PITCH_RAD
        return SetPoints(
            FLOATING_SHARE * limits.m0_min_kg,
            self._vehicle.swim.rp1_m + abs(limits.rp1_min_m) * excess,
        )

    def _track(
        self,
        estimate: Estimate,
        depth: DepthReference,
        pitch_rad: float,
        net_buoyancy_max_kg: float = math.inf,
    ) -> SetPoints:
        """Return net mass and sliding mass of the backstepping law, tail straight."""
        heading = estimate.heading_rad
        north, east, _ = estimate.position_ned
        speed = forward_speed(estimate)
        ahead = (math.cos(heading), math.sin(heading))
        law: Controller = self._robust or self.controller
        pitch_rate = pitch_acceleration = 0.0
        if law.knows_mass:
            seen = estimate.readings
            law.hear(seen.net_buoyancy_kg, seen.mass_position_m, seen.tail_rad)
            if self._last_pitch_rad is not None:
                change = (pitch_rad - self._last_pitch_rad) / self._period_s
                pitch_rate = _clip(change, PITCH_RATE_MAX_RAD_S)
                change = (pitch_rate - self._last_pitch_rate_rad_s) / self._period_s
                pitch_acceleration = _clip(change, PITCH_ACCELERATION_MAX_RAD_S2)
        self._last_pitch_rate_rad_s = pitch_rate
        self.wanted_pitch_rad = pitch_rad
        command = law.command(
            estimate.state,
            Reference(
                (north + AHEAD_M * ahead[0], east + AHEAD_M * ahead[1], depth.depth_m),
                pitch_rad,
                (speed * ahead[0], speed * ahead[1], depth.rate_m_s),
                pitch_rate,
                acceleration_ned=(0.0, 0.0, depth.acceleration_m_s2),
                pitch_acceleration_rad_s2=pitch_acceleration,
            ),
            self._period_s,
        )
        return SetPoints(_clip(command.m0_kg, net_buoyancy_max_kg), command.rp1_m)

    def _needs_flap(self, estimate: Estimate, course_rad: float) -> bool:
        """Tell whether only the flapping tail turns the robot soon enough; with hysteresis."""
        limit = GLIDE_AT_RAD if self._flaps else FLAP_AT_RAD
        self._flaps = abs(heading_error(estimate, course_rad)) > limit
        return self._flaps

    def _flapping(self, estimate: Estimate, course_rad: float, trim: SetPoints) -> SetPoints:
        error = heading_error(estimate, course_rad)
        return SetPoints(
            trim.net_buoyancy_kg,
            trim.mass_position_m,
            tail_rad=_clip(-SWIMMING_GAIN * error, SWIMMING_BIAS_MAX_RAD),
            tail_amplitude_rad=self._vehicle.swim.amplitude_rad,
            tail_frequency_hz=self._vehicle.swim.frequency_hz,
        )


def heading_error(estimate: Estimate, course_rad: float) -> float:
    """Return how far to starboard a course lies of the mean heading, in -pi..pi."""
    return wrap(course_rad - estimate.course_heading_rad)


def forward_speed(estimate: Estimate) -> float:
    """Return the horizontal speed through the water along the heading."""
    north, east, _ = estimate.velocity_ned
    heading = estimate.heading_rad
    return north * math.cos(heading) + east * math.sin(heading)


def _with_tail(trim: SetPoints, tail_rad: float) -> SetPoints:
    return SetPoints(trim.net_buoyancy_kg, trim.mass_position_m, tail_rad=tail_rad)


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
