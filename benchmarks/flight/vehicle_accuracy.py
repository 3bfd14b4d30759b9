"""How exact the vehicle's dynamics are: golden vectors, energy, and the two implementations."""

import json
import math
from pathlib import Path

import numpy as np

from autonomy.vehicle import extended_kernel, kernel
from autonomy.vehicle.config import GRACE3, MINIGLIDER, VehicleParameters
from autonomy.vehicle.reference import dynamics
from autonomy.vehicle.steady import steady_glide
from autonomy.vehicle.surroundings import Surroundings
from autonomy.vehicle.water import CurrentGrid, CurrentProfile, WaterColumn, Wave

STATES = 2000
RATES_BAR = 1e-12
GLIDE_BAR = 1e-6
ENERGY_BAR_J = 1e-11
AGREEMENT_BAR = 1e-13
ENERGY_STEP_S = 0.005
COARSE_STEP_S = 0.01
ENERGY_SPAN_S = 20.0

_GOLDEN = Path(__file__).parents[2] / "tests" / "autonomy" / "golden_vehicle.json"
_SCALE = np.array([2, 2, 2, 1.5, 1.5, 3, 0.15, 0.05, 0.15, 0.3, 0.3, 0.3, 0.02, 0.04, 1.5])


def measure() -> list[tuple[str, float, str, float | None]]:
    """Return name, value, unit and upper bar, if any, of every row."""
    golden = json.loads(_GOLDEN.read_text())
    energy = "Energy drift without hydrodynamics, 20 s, dt {:g}"
    twins = f"Readable model against kernel, {STATES} states, {{}}"
    return [
        ("Rates against the golden vectors", _rates_error(golden["rhs"]), "rel", RATES_BAR),
        ("Steady glides against golden", _glide_error(golden["glide"]), "rel", GLIDE_BAR),
        (energy.format(ENERGY_STEP_S), _energy_drift_j(ENERGY_STEP_S), "J", ENERGY_BAR_J),
        (energy.format(COARSE_STEP_S), _energy_drift_j(COARSE_STEP_S), "J", ENERGY_BAR_J),
        (twins.format("12"), _disagreement(), "rel", AGREEMENT_BAR),
        (twins.format("15, open water"), _disagreement_in(Surroundings()), "rel", AGREEMENT_BAR),
        (twins.format("15, rich water"), _disagreement_in(_water()), "rel", AGREEMENT_BAR),
    ]


def _relative(value: np.ndarray, expected: np.ndarray) -> float:
    return float(np.linalg.norm(value - expected) / np.linalg.norm(expected))


def _rates_error(cases: list[dict]) -> float:
    packed = MINIGLIDER.packed()
    return max(
        _relative(
            kernel.state_derivative(np.array(case["X"]), np.array(case["U"]), packed),
            np.array(case["dX"]),
        )
        for case in cases
    )


def _glide_error(cases: list[dict]) -> float:
    errors = []
    for case in cases:
        glide = steady_glide(MINIGLIDER.parameters, *case["U"])
        errors.append(_relative(np.array(glide.velocity_m_s), np.array(case["v"])))
        pairs = (
            (glide.pitch_rad, case["theta"]),
            (glide.roll_rad, case["phi"]),
            (glide.vertical_speed_m_s, case["zdot"]),
            (glide.turn_rate_rad_s, case["psidot"]),
        )
        errors += [abs(found - wanted) / max(abs(wanted), 1e-6) for found, wanted in pairs]
    return max(errors)


def _energy_drift_j(step_s: float) -> float:
    """Return how much energy a tumbling body without hydrodynamics wins or loses."""
    p = MINIGLIDER.parameters
    none = {
        name: 0.0
        for name in VehicleParameters.model_fields
        if name.startswith(("drag_", "side_", "lift_", "roll_", "pitch_", "yaw_"))
    }
    state = np.array([0, 0, 5, 0.2, -0.4, 0.3, 0.08, 0.01, 0.02, 0.1, 0.2, 0.05])
    inputs = np.array([0.01, 0.02, 0.5])
    steps = round(ENERGY_SPAN_S / step_s)
    packed = p.model_copy(update=none).packed()
    later = kernel.rk4_step(state, inputs, packed, step_s, steps)
    return abs(_energy_j(later, inputs, p) - _energy_j(state, inputs, p))


def _energy_j(state: np.ndarray, inputs: np.ndarray, p: VehicleParameters) -> float:
    mass = np.array([p.mass_1_kg, p.mass_2_kg, p.mass_3_kg])
    inertia = np.array([p.inertia_1_kg_m2, p.inertia_2_kg_m2, p.inertia_3_kg_m2])
    kinetic = 0.5 * (mass @ state[6:9] ** 2 + inertia @ state[9:12] ** 2)
    level = math.cos(state[4]) * math.cos(state[3])
    hanging = p.offset_mass_kg * p.offset_mass_depth_m * level
    sliding = -p.sliding_mass_kg * inputs[1] * math.sin(state[4])
    return float(kinetic - p.gravity_m_s2 * (inputs[0] * state[2] + hanging + sliding))


def _disagreement() -> float:
    rng = np.random.default_rng(1)
    packed, worst = MINIGLIDER.packed(), 0.0
    for state in rng.uniform(-1.0, 1.0, (STATES, 12)) * _SCALE[:12]:
        inputs = rng.uniform(-1.0, 1.0, 3) * [0.025, 0.05, 1.9]
        readable = dynamics.state_derivative(state, inputs, MINIGLIDER.parameters)
        worst = max(worst, _relative(kernel.state_derivative(state, inputs, packed), readable))
    return worst


def _disagreement_in(water: Surroundings) -> float:
    rng = np.random.default_rng(2)
    packed, around, worst = GRACE3.packed(), water.packed(), 0.0
    for state in rng.uniform(-1.0, 1.0, (STATES, 15)) * _SCALE:
        actuator = rng.uniform(-1.0, 1.0, 4) * [0.002, 0.01, 1.9, 3.0]
        time_s = rng.uniform(0.0, 100.0)
        readable = dynamics.extended_state_derivative(state, actuator, GRACE3, water, time_s)
        compiled = extended_kernel.extended_state_derivative(
            state, actuator, packed, around, time_s
        )
        worst = max(worst, _relative(compiled, readable))
    return worst


def _water() -> Surroundings:
    """Return water with everything in it."""
    rng = np.random.default_rng(3)
    axes = np.linspace(-2, 2, 5), np.linspace(-1.5, 1.5, 4), np.linspace(0, 2, 6)
    return Surroundings(
        (0.1, -0.05, 0.01),
        *(-1.5, 1.5, -1.5, 1.5, 1.2),
        has_walls=True,
        current_profile=CurrentProfile(np.array([0.0, 0.5, 1.5]), rng.normal(size=(3, 2)) * 0.1),
        current_grid=CurrentGrid(*axes, rng.normal(size=(5, 4, 6, 3)) * 0.05),
        column=WaterColumn.fresh(np.array([0.0, 0.5, 2.0]), np.array([22.0, 20.0, 9.0])),
        waves=(Wave(0.05, 1.2, 0.4, 0.3), Wave(0.02, 0.7, -2.0, 1.0)),
    )
