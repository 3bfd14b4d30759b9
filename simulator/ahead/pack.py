"""A mission, its robot and its water as the arrays that the kernel takes."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.config import BACKSTEPPING_PRESETS, BacksteppingConfig
from autonomy.control.law_number import BACKSTEPPING, GOVERNOR
from autonomy.current.table import FlowTable, uniform_table
from autonomy.estimation.config import (
    MODEL_FILTER_PRESETS,
    EstimatorConfig,
    ModelFilterConfig,
)
from autonomy.estimation.fix_watch import DOUBTED_DIVES, doubted_distance
from autonomy.estimation.known_current import TOLD_LEAST_M_S, TOLD_SHARE, UNTOLD
from autonomy.estimation.model_filter import (
    FASTEST_CURRENT_STDS,
    first_belief,
    process_noise,
)
from autonomy.estimation.model_kernel import (
    BIAS_CORRELATION,
    EDDY_CORRELATION,
    EDDY_NORTH,
    MODEL_CORRELATION,
    STEADY_CORRELATION,
    STEADY_NORTH,
)
from autonomy.estimation.telling_stay import telling_stay_s
from autonomy.site import Box, Site
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.surroundings import Surroundings
from onboard.flight.course import dive_ends
from onboard.flight.gentle import SLOWEST_SHARE
from onboard.flight.navigation import CurrentBelief
from onboard.flight.over_ground import over_ground
from onboard.flight.pitch_aim import GlidePolar
from onboard.profile import FLIGHT_PROFILES
from robot_link.mission import Mission
from simulator.ahead.drawn import Drawn
from simulator.ahead.leg import KIND_OF
from simulator.ahead.record import empty_record, record_type
from simulator.ahead.state import (
    HEADINGS_MAX,
    ROW,
    Leg,
    Polars,
    Record,
    Robot,
    Setup,
    State,
    Water,
)
from simulator.fleet import RobotDefinition

RecordArray = npt.NDArray[np.void]
PERIOD_S = 0.1
"""Period of the onboard program (``onboard.program.PERIOD_S``)."""
_J_PER_WH = 3600.0


class Grain(NamedTuple):
    """How finely a flight is worked out."""

    period_s: float
    """Between two steps of the program."""
    plant_steps: int
    """Runge-Kutta steps of the body in one period."""
    belief_every: int
    """Periods between two steps of the filter's covariance."""
    model_steps: int
    """Runge-Kutta steps of the filter's model in one period."""
    clear_steps: int
    """The same of the body where nothing is near that it could touch (``body.move``)."""


WALLS = 8
"""Where ``Surroundings.packed()`` says whether there are walls."""
EXACT = Grain(PERIOD_S, 5, 1, 1, 5)
"""As the onboard program and the simulated robot."""


class Course(NamedTuple):
    """The legs of a mission as the kernel flies them."""

    legs: RecordArray
    polars: Polars
    tells_current: bool


def course_of(mission: Mission, vehicle: Vehicle) -> Course:
    """Return the legs of a mission over ground, with the steady glides that they need."""
    ground = over_ground(mission.legs)
    ends = dive_ends(ground.legs)
    legs = np.zeros(len(ground.legs), dtype=record_type(Leg))
    speeds: dict[float, int] = {}
    for number, leg in enumerate(ground.legs):
        legs[number]["kind"] = KIND_OF[leg.kind]
        for name in ("start_ned", "end_ned", "speed_m_s", "duration_s", "energy"):
            legs[number][name] = getattr(leg, name)
        for name in ("heading_rad", "radius_m", "turn_rad"):
            legs[number][name] = getattr(leg, name)
        legs[number]["dive_end"] = ends[number]
        if ground.currents_ne_m_s:
            legs[number]["current_ne_m_s"] = ground.currents_ne_m_s[number]
        if leg.kind in ("glide", "spiral"):
            legs[number]["polar"] = 4 * speeds.setdefault(leg.speed_m_s, len(speeds))
    return Course(legs, _polars(vehicle, tuple(speeds)), bool(ground.currents_ne_m_s))


def _polars(vehicle: Vehicle, speeds: tuple[float, ...]) -> Polars:
    """Return the steady glides down and up, at the usual and the gentle gait, of each speed."""
    found = [
        _polar(vehicle, way * share * speed)
        for speed in speeds or (0.05,)
        for share in (1.0, SLOWEST_SHARE)
        for way in (1.0, -1.0)
    ]
    widest = max(len(one[0]) for one in found)
    rows = [
        tuple(np.pad(column, (0, widest - len(column)), mode="edge") for column in one[:2])
        for one in found
    ]
    return Polars(
        np.array([steepness for steepness, _ in rows]),
        np.array([pitch for _, pitch in rows]),
        np.array([one[2] for one in found]),
        np.array([one[3] for one in found]),
    )


_POLARS: dict[tuple[bytes, float], tuple[FloatArray, FloatArray, float, float]] = {}


