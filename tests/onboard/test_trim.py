"""The trim of a mission on board, and what it is for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.planner.leg import primitive
from autonomy.planner.plan import Leg
from onboard.flight.hardware import SetPoints
from onboard.flight.trim import Trim
from onboard.link.robot_link import CommandOutcome
from robot_link.messages import CommandKind, OnboardPlanState
from simulator.fleet import MINI_1
from tests.simulator.flight import TANK_PLANNER, Life, mission, vee

LIMITS = MINI_1.vehicle.limits
HEAVY_KG, AFT_M = 0.002, 0.003
STILL = replace(MINI_1, drift_m_sqrt_s=0.0)


def flat_dive() -> tuple[Leg, Leg]:
    down = primitive.dive(TANK_PLANNER, (0.5, 0.5, 0.0), 0.7)
    return down, primitive.dive(TANK_PLANNER, down.end_ned, 0.0)


def dive(buoyancy_bias_kg: float, mass_bias_m: float, trim: tuple[float, float]) -> np.ndarray:
    """Return depth and pitch, as they truly were, of a flat dive with wrong feedback."""
    life = Life(STILL, seed=4)
    sensors = life.robot.body.sensors
    sensors.buoyancy_bias_kg, sensors.mass_position_bias_m = buoyancy_bias_kg, mass_bias_m
    life.start(mission(*flat_dive(), trim=trim))
    rows: list[tuple[float, float]] = []

    def is_over() -> bool:
        state = life.robot.body.plant.state
        rows.append((state[2], state[4]))
        return life.executive.plan_state is OnboardPlanState.DONE

    assert life.live_until(is_over, 300.0)
    return np.array(rows)


def descent(rows: np.ndarray) -> tuple[float, float]:
    """Return mean rate of depth and mean pitch between 0.2 and 0.5 m on the way down."""
    deepest = int(rows[:, 0].argmax())
    down = rows[:deepest]
    part = down[(down[:, 0] > 0.2) & (down[:, 0] < 0.5)]
    return (part[-1, 0] - part[0, 0]) / (0.1 * (len(part) - 1)), float(part[:, 1].mean())


def test_the_right_trim_takes_away_what_wrong_feedback_does_to_a_dive():
    true = dive(0.0, 0.0, (0.0, 0.0))
    wrong = dive(HEAVY_KG, AFT_M, (0.0, 0.0))
    trimmed = dive(HEAVY_KG, AFT_M, (HEAVY_KG, AFT_M))
    assert trimmed == pytest.approx(true, abs=2e-3)
    assert len(wrong) != len(true)
    assert abs(descent(wrong)[1] - descent(true)[1]) > math.radians(0.2)
    assert abs(descent(trimmed)[1] - descent(true)[1]) < math.radians(0.1)


def test_a_wrong_sign_makes_it_worse():
    _, true = descent(dive(0.0, 0.0, (0.0, 0.0)))
    _, wrong = descent(dive(0.0, AFT_M, (0.0, 0.0)))
    _, worse = descent(dive(0.0, AFT_M, (0.0, -AFT_M)))
    assert abs(worse - true) > 1.5 * abs(wrong - true)


def test_the_feedback_goes_on_telling_what_its_sensors_say():
    reports = []
    for trim in ((0.0, 0.0), (HEAVY_KG, -AFT_M)):
        life = Life(STILL, seed=4)
        life.start(mission(*vee(), trim=trim))
        life.live(5.0)
        reports.append(life.robot.program.state_report())
        body = life.robot.body
        assert reports[-1].net_buoyancy_kg == pytest.approx(
            body.plant.state[12] + body.sensors.buoyancy_bias_kg, abs=3e-4
        )
    heavier_kg = reports[1].net_buoyancy_kg - reports[0].net_buoyancy_kg
    assert heavier_kg == pytest.approx(HEAVY_KG, abs=4e-4)


def test_a_trim_comes_with_the_start_and_stays_until_another_mission_starts():
    life = Life(STILL)
    program, executive = life.robot.program, life.executive
    first = mission(*vee(), trim=(0.001, 0.0))
    program.take_plan(first)
    assert executive.trim == Trim()
    program.obey(CommandKind.START, first.sha256()[:12])
    assert executive.trim == Trim(0.001, 0.0)
    program.obey(CommandKind.SURFACE, "")
    assert life.live_until(lambda: program.plan_refusal() == "", 60.0)
    second = mission(*vee())
    program.take_plan(second)
    assert executive.trim == Trim(0.001, 0.0)
    life.live(0.1)
    program.obey(CommandKind.START, second.sha256()[:12])
    assert executive.trim == Trim()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_trimmed_set_points_stay_inside_the_end_stops(sign: float):
    trim = Trim(sign * 0.005, sign * 0.01)
    for wanted in (
        SetPoints(LIMITS.m0_max_kg, LIMITS.rp1_max_m, 0.3, 0.4, 0.5),
        SetPoints(LIMITS.m0_min_kg, LIMITS.rp1_min_m, 0.3, 0.4, 0.5),
    ):
        told = trim.command(wanted, LIMITS)
        assert LIMITS.m0_min_kg <= told.net_buoyancy_kg <= LIMITS.m0_max_kg
        assert LIMITS.rp1_min_m <= told.mass_position_m <= LIMITS.rp1_max_m
        assert (told.tail_rad, told.tail_amplitude_rad, told.tail_frequency_hz) == (0.3, 0.4, 0.5)
    told = trim.command(SetPoints(0.001, 0.002), LIMITS)
    assert told.net_buoyancy_kg == pytest.approx(0.001 + sign * 0.005)
    assert told.mass_position_m == pytest.approx(0.002 + sign * 0.01)


@pytest.mark.parametrize(
    ("trim", "what"), [((0.02, 0.0), "net buoyancy"), ((0.0, -0.03), "mass position")]
)
def test_a_trim_that_would_keep_the_robot_from_coming_up_is_not_flown(trim, what: str):
    life = Life()
    assert life.start(mission(*vee(), trim=trim)) is CommandOutcome.NOT_NOW
    life.live(0.1)
    state, _, _, reason = life.notebook.plans[-1]
    assert state is OnboardPlanState.FAILED
    assert reason == f"the trim of the {what} is beyond 30% of the actuator's travel"
    assert life.executive.trim == Trim()
