"""What a robot's designs are laid out with, as it is now."""

from autonomy.field.config import FieldConfig
from autonomy.planner.config import PlannerConfig
from robot_link.satellite.config import SatelliteConfig
from server.base.foundation import Foundation
from server.battery.battery_use import BatteryUse
from server.design.outline import Surroundings
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus
from server.plan.planning import Planning

_LINES_MIN = 4


async def surroundings(
    foundation: Foundation, fleet: Fleet, planning: Planning, robot: str
) -> tuple[str | None, Surroundings]:
    """Return the version of the planner's settings that holds for a robot, and all about it.

    Raises:
        Problem: 404 for an unknown robot, 409 for one that flies no plans.
    """
    book = foundation.configurations
    status = fleet.status(robot)
    holds = await book.current("planner", robot)
    config = await planning.settings.merged(robot, {})
    everywhere = config.model_copy(update={"domain": status.record.site.water})
    current = await planning.in_water(robot, everywhere)
    config = current.config.model_copy(update={"domain": config.domain})
    field = (await book.current("field", robot)).value_as(FieldConfig)
    state, batteries = status.state, foundation.services.get(BatteryUse)
    around = Surroundings(
        config=config,
        current_text=current.text,
        site=status.record.site,
        spacing_m=_spacing_m(field, config),
        robot_ned=None if state is None else state.position_ned,
        battery_left=None if state is None else state.battery_fraction,
        battery=await batteries.of(robot),
        home_ne_m=await batteries.home_ne_m(robot),
        vehicle=fleet.vehicle(robot),
        tariff=(await book.current("satellite", robot)).value_as(SatelliteConfig).tariff,
        now=foundation.clock.now(),
        channels=foundation.channels.catalogue,
        announced=_announced(status),
    )
    return holds.id, around


def _announced(status: RobotStatus) -> frozenset[int] | None:
    """Return the numbers of what a robot announced and means as the catalogue does."""
    if status.announced is None:
        return None
    numbers = {row.number for row in status.announced.table.rows}
    return frozenset(numbers - set(status.channel_faults))


def _spacing_m(field: FieldConfig, config: PlannerConfig) -> float:
    """Return the horizontal correlation length of the robot's map; four lines fit its domain."""
    north_m, east_m, _ = field.single.length_scales_m()
    domain = config.domain
    widest_m = max(domain.x_max_m - domain.x_min_m, domain.y_max_m - domain.y_min_m)
    return min(north_m, east_m, widest_m / _LINES_MIN)
