"""Missions of twenty items, as surveys of the lake are planned, and the worst that one may be."""

import math
import random
from dataclasses import replace

from autonomy.control.config import BACKSTEPPING_PRESETS, BacksteppingConfig
from autonomy.field.config import FIELD_PRESETS, FieldConfig, KernelParameters
from autonomy.planner.config import EnergyConfig
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind
from autonomy.planner.preset import PLANNER_PRESETS
from robot_link.mission import Mission, MissionSettings
from robot_link.onboard_settings import OnboardSettings

ITEMS = 20
_PLANNER = PLANNER_PRESETS["grace3"]
_FIELD = FIELD_PRESETS["chlorophyll"]
_PRICES = {PrimitiveKind.GLIDE: 1.5, PrimitiveKind.SPIRAL: 1.5, PrimitiveKind.DIVE: 1.0}


def usual_mission(seed: int) -> Mission:
    """Return a survey of the lake: dives of two glides or of a spiral and a dive, and swims."""
    rng = random.Random(seed)
    legs: list[Leg] = []
    here: PositionNed = (rng.uniform(0.0, 200.0), rng.uniform(0.0, 200.0), 0.0)
    start = here
    while len(legs) < ITEMS:
        depth, heading = rng.uniform(5.0, 18.0), rng.uniform(-math.pi, math.pi)
        kind = rng.choices(("glides", "spiral", "swim"), (6, 1, 2))[0]
        if kind == "swim":
            legs.append(_swim(here, heading, rng.uniform(5.0, 20.0), _PLANNER.energy))
        elif kind == "glides":
            legs.append(_glide(here, heading, depth, rng, _PLANNER.energy))
            legs.append(_glide(legs[-1].end_ned, heading, 0.0, rng, _PLANNER.energy))
        else:
            legs.append(_spiral(here, heading, depth, rng, _PLANNER.energy))
            bottom = legs[-1].end_ned
            up = (*bottom[:2], 0.0)
            legs.append(_leg(PrimitiveKind.DIVE, bottom, up, 0.015, 0.0, _PLANNER.energy))
        here = legs[-1].end_ned
    config = BACKSTEPPING_PRESETS["grace3"]
    onboard = OnboardSettings.of("controller.backstepping", config, _PLANNER, _FIELD)
    return Mission.from_legs(_settings(start, rng), tuple(legs[:ITEMS]), onboard=onboard)


def worst_mission(seed: int) -> Mission:
    """Return the worst believable one of what the station sends.

    15 km from the origin, in a current that carries the robot off at every surfacing and spoils
    what is expected of headings and durations; every second leg a spiral; gains, prices and kernel
    learned, hence none of them round.
    """
    rng = random.Random(seed)
    prices = _spoilt_prices(rng)
    legs: list[Leg] = []
    here: PositionNed = (-15_213.345, 14_987.654, 0.0)
    start = here
    while len(legs) < ITEMS:
        heading = rng.uniform(-math.pi, math.pi)
        if legs:
            here = (here[0] + rng.uniform(-30, 30), here[1] + rng.uniform(-30, 30), 0.0)
        depth = rng.uniform(12.0, 30.0)
        legs.append(_spoilt(_glide(here, heading, depth, rng, prices), rng, prices))
        up = _spiral(legs[-1].end_ned, heading, 0.0, rng, prices)
        legs.append(_spoilt(up, rng, prices))
        here = legs[-1].end_ned
    values = BACKSTEPPING_PRESETS["grace3"].model_dump()
    spoilt = {key: value * rng.uniform(0.9, 0.99) for key, value in values.items()}
    spoilt |= {"is_tail_clipped_first": True, "near_offset_m": 0.1531, "near_m": 0.05127}
    onboard = OnboardSettings.of(
        "controller.backstepping",
        BacksteppingConfig.model_validate(spoilt),
        _PLANNER.model_copy(update={"energy": prices}),
        _spoilt_field(rng),
    )
    return Mission.from_legs(_settings(start, rng), tuple(legs), onboard=onboard)


def _settings(start: PositionNed, rng: random.Random) -> MissionSettings:
    trim = rng.uniform(-0.02, 0.02), rng.uniform(-0.003, 0.003)
    return MissionSettings(10.0, 12.0, rng.uniform(9000.0, 30000.0), *start[:2], *trim)


def _leg(
    kind: PrimitiveKind,
    start: PositionNed,
    end: PositionNed,
    speed: float,
    heading: float,
    prices: EnergyConfig,
    **circle: float,
) -> Leg:
    way = math.dist(start, end) if kind is PrimitiveKind.SWIM else abs(end[2] - start[2])
    rate = 2.0 * math.pi * prices.tail_frequency_hz * prices.tail_amplitude_rad
    seconds = way / speed
    work = _PRICES.get(kind, prices.swim_factor * rate**2 / 2.0 * seconds)
    energy = work + prices.time_factor * seconds
    return Leg(kind, start, end, speed, seconds, energy, heading, **circle)


def _glide(
    start: PositionNed, heading: float, depth: float, rng: random.Random, prices: EnergyConfig
) -> Leg:
    length = abs(depth - start[2]) / math.tan(rng.uniform(0.75, 0.87))
    north, east = length * math.cos(heading), length * math.sin(heading)
    end = (start[0] + north, start[1] + east, depth)
    return _leg(PrimitiveKind.GLIDE, start, end, 0.06, heading, prices)


def _swim(start: PositionNed, heading: float, length: float, prices: EnergyConfig) -> Leg:
    end = (start[0] + length * math.cos(heading), start[1] + length * math.sin(heading), 0.0)
    return _leg(PrimitiveKind.SWIM, start, end, 0.12, heading, prices)


def _spiral(
    start: PositionNed, heading: float, depth: float, rng: random.Random, prices: EnergyConfig
) -> Leg:
    radius = rng.uniform(1.2, 2.0)
    turn = rng.choice((-1.0, 1.0)) * abs(depth - start[2]) / rng.uniform(1.4, 2.0)
    chord, direction = 2.0 * radius * math.sin(abs(turn) / 2.0), heading + turn / 2.0
    end = (
        start[0] + chord * math.cos(direction),
        start[1] + chord * math.sin(direction),
        depth,
    )
    circle = {"radius_m": radius, "turn_rad": turn}
    return _leg(PrimitiveKind.SPIRAL, start, end, 0.05, heading, prices, **circle)


def _spoilt(leg: Leg, rng: random.Random, prices: EnergyConfig) -> Leg:
    """Return a leg that a current makes other than it would be in still water."""
    longer_s = leg.duration_s * rng.uniform(0.0, 0.2)
    return replace(
        leg,
        duration_s=leg.duration_s + longer_s,
        energy=leg.energy + prices.time_factor * longer_s,
        heading_rad=leg.heading_rad + rng.uniform(-0.5, 0.5),
    )


def _spoilt_prices(rng: random.Random) -> EnergyConfig:
    prices = _PLANNER.energy.model_dump()
    return EnergyConfig(**{key: value * rng.uniform(0.9, 1.1) for key, value in prices.items()})


def _spoilt_field(rng: random.Random) -> FieldConfig:
    values = _FIELD.single.model_dump()
    learned = {
        key: value if key == "shape" else value * rng.uniform(0.9, 1.1)
        for key, value in values.items()
    }
    return _FIELD.model_copy(update={"single": KernelParameters.model_validate(learned)})
