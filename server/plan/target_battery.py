"""Whether a robot's battery lasts for a mission that follows a target."""

import math

from autonomy.planner.config import PlannerConfig
from autonomy.tracking.config import TrackingConfig
from autonomy.vehicle.battery import RESERVE, BatteryConfig, swimming_power_w
from autonomy.vehicle.config import Vehicle
from robot_link.messages import StateReport
from server.base.configuration import ConfigurationBook
from server.fleet.fleet import Fleet
from server.plan.target_account import dives_of, is_deep
from server.plan.view import BatteryView, ViolationView

_S_PER_H = 3600.0


async def target_battery(
    book: ConfigurationBook, fleet: Fleet, robot: str, config: TrackingConfig
) -> BatteryView | None:
    """Return what a mission takes from a robot's battery, by the settings that hold now.

    Returns:
        ``None`` for a robot of an unknown vehicle.
    """
    vehicle = fleet.vehicle(robot)
    if vehicle is None:
        return None
    planner = (await book.current("planner", robot)).value_as(PlannerConfig)
    battery = (await book.current("battery", robot)).value_as(BatteryConfig)
    return battery_of(config, planner, vehicle, battery, fleet.status(robot).state)


def battery_of(
    config: TrackingConfig,
    planner: PlannerConfig,
    vehicle: Vehicle,
    battery: BatteryConfig,
    state: StateReport | None,
) -> BatteryView:
    """Return what a mission takes from a battery of which the robot said how full it is."""
    power_w = swimming_power_w(vehicle, is_deep=is_deep(config, planner))
    power_w += vehicle.energy.pump_full_w * dives_of(config, planner, vehicle).pumping_share
    full_s = battery.capacity_wh * _S_PER_H / power_w if power_w else math.inf
    left = None if state is None else state.battery_fraction
    lasts_s = None if left is None or not power_w else max(0.0, left - RESERVE) * full_s
    return BatteryView(config.motion.duration_s / full_s, left, RESERVE, lasts_s)


def battery_violations(robot: str, battery: BatteryView | None) -> list[ViolationView]:
    """Return that the battery does not last for a mission, nothing if it does or nobody knows."""
    if battery is None or battery.left is None or battery.lasts_s is None:
        return []
    if battery.used <= battery.left - battery.reserve:
        return []
    text = (
        f"Following for so long takes about {battery.used:.0%} of a full battery; {robot} has "
        f"{battery.left:.0%} left and ends its mission at {battery.reserve:.0%}: that lasts for "
        f"about {battery.lasts_s:.0f} s."
    )
    return [ViolationView("motion.duration_s", text)]
