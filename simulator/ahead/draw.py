"""What the flights of an ensemble meet, drawn from a stated spread."""

from dataclasses import replace

import numpy as np

from autonomy.current.table import flow_at, table_of
from autonomy.estimation.config import MODEL_FILTER_PRESETS, ModelFilterConfig
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.energy import EnergyPrices
from onboard.flight.navigation import CurrentBelief
from robot_link.dry_run import DryRunProblem, Spread
from simulator.ahead.drawn import Drawn
from simulator.fleet import RobotDefinition

_TOGETHER = (
    ("drag_0", "drag_alpha", "drag_delta"),
    ("side_beta", "side_delta"),
    ("lift_0", "lift_alpha"),
    ("pitch_0_m", "pitch_alpha_m", "pitch_damping_m_s"),
    ("yaw_beta_m", "yaw_damping_m_s", "yaw_delta_m"),
)
"""Parameters that are wrong by the same share."""
_MOMENTS = 3
"""The groups from here on are moments."""
_MOMENT_SHARE = 0.5
"""Spread of the moments in that of the forces: a hull that turns otherwise is seen at once."""
_LEAST, _MOST = 0.5, 1.5
"""No share is drawn beyond these."""


def drawn_for(
    problem: DryRunProblem, definition: RobotDefinition, generator: np.random.Generator
) -> Drawn:
    """Draw robot and water of one flight.

    Args:
        problem: What is flown, and its spread.
        definition: The robot as the onboard program believes it.
        generator: Source of randomness.
    """
    spread, settings = problem.spread, problem.mission.settings
    north, east = problem.current_ne_m_s
    unknown = problem.unknown_current_std_m_s * generator.standard_normal(2)
    sensors, ballast = definition.sensors, spread.ballast_share * generator.standard_normal(2)
    capacity_wh = problem.capacity_wh or definition.battery.capacity_wh
    current = (north + float(unknown[0]), east + float(unknown[1]))
    drawn = Drawn(
        vehicle=vehicle_for(definition.vehicle, spread, generator),
        current_ne_m_s=current,
        drift_m_sqrt_s=problem.drift_m_sqrt_s * _share(generator, spread.drift_share),
        # the trim is right but for what nobody knows
        buoyancy_bias_kg=settings.net_buoyancy_offset_kg
        + sensors.buoyancy_bias_kg * float(ballast[0]),
        mass_position_bias_m=settings.mass_position_offset_m
        + sensors.mass_position_bias_m * float(ballast[1]),
        noise_share=_share(generator, spread.noise_share),
        capacity_wh=capacity_wh * _share(generator, spread.capacity_share),
        battery=problem.battery,
        flow_share=_share(generator, spread.flow_share),
    )
    return replace(drawn, belief=_belief(problem, drawn.flow_share))


def _belief(problem: DryRunProblem, flow_share: float) -> CurrentBelief | None:
    """Return what a robot that has told of the current believes of it: all but what is unknown."""
    if problem.known_current_std_m_s is None:
        return None
    north, east = problem.current_ne_m_s
    if problem.flow is not None:
        table_north, table_east = flow_at(table_of(problem.flow), *problem.start_ne_m, 0.0, 0.0)
        north, east = north + flow_share * table_north, east + flow_share * table_east
    stated_m_s = problem.doubt * problem.known_current_std_m_s
    return CurrentBelief((north, east), stated_m_s, problem.doubt)


def vehicle_for(vehicle: Vehicle, spread: Spread, generator: np.random.Generator) -> Vehicle:
    """Return a robot of this kind as one of many is."""
    share = spread.model_share
    if share is None:
        share = MODEL_FILTER_PRESETS.get(vehicle.key, ModelFilterConfig()).model_error
    values = vehicle.parameters.model_dump()
    changed: dict[str, float] = {}
    for number, names in enumerate(_TOGETHER):
        part = _MOMENT_SHARE if number >= _MOMENTS else 1.0
        factor = _share(generator, part * share)
        changed |= {name: factor * values[name] for name in names}
    power = _share(generator, spread.power_share)
    energy = EnergyPrices(
        **{name: power * value for name, value in vehicle.energy.model_dump().items()}
    )
    parameters = vehicle.parameters.model_copy(update=changed)
    return replace(vehicle, parameters=parameters, energy=energy)


def _share(generator: np.random.Generator, std: float) -> float:
    """Draw a factor about 1."""
    return min(max(1.0 + std * float(generator.standard_normal()), _LEAST), _MOST)
