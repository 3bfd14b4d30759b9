"""The planner's settings as compiled code takes them."""

import math
from typing import NamedTuple

from autonomy.current.table import FlowTable
from autonomy.estimation.known_current import forgotten_per_s3
from autonomy.estimation.position import surface_covariance
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.drift import has_current
from autonomy.planner.leg.edge import SHAPE_COLUMNS
from autonomy.planner.leg.primitive import HEADWAY_MIN


class Limits(NamedTuple):
    """What edges are made from, unpacked from ``PlannerConfig`` for compiled code; SI and rad."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    depth_max: float
    glide_speed: float
    glide_angle_min: float
    glide_angle_max: float
    spiral_speed: float
    spiral_radius_min: float
    spiral_radius_max: float
    spiral_rise_min: float
    spiral_rise_max: float
    dive_speed: float
    swim_speed: float
    swim_length_min: float
    swim_length_max: float
    swims_under_water: bool
    depth_change_min: float
    primitives_max: int
    bearing_noise: float
    point_interval: float
    dive_energy: float
    glide_energy: float
    spiral_energy: float
    swim_factor: float
    time_factor: float
    surfacing_energy: float
    """Energy units of the surfacing before each dive."""
    tail_amplitude: float
    tail_frequency: float
    budget: float
    max_uncertainty: float
    surface_position: float
    """Position variance settled at the surface, m²."""
    surface_cross: float
    surface_velocity: float
    surface_depth: float
    fix_variance: float
    drift_variance: float
    """Square of the drift, m²/s."""
    acceleration_density: float
    steady_current: float
    """Standard deviation per axis of the steady current that nobody knows, m/s."""
    forgotten: float
    """What is known of it is lost as the cube of the time without a fix, m2/s3."""
    doubt: float
    """Factor on the position's standard deviation."""
    turn_time: float
    """Duration of the surfacing before each dive."""
    time_budget: float
    """Longest duration of a round, surfacings included; 0 for none."""
    surfacing_bytes: int
    satellite_bytes: int
    """Most bytes of a round; 0 for no limit."""
    flow: FlowTable
    """Current by place, depth and time since the plan began."""
    has_current: bool


def limits_of(config: PlannerConfig, budget: float) -> Limits:
    """Unpack what compiled code needs of the settings; shores are in ``waterway.waterway_of``."""
    domain, motion, cost = config.domain, config.primitives, config.energy
    position = config.position_filter
    surface = surface_covariance(position, motion.point_interval_s)
    return Limits(
        x_min=domain.x_min_m,
        x_max=domain.x_max_m,
        y_min=domain.y_min_m,
        y_max=domain.y_max_m,
        depth_max=domain.depth_max_m,
        glide_speed=motion.glide_speed_m_s,
        glide_angle_min=motion.glide_angle_min_rad,
        glide_angle_max=motion.glide_angle_max_rad,
        spiral_speed=motion.spiral_speed_m_s,
        spiral_radius_min=motion.spiral_radius_min_m,
        spiral_radius_max=motion.spiral_radius_max_m,
        spiral_rise_min=motion.spiral_rise_min_m_rad,
        spiral_rise_max=motion.spiral_rise_max_m_rad,
        dive_speed=motion.dive_speed_m_s,
        swim_speed=motion.swim_speed_m_s,
        swim_length_min=motion.swim_length_min_m,
        swim_length_max=motion.swim_length_max_m,
        swims_under_water=motion.swims_under_water,
        depth_change_min=motion.depth_change_min_m,
        primitives_max=motion.primitives_max,
        bearing_noise=motion.bearing_noise_rad,
        point_interval=motion.point_interval_s,
        dive_energy=cost.dive,
        glide_energy=cost.glide,
        spiral_energy=cost.spiral,
        swim_factor=cost.swim_factor,
        time_factor=cost.time_factor,
        surfacing_energy=config.surfacing_energy,
        tail_amplitude=cost.tail_amplitude_rad,
        tail_frequency=cost.tail_frequency_hz,
        budget=float(budget),
        max_uncertainty=config.max_uncertainty_m,
        surface_position=surface.position,
        surface_cross=surface.cross,
        surface_velocity=surface.velocity,
        surface_depth=position.surface_depth_m,
        fix_variance=position.fix_std_m**2,
        drift_variance=position.drift_m_sqrt_s**2,
        acceleration_density=position.acceleration_density,
        steady_current=position.steady_current_m_s,
        forgotten=forgotten_per_s3(position, position.steady_current_m_s),
        doubt=position.doubt,
        turn_time=config.mission.turn_time_s,
        time_budget=config.time_budget_s,
        surfacing_bytes=config.mission.surfacing_bytes,
        satellite_bytes=config.satellite_bytes,
        flow=config.current.table,
        has_current=has_current(config),
    )


def legs_max(config: PlannerConfig) -> int:
    """Return the greatest number of legs of one edge: those drawn, and two that close it."""
    return config.primitives.primitives_max + 2


def shape_size(config: PlannerConfig) -> int:
    """Return how many numbers the shape of an edge has."""
    return 1 + SHAPE_COLUMNS * config.primitives.primitives_max


def points_max(config: PlannerConfig) -> int:
    """Return the greatest number of planned points of one edge."""
    motion = config.primitives
    slowest = min(motion.glide_speed_m_s, motion.spiral_speed_m_s, motion.dive_speed_m_s)
    slowest_swim = motion.swim_speed_m_s * (HEADWAY_MIN if has_current(config) else 1.0)
    longest_s = max(config.domain.depth_max_m / slowest, motion.swim_length_max_m / slowest_swim)
    # every leg may end a dive, whose last interval is cut short
    return math.ceil(legs_max(config) * longest_s / motion.point_interval_s) + legs_max(config)
