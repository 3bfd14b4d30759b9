"""What following a target costs: energy, time, surfacings."""

import math
from dataclasses import dataclass

from autonomy.estimation.position import blind_time_s, drifted_variance
from autonomy.planner.config import EnergyConfig, PlannerConfig
from autonomy.planner.leg import primitive
from autonomy.planner.plan import PrimitiveKind
from autonomy.tracking.config import TrackingConfig
from autonomy.vehicle.config import Vehicle
from robot_link.messages import StateReport
from server.plan.view import AccountView, BatteryView

_LEAST_S = 1.0
"""No robot comes up more often."""


@dataclass(frozen=True, slots=True)
class Dives:
    """How a pursuit is parted by surfacings for a fix; at the surface it is one piece."""

    between_s: float
    """From one surfacing to the next; infinite where none is needed."""
    rising_s: float
    """Of that, coming up, while the tail rests."""
    limit_m: float
    """Standard deviation of the position at which it comes up."""

    @property
    def share(self) -> float:
        """Part of the time in which the tail beats."""
        return 1.0 - self.rising_s / self.between_s

    @property
    def pumping_share(self) -> float:
        """Part of the time in which the pump works to bring the robot up and down again."""
        return min(2.0 * self.rising_s / self.between_s, 1.0)

    def surfacings(self, duration_s: float) -> int:
        """Return how often the robot comes up in this time, the end of it included."""
        return max(1, math.ceil(duration_s / self.between_s))


def dives_of(config: TrackingConfig, planner: PlannerConfig, vehicle: Vehicle | None) -> Dives:
    """Return how often a robot that follows a target has to come up.

    At the surface it knows where it is, and near a beacon its ranges tell it.

    Args:
        config: The mission.
        planner: The robot's settings: how fast its position drifts, how uncertain it may become.
        vehicle: Its model; without one its ballast takes no time.
    """
    position, limit_m = planner.position_filter, planner.max_uncertainty_m
    drifts = position.drift_m_sqrt_s > 0.0 or position.steady_current_m_s > 0.0
    if not is_deep(config, planner) or config.target.kind == "beacon" or not drifts:
        return Dives(math.inf, 0.0, limit_m)
    span_m2 = limit_m**2 - position.fix_std_m**2
    blind_s = blind_time_s(position, max(0.0, span_m2))  # until the position is too uncertain
    # the pump takes in what let the robot float, and gives it out again
    limits = None if vehicle is None else vehicle.limits
    ballast_s = 0.0 if limits is None else -limits.m0_min_kg / limits.m0_rate_kg_s
    up_s = 2.0 * ballast_s + planner.mission.turn_time_s
    return Dives(max(blind_s + up_s, _LEAST_S), ballast_s, limit_m)


def target_account(
    config: TrackingConfig,
    planner: PlannerConfig,
    vehicle: Vehicle | None,
    state: StateReport | None,
    *,
    size: int,
    credits: int | None,
    battery: BatteryView | None,
) -> AccountView:
    """Return what a mission costs of which every second is needed.

    Args:
        config: The mission.
        planner: The robot's settings.
        vehicle: Its model, if it is known.
        state: Where it is, if it has said so.
        size: Bytes of the mission document.
        credits: What sending that by satellite costs.
        battery: What it takes from the battery, if that is known.
    """
    duration_s, dives = config.motion.duration_s, dives_of(config, planner, vehicle)
    std_m = 0.0 if state is None else state.position_std_m
    if is_deep(config, planner):
        drifted_m = math.sqrt(drifted_variance(planner.position_filter, duration_s))
        std_m = min(math.hypot(std_m, drifted_m), max(std_m, dives.limit_m))
    surfacings = dives.surfacings(duration_s)
    return AccountView(
        energy=_energy(_prices(planner, vehicle), duration_s, dives.share),
        duration_s=duration_s,
        worst_std_m=std_m,
        bytes=size,
        credits=credits,
        surfacings=surfacings,
        satellite_bytes=surfacings * planner.mission.surfacing_bytes,
        battery=battery,
    )


def is_deep(config: TrackingConfig, planner: PlannerConfig) -> bool:
    """Tell whether the robot swims deeper than where its position can be fixed."""
    return config.motion.depth_m > planner.position_filter.surface_depth_m


def _prices(planner: PlannerConfig, vehicle: Vehicle | None) -> EnergyConfig:
    """Return the prices of the robot's own beat."""
    if vehicle is None:
        return planner.energy
    gait = vehicle.swim
    beat = {"tail_amplitude_rad": gait.amplitude_rad, "tail_frequency_hz": gait.frequency_hz}
    return planner.energy.model_copy(update=beat)


def _energy(prices: EnergyConfig, duration_s: float, share: float) -> float:
    """Return the energy units of a time in which the tail beats for this part."""
    swum_s = share * duration_s
    swimming = primitive.energy(PrimitiveKind.SWIM, swum_s, prices)
    return swimming + prices.time_factor * (duration_s - swum_s)
