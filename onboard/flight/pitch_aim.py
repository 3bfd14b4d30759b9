"""The pitch of a glide, chosen so that the leg ends at its planned distance."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.glide import NoSteadyGlideError, angle_of_attack, glide_inputs
from onboard.flight.depth_change import DepthChange
from onboard.flight.maneuver import Flight
from onboard.flight.navigation import Estimate
from onboard.flight.pilot import forward_speed

_GRID_RAD = np.radians(np.arange(25.0, 76.0, 1.0))
_MIDDLE_RAD = math.radians(45.0)
_SLOWER = 0.95
AIM_INTERVAL_S = 1.0
LEAST_SETTLED_SHARE = 0.2
BUOYANCY_RESERVE = 1.2
RUN_OUT_SHARE = 0.4
"""Time constant of slowing down in a flat dive, which brakes, relative to that of a glide."""
SHORT_ON, SHORT_OFF = 1.4, 1.15
"""Ratio of the speed that is needed to the fastest glide, at which the leg begins and ceases to
count as falling short."""


class GlidePolar:
    """Steady glides of a vehicle at one vertical speed, one way.

    Args:
        vehicle: The robot.
        vertical_speed_m_s: Wanted rate of depth, positive down, not 0. A rate that the pump cannot
            bring about on a path of 45 degrees is lowered until it can.
    """

    def __init__(self, vehicle: Vehicle, vertical_speed_m_s: float) -> None:
        sign = -math.copysign(1.0, vertical_speed_m_s)
        speed = abs(vertical_speed_m_s)
        while not _can_hold(vehicle, sign * _MIDDLE_RAD, speed):
            speed *= _SLOWER
        self.rate_m_s = -sign * speed
        """Rate of depth that is held, positive down."""
        steepness = [s for s in _GRID_RAD.tolist() if _can_hold(vehicle, sign * s, speed)]
        pitch = [sign * s + angle_of_attack(vehicle.parameters, sign * s) for s in steepness]
        self._steepness_rad = np.array(steepness)
        self._pitch_rad = np.array(pitch)
        self.net_buoyancy_max_kg = abs(glide_inputs(vehicle, sign * steepness[0], speed)[0])
        """Magnitude of the net mass on the flattest path, which needs the most."""

    def pitch_rad(self, steepness_rad: float) -> float:
        """Return the pitch on the path nearest to a steepness (0 level, pi/2 straight)."""
        return float(np.interp(steepness_rad, self._steepness_rad, self._pitch_rad))

    @property
    def table_rad(self) -> tuple[FloatArray, FloatArray]:
        """Steepness of each path, ascending, and the pitch on it."""
        return self._steepness_rad, self._pitch_rad

    @property
    def fastest_m_s(self) -> float:
        """Horizontal speed of the flattest glide."""
        return abs(self.rate_m_s) / math.tan(self._steepness_rad[0])


class PitchAim:
    """Chooses the path angle of a glide anew each second.

    The robot gathers speed slowly (its added mass forward is three times its mass), so the angle
    comes from the distance that is left after what the present speed will still carry it.

    Args:
        flight: The robot.
        polar: Its steady glides at the leg's rate of depth.
        depth: The vertical part of the leg.
        estimate: Where it begins.
        stops: Whether the next leg has to shed the speed of this one: its run-out is allowed for.
    """

    def __init__(
        self,
        flight: Flight,
        polar: GlidePolar,
        depth: DepthChange,
        estimate: Estimate,
        *,
        stops: bool,
    ) -> None:
        self._polar = polar
        self._depth = depth
        self.net_buoyancy_max_kg = BUOYANCY_RESERVE * polar.net_buoyancy_max_kg
        """More is of no use to a glide: it only takes longer to pump away again."""
        self._slew_rad_s = min(flight.profile.pitch_rate_rad_s, flight.gait.pitch_rate_rad_s)
        self._slew_growth_rad_s2 = flight.gait.pitch_acceleration_rad_s2
        self._rate_rad_s = 0.0
        self._wanted_rad = self._pitch_rad = estimate.pitch_rad
        self._next_s = 0.0
        p = flight.vehicle.parameters
        drag_kg_m = p.water_density_kg_m3 * p.area_m2 * p.drag_0
        gliding_m_s = math.sqrt(2.0) * abs(polar.rate_m_s)
        self._speeding_up_s = p.mass_1_kg / (drag_kg_m * gliding_m_s)
        self._run_out_s = RUN_OUT_SHARE * self._speeding_up_s if stops else 0.0
        self.falls_short = False
        """Whether even the flattest glide ends well before the target."""

    def step(self, estimate: Estimate, left_m: float, dt_s: float) -> float:
        """Return the pitch to hold when ``left_m`` metres of horizontal way are left."""
        self._next_s -= dt_s
        if self._next_s <= 0.0:
            self._next_s = AIM_INTERVAL_S
            self._aim(estimate, left_m)
        self._pitch_rad += self._change(dt_s)
        return self._pitch_rad

    def _change(self, dt_s: float) -> float:
        """Return by how much the pitch to hold moves on towards the wanted one."""
        left_rad, slew = self._wanted_rad - self._pitch_rad, self._slew_rad_s
        if math.isinf(self._slew_growth_rad_s2):
            return min(max(left_rad, -slew * dt_s), slew * dt_s)
        stopping = math.sqrt(2.0 * self._slew_growth_rad_s2 * abs(left_rad))
        rate = math.copysign(min(stopping, slew, abs(left_rad) / dt_s), left_rad)
        most = self._slew_growth_rad_s2 * dt_s
        self._rate_rad_s += min(max(rate - self._rate_rad_s, -most), most)
        return self._rate_rad_s * dt_s

    def _aim(self, estimate: Estimate, left_m: float) -> None:
        left_s = max(self._depth.time_left_s(estimate), AIM_INTERVAL_S)
        left_m -= self._run_out_s * max(forward_speed(estimate), 0.0)
        # speed nears that of the steady glide exponentially
        coasting_s = self._speeding_up_s * -math.expm1(-left_s / self._speeding_up_s)
        carried_m = max(forward_speed(estimate), 0.0) * coasting_s
        settled_s = max(left_s - coasting_s, LEAST_SETTLED_SHARE * left_s)
        needed_m_s = (left_m - carried_m) / settled_s
        rate = abs(self._polar.rate_m_s)
        steepness = math.atan2(rate, needed_m_s) if needed_m_s > 0.0 else math.pi / 2.0
        self._wanted_rad = self._polar.pitch_rad(steepness)
        limit = SHORT_OFF if self.falls_short else SHORT_ON
        self.falls_short = needed_m_s > limit * self._polar.fastest_m_s


def _can_hold(vehicle: Vehicle, path_angle_rad: float, speed_m_s: float) -> bool:
    try:
        glide_inputs(vehicle, path_angle_rad, speed_m_s)
    except NoSteadyGlideError:
        return False
    return True