def _polar(vehicle: Vehicle, rate_m_s: float) -> tuple[FloatArray, FloatArray, float, float]:
    """Return steepness and pitch of the paths, the rate that is held, and the greatest net mass."""
    key = (vehicle.packed().tobytes(), rate_m_s)
    if key not in _POLARS:
        polar = GlidePolar(vehicle, rate_m_s)
        _POLARS[key] = (*polar.table_rad, polar.rate_m_s, polar.net_buoyancy_max_kg)
    return _POLARS[key]


def water_of(site: Site, flow: FlowTable | None) -> Water:
    """Return border, floor and flow of a water."""
    shore, lines = site.shore, site.depth_lines
    none = np.empty((0, 2))
    if lines is None:
        north = east = np.array([0.0, 1.0])
        depth = np.full((1, 1), site.water.depth_max_m)
    else:
        north, east = lines
        depth = site.floor_m(*np.meshgrid(north, east, indexing="ij"))
    return Water(
        box=_edges(site.water),
        domain=_edges(site.domain),
        begins=none if shore is None else np.ascontiguousarray(shore.begins),
        ends=none if shore is None else np.ascontiguousarray(shore.ends),
        floor_north=np.ascontiguousarray(north, dtype=np.float64),
        floor_east=np.ascontiguousarray(east, dtype=np.float64),
        floor_depth=np.ascontiguousarray(depth, dtype=np.float64),
        flow=flow or uniform_table(0.0, 0.0),
    )


def _edges(box: Box) -> FloatArray:
    return np.array([box.x_min_m, box.x_max_m, box.y_min_m, box.y_max_m])


def robot_of(believed: Vehicle, true: Vehicle, site: Site) -> Robot:
    """Return the packed vehicles, and what is around them."""
    return Robot(
        true.packed(),
        believed.packed(),
        Surroundings.of_site(site).packed(),
        Surroundings().packed(),
    )


def setup_of(
    definition: RobotDefinition, mission: Mission, course: Course, drawn: Drawn, grain: Grain
) -> RecordArray:
    """Return what stays the same in one flight.

    Args:
        definition: The robot and its water; its vehicle is what the onboard program believes.
        mission: What it flies.
        course: That mission's legs.
        drawn: What this flight meets.
        grain: How finely it is worked out.
    """
    values = (
        _manners(definition)
        | _filter(definition, grain)
        | _belief(definition, drawn.belief)
        | _mission(definition, mission)
        | _truth(definition, drawn, grain)
    )
    record = empty_record(Setup)
    values |= {
        "period_s": grain.period_s,
        "plant_steps": grain.plant_steps,
        "clear_steps": grain.clear_steps,
        "belief_every": grain.belief_every,
        "model_steps": grain.model_steps,
        "row_every": 10,
        "tells_current": course.tells_current,
    }
    for name, value in values.items():
        record[0][name] = value
    return record


def _manners(definition: RobotDefinition) -> dict[str, Any]:
    vehicle = definition.vehicle
    profile = FLIGHT_PROFILES[vehicle.key]
    manners = {name: getattr(profile, name) for name in profile.__dataclass_fields__}
    swim = vehicle.swim
    return manners | {
        "swim_rp1_m": swim.rp1_m,
        "swim_amplitude_rad": swim.amplitude_rad,
        "swim_frequency_hz": swim.frequency_hz,
        "pump_rate_kg_s": vehicle.limits.m0_rate_kg_s,
    }


def _filter(definition: RobotDefinition, grain: Grain) -> dict[str, Any]:
    """Return what the filter assumes."""
    estimator, vehicle = definition.estimator, definition.vehicle
    model = _filter_config(estimator, vehicle)
    sparse = math.sqrt(PERIOD_S / grain.period_s)
    noise = process_noise(estimator, model)
    outlier, current = model.outlier, model.current
    beat = round(1.0 / (vehicle.swim.frequency_hz * grain.period_s))
    return {
        "headings": min(max(beat, 1), HEADINGS_MAX),
        "noise": noise,
        "kept": np.exp(
            -grain.period_s
            / noise[[STEADY_CORRELATION, EDDY_CORRELATION, BIAS_CORRELATION, MODEL_CORRELATION]]
        ),
        "surface_depth_m": estimator.surface_depth_m,
        "depth_variance": (sparse * estimator.depth_std_m) ** 2,
        "fix_std_m": estimator.fix_std_m * _fix_share(definition, grain),
        "least_doubt": estimator.doubt,
        "outlier_limit": outlier.limit,
        "patience": outlier.patience,
        "fix_patience": outlier.fix_patience,
        "gate_speed_m_s": model.greatest_speed_m_s + FASTEST_CURRENT_STDS * current.steady_std_m_s,
        "telling_stay_s": telling_stay_s(estimator, current.steady_std_m_s),
        "told_std_m_s": max(TOLD_SHARE * estimator.steady_current_m_s, TOLD_LEAST_M_S),
        "notice_jump_kg": 2.0 * model.buoyancy_bias_kg,
    }


