"""Flights of drawn missions by the readable program and by the kernel, with the same noise."""

from dataclasses import dataclass, replace

import numpy as np

from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.vehicle.config import Vehicle
from benchmarks.drawn.mission import mission_of
from benchmarks.drawn.twin import calm_rows
from onboard.flight.navigation import CurrentBelief
from robot_link.mission import Mission
from simulator.ahead import flight, readable
from simulator.ahead.drawn import Drawn
from simulator.ahead.pack import EXACT
from simulator.ahead.state import ROW_TIME
from simulator.fleet import GRACE_1, MINI_1, RobotDefinition

ROBOTS = {"tank": MINI_1, "lake": GRACE_1}
DURATION_S = {"tank": 150.0, "lake": 700.0}
"""Of the legs of a drawn mission, about."""
STARTS = ("just switched on", "it knows the current", "it knows the current and doubts itself")


@dataclass(frozen=True)
class Pair:
    """A mission flown by both."""

    mission: Mission
    readable: readable.ReadableFlight
    compiled: flight.Flown
    calm_rows: int
    """Rows for which the readable program keeps to its twin."""

    @property
    def is_calm(self) -> bool:
        return self.calm_rows == len(self.readable.rows)

    @property
    def calm_until_s(self) -> float:
        return float(self.readable.rows[self.calm_rows - 1, ROW_TIME])


def drawn_case(
    generator: np.random.Generator, water: str, start: str
) -> tuple[RobotDefinition, Mission, Drawn]:
    """Return robot, mission and what the flight meets, all drawn.

    The vehicle's numbers differ by a twentieth (standard deviation) from what the robot believes,
    ballast and sliding mass are off as the sensors' model says, the current has the strength that
    the filter expects. What the robot knows of it at the start is off as far as it says.

    Args:
        generator: Source of randomness.
        water: One of ``ROBOTS``.
        start: One of ``STARTS``.
    """
    definition = ROBOTS[water]
    config = PLANNER_PRESETS[definition.vehicle.key]
    # a robot that comes up for its uncertainty cuts a dive: half of the missions are so
    uncertain = float(generator.choice([0.5, 2.0])) * config.max_uncertainty_m
    mission = mission_of(generator, config, DURATION_S[water], uncertain)
    settings = mission.settings
    definition = replace(
        definition,
        start_ne_m=(settings.start_x_m, settings.start_y_m),
        heading_rad=float(generator.uniform(-np.pi, np.pi)),
    )
    sensors, current = definition.sensors, definition.estimator.steady_current_m_s
    north, east = (current * generator.standard_normal(2)).tolist()
    drawn = Drawn(
        vehicle=_other(generator, definition.vehicle),
        current_ne_m_s=(north, east),
        drift_m_sqrt_s=definition.drift_m_sqrt_s * float(generator.uniform(0.5, 1.5)),
        buoyancy_bias_kg=float(sensors.buoyancy_bias_kg * generator.standard_normal()),
        mass_position_bias_m=float(sensors.mass_position_bias_m * generator.standard_normal()),
        noise_share=float(generator.uniform(0.5, 1.5)),
        capacity_wh=definition.battery.capacity_wh * float(generator.uniform(0.8, 1.0)),
        battery=float(generator.uniform(0.5, 1.0)),
    )
    if start != STARTS[0]:
        doubt = float(generator.uniform(1.2, 3.0)) if start == STARTS[2] else 1.0
        drawn = replace(drawn, belief=_belief(generator, drawn.current_ne_m_s, current, doubt))
    return definition, mission, drawn


def _belief(
    generator: np.random.Generator,
    true_ne_m_s: tuple[float, float],
    usual_m_s: float,
    doubt: float,
) -> CurrentBelief:
    std_m_s = usual_m_s * float(np.exp(generator.uniform(np.log(0.05), 0.0)))
    north, east = (true_ne_m_s + doubt * std_m_s * generator.standard_normal(2)).tolist()
    return CurrentBelief((north, east), doubt * std_m_s, doubt)


def _other(generator: np.random.Generator, vehicle: Vehicle) -> Vehicle:
    names = ("drag_0", "drag_alpha", "side_beta", "lift_0", "lift_alpha", "yaw_delta_m")
    values = vehicle.parameters.model_dump()
    changed = {
        name: values[name] * (1.0 + 0.05 * float(generator.standard_normal())) for name in names
    }
    return replace(vehicle, parameters=vehicle.parameters.model_copy(update=changed))


def flown_pair(seed: int, water: str, start: str) -> Pair:
    """Fly what a seed draws by both."""
    definition, mission, drawn = drawn_case(np.random.default_rng(seed), water, start)
    truth = readable.fly_readable(definition, mission, drawn, seed)
    assert truth is not None
    plan = flight.FlightPlan.of(definition, mission, EXACT, row_s=0.1)
    mine = flight.fly_with(plan, drawn, truth.noise.first, truth.noise.steps)
    return Pair(mission, truth, mine, calm_rows(definition, mission, drawn, seed, truth))


def leg_length_m(mission: Mission, leg: int) -> float:
    """Return the length of a leg, m."""
    one = mission.legs[min(leg, len(mission.legs) - 1)]
    return float(np.linalg.norm(np.subtract(one.end_ned, one.start_ned)))
