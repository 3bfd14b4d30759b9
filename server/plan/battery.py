"""Whether a robot's battery lasts for a plan of any kind, and for the way home."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.energy_use import EnergyEstimate, Use
from autonomy.planner.approach import swim_to
from autonomy.planner.config import EnergyConfig, PlannerConfig
from autonomy.planner.plan import Leg
from autonomy.tracking.config import TrackingConfig
from autonomy.vehicle.battery import swimming_power_w
from autonomy.vehicle.config import Vehicle
from server.base.foundation import Foundation
from server.battery.battery_use import Battery, BatteryUse
from server.battery.flown import hours_of_legs
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus
from server.plan.target_account import dives_of, is_deep
from server.plan.view import BatteryView, ViolationView

_S_PER_H = 3600.0
BATTERY = "battery"
"""Field of what says that a battery does not last."""


@dataclass(frozen=True, slots=True)
class WayHome:
    """The swim from where a plan ends to where the robot was put into the water."""

    distance_m: float = 0.0
    hours: float = 0.0


class PlanBattery:
    """Says what plans take from batteries, by the settings that hold now."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._book = foundation.configurations
        self._fleet = fleet
        self._batteries = foundation.services.get(BatteryUse)

    async def of_legs(
        self, robot: str, config: PlannerConfig, legs: Sequence[Leg], duration_s: float
    ) -> BatteryView | None:
        """Return what a plan with legs takes, and the way there from where the robot is now.

        ``None`` for a robot of an unknown vehicle.
        """
        battery = await self._batteries.of(robot)
        if battery is None or not legs:
            return None
        home = await self._batteries.home_ne_m(robot)
        end = legs[-1].end_ned
        back = WayHome()
        if home is not None:
            distance_m = math.dist(home, end[:2])
            back = WayHome(distance_m, distance_m / config.primitives.swim_speed_m_s / _S_PER_H)
        there = way_there(self._fleet.status(robot), config, legs)
        there_s = 0.0 if there is None else there.duration_s
        return battery_of_legs(battery, legs, duration_s, back, config.energy, there_s=there_s)

    async def of_target(self, robot: str, config: TrackingConfig) -> BatteryView | None:
        """Return what a plan that follows a target takes, ``None`` as ``of_legs``."""
        vehicle, battery = self._fleet.vehicle(robot), await self._batteries.of(robot)
        if vehicle is None or battery is None:
            return None
        planner = (await self._book.current("planner", robot)).value_as(PlannerConfig)
        return battery_of_target(config, planner, vehicle, battery)


def way_there(status: RobotStatus, config: PlannerConfig, legs: Sequence[Leg]) -> Leg | None:
    """Return the swim to where legs begin, from where the robot is or comes up next.

    ``None`` where it is there, has not said where it is, or cannot swim against the current: that
    the plan's legs say.
    """
    begins_ne_m = status.begins_ne_m()
    if begins_ne_m is None:
        return None
    try:
        return swim_to(config, begins_ne_m, legs[0].start_ned[:2])
    except ValueError:
        return None


def battery_of_legs(
    battery: Battery,
    legs: Sequence[Leg],
    duration_s: float,
    home: WayHome,
    prices: EnergyConfig,
    *,
    there_s: float = 0.0,
) -> BatteryView:
    """Return what a plan with legs takes.

    Args:
        battery: The robot's.
        legs: The plan's.
        duration_s: How long it takes, surfacings included.
        home: The way from its end.
        prices: By which the legs' energies were counted.
        there_s: How long the robot swims before it begins.
    """
    hours = hours_of_legs(legs, duration_s, prices)
    hours[Use.SWIM] += there_s / _S_PER_H
    dives = 1 + sum(leg.start_ned[2] <= 0.0 for leg in legs[1:])
    return _view(battery, hours, dives, home)


def battery_of_target(
    config: TrackingConfig, planner: PlannerConfig, vehicle: Vehicle, battery: Battery
) -> BatteryView:
    """Return what following a target takes, of which nobody knows where it ends.

    It swims all the time; what a dive for it takes on top of swimming is the model's.
    """
    power_w = swimming_power_w(vehicle, is_deep=is_deep(config, planner))
    power_w += vehicle.energy.pump_full_w * dives_of(config, planner, vehicle).pumping_share
    swimming_w = float(battery.use.prior_w[Use.SWIM])
    hours = np.zeros(len(Use))
    hours[Use.SWIM] = config.motion.duration_s / _S_PER_H * power_w / swimming_w
    found = _view(battery, hours, 1, WayHome())
    if found.lasts_s is None:
        return found
    return replace(found, lasts_s=found.lasts_s * swimming_w / power_w)


def _view(battery: Battery, hours: FloatArray, dives: int, home: WayHome) -> BatteryView:
    config, use = battery.config, battery.use
    takes = use.energy(hours, pieces=dives)
    on_the_way = np.zeros(len(Use))
    on_the_way[Use.SWIM] = home.hours
    home_wh = use.energy(on_the_way).mean_wh
    lasts_s = None
    if battery.left is not None:
        free_wh = (battery.left - config.reserve) * config.capacity_wh - home_wh
        lasts_s = max(0.0, free_wh) * _S_PER_H / _rate_w(takes, hours)
    return BatteryView(
        used=takes.mean_wh / config.capacity_wh,
        left=battery.left,
        reserve=config.reserve,
        lasts_s=lasts_s,
        used_wh=takes.mean_wh,
        used_low_wh=takes.low_wh,
        used_high_wh=takes.high_wh,
        home_wh=home_wh,
        home_m=home.distance_m,
        capacity_wh=config.capacity_wh,
        is_learned=use.is_learned(hours),
    )


def _rate_w(takes: EnergyEstimate, hours: FloatArray) -> float:
    return max(takes.mean_wh, 1e-9) / max(float(hours.sum()), 1e-9)


def battery_violations(robot: str, battery: BatteryView | None) -> list[ViolationView]:
    """Return that the battery does not last for a plan, nothing if it does or nobody knows."""
    if battery is None or battery.left is None or battery.lasts_s is None:
        return []
    capacity_wh, used_wh = battery.capacity_wh or 0.0, battery.used_wh or 0.0
    free_wh = (battery.left - battery.reserve) * capacity_wh
    short_wh = used_wh + battery.home_wh - free_wh
    if short_wh <= 1e-9 * capacity_wh:
        return []
    way = ""
    if battery.home_m > 0.0:
        way = f" and the way home of {battery.home_m:.0f} m {_wh(battery.home_wh)}"
    text = (
        f"The plan takes about {_wh(used_wh)}, {battery.used:.0%} of a full battery{way}; {robot} "
        f"has {battery.left:.0%} left and must keep {battery.reserve:.0%}, so that "
        f"{_wh(max(0.0, free_wh))} are free: {_wh(short_wh)} too much. "
        f"The battery lasts for about {battery.lasts_s:.0f} s of this."
    )
    return [ViolationView(BATTERY, text)]


def _wh(energy_wh: float) -> str:
    return f"{energy_wh:.{2 if energy_wh < 10.0 else 0}f} Wh"