def _belief(definition: RobotDefinition, belief: CurrentBelief | None) -> dict[str, Any]:
    """Return what the filter knows at first: of the current, what a robot said, if it did."""
    estimator = definition.estimator
    model = _filter_config(estimator, definition.vehicle)
    std = np.diag(first_belief(estimator, model, (0.0, 0.0, 0.0), estimator.fix_std_m)[1]).copy()
    steady = slice(STEADY_NORTH, EDDY_NORTH)
    if belief is None:
        std[steady] *= UNTOLD
        return {"first_std": std}
    std[steady] = belief.std_m_s / belief.doubt
    return {
        "first_std": std,
        "first_current_ne_m_s": belief.current_ne_m_s,
        "first_dives": DOUBTED_DIVES if belief.doubt > 1.0 else 0,
        "first_squared": doubted_distance(belief.doubt),
    }


def _fix_share(definition: RobotDefinition, grain: Grain) -> float:
    """Return how much better the mean of the fixes of one period is than one fix."""
    return math.sqrt(min(definition.sensors.fix_period_s / grain.period_s, 1.0))


def _filter_config(estimator: EstimatorConfig, vehicle: Vehicle) -> ModelFilterConfig:
    """Return the settings that ``onboard.flight.navigation.ModelTrack`` gives its filter."""
    model = MODEL_FILTER_PRESETS.get(vehicle.key, ModelFilterConfig())
    told = {
        "steady_std_m_s": estimator.steady_current_m_s,
        "steady_correlation_s": estimator.current_memory_s,
    }
    return model.model_copy(update={"current": model.current.model_copy(update=told)})


def _mission(definition: RobotDefinition, mission: Mission) -> dict[str, Any]:
    settings, onboard = mission.settings, mission.onboard
    prices = definition.energy if onboard is None else onboard.energy_config()
    law = BACKSTEPPING if onboard is None else CONTROLLERS[onboard.controller_kind].law
    return {
        "law": law,
        "knows_mass": law == GOVERNOR,
        "max_uncertainty_m": settings.max_uncertainty_m,
        "timeout_s": settings.timeout_s,
        "trim_kg": settings.net_buoyancy_offset_kg,
        "trim_m": settings.mass_position_offset_m,
        "time_price": prices.time_factor,
        "swim_price": prices.swim_factor,
    }


def _truth(definition: RobotDefinition, drawn: Drawn, grain: Grain) -> dict[str, Any]:
    """Return what the robot and its water truly are."""
    model, share = definition.sensors, math.sqrt(PERIOD_S / grain.period_s)
    tilt, gyro = model.tilt_std_rad, model.gyro_std_rad_s
    noise = np.array(
        [
            model.depth_std_m,
            tilt,
            tilt,
            model.heading_std_rad,
            gyro,
            gyro,
            gyro,
            model.buoyancy_std_kg,
            model.mass_position_std_m,
            model.tail_std_rad,
            model.battery_std_v,
            model.fix_std_m,
            model.fix_std_m,
        ]
    )
    noise[:-2] *= share
    noise[-2:] *= _fix_share(definition, grain)
    correlation_s = definition.current_correlation_s
    eddy_std_m_s = drawn.drift_m_sqrt_s / math.sqrt(2.0 * correlation_s)
    eddy_kept = math.exp(-grain.period_s / correlation_s)
    return {
        "settling_s": drawn.settling_s,
        "noise_std": drawn.noise_share * noise,
        "buoyancy_bias_kg": drawn.buoyancy_bias_kg,
        "mass_position_bias_m": drawn.mass_position_bias_m,
        "fix_depth_m": model.fix_depth_m,
        "fix_period_s": model.fix_period_s,
        "battery_j": drawn.capacity_wh * _J_PER_WH,
        "eddy_std_m_s": eddy_std_m_s,
        "eddy_kept": eddy_kept,
        "eddy_fresh_m_s": eddy_std_m_s * math.sqrt(1.0 - eddy_kept * eddy_kept),
        "steady_ne_m_s": drawn.current_ne_m_s,
        "water_s": -drawn.settling_s,
        "is_uneven": definition.site.bathymetry is not None,
        "has_walls": Surroundings.of_site(definition.site).packed()[WALLS] > 0.0,
    }


def state_of(definition: RobotDefinition, mission: Mission, battery: float) -> RecordArray:
    """Return a robot that floats where it starts, with its law."""
    record = empty_record(State)
    s = record[0]
    s["x"][0:2] = definition.start_ne_m
    s["x"][5] = definition.heading_rad
    s["battery"] = battery
    vehicle, onboard = definition.vehicle, mission.onboard
    gains = BACKSTEPPING_PRESETS.get(vehicle.key, BacksteppingConfig()).packed()
    if onboard is not None:
        kind = CONTROLLERS[onboard.controller_kind]
        gains = kind.packed(onboard.controller_config())
    robust = CONTROLLERS["controller.governor"]
    robust_gains = robust.packed(robust.preset(vehicle.key))
    s["gains"][: len(gains)] = s["told_gains"][: len(gains)] = gains
    s["robust_gains"][: len(robust_gains)] = robust_gains
    return record


def record_for(legs: int, rows: int) -> Record:
    """Return room to write a flight down."""
    return Record(
        np.empty((rows, ROW)), np.empty((40 + 12 * legs, 4)), np.full((legs, 4), math.nan)
    )
