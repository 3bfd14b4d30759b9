"""Robots that fly in a steady current which their plan knows, or does not."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.planner.check.check import violations
from autonomy.planner.config import PlannedCurrentConfig, PlannerConfig
from autonomy.planner.leg import primitive
from autonomy.planner.leg.edge import propose_edge, random_shape
from autonomy.planner.leg.waterway import waterway_of
from autonomy.planner.limits import limits_of
from autonomy.planner.plan import Leg, PrimitiveKind
from onboard.flight.over_ground import GroundCourse, over_ground
from simulator.fleet import GRACE_1, MINI_1, RobotDefinition
from tests.simulator.flight import LAKE_PLANNER, TANK_PLANNER, Life, mission

TANK_NODES = ((0.5, 0.5), (1.25, 0.75), (2.0, 0.5))
LAKE_NODES = ((120.0, 120.0), (148.0, 132.0), (178.0, 140.0))
CASES = {
    "tank": (MINI_1, TANK_PLANNER, TANK_NODES, (0.006, -0.004), {"position": 0.6, "model": 0.7}),
    "lake": (GRACE_1, LAKE_PLANNER, LAKE_NODES, (0.015, 0.02), {"position": 0.15, "model": 0.5}),
}
"""Robot, settings, surfacings, current, and what part of the error a plan that knows it may leave.

In the tank the robot's own unsteadiness is of the size of the drift of one short dive. A robot that
learns the current itself takes the plan's word for half of what it knew before; its second dive is
near its node with or without it.
"""
LONG_DIVES = {"max_uncertainty_m": 60.0}
"""No position is too uncertain, so that a dive in a current that nobody knows may be planned."""


def dives_between(config: PlannerConfig, robot: RobotDefinition, nodes) -> list[tuple[Leg, ...]]:
    """Dives of two glides from node to node."""
    rng = np.random.default_rng(1)
    water = waterway_of(config, robot.site)
    dives = []
    for start, goal in itertools.pairwise(nodes):
        for _ in range(4000):
            shape = random_shape(config, rng)
            edge = propose_edge(config, start, goal, config.round_budget, shape, water)
            if edge and [leg.kind for leg in edge.legs] == [PrimitiveKind.GLIDE] * 2:
                dives.append(edge.legs)
                break
    assert len(dives) == len(nodes) - 1
    return dives


def surfacing_errors_m(robot: RobotDefinition, dives, nodes) -> list[float]:
    """Fly dives; return how far from its node the robot really surfaces each time."""
    life = Life(robot, seed=3)
    flown = mission(*(leg for dive in dives for leg in dive), max_uncertainty_m=50.0)
    life.start(flown)
    errors, legs = [], 0
    for dive, node in zip(dives, nodes[1:], strict=True):
        legs += len(dive)
        assert life.live_until(lambda done=legs: life.executive.leg >= done, 4000.0)
        errors.append(math.dist(life.robot.body.plant.position_ned[:2], node))
    return errors


@pytest.mark.parametrize("method", ["position", "model"])
@pytest.mark.parametrize("name", CASES)
def test_a_robot_whose_plan_knows_the_current_surfaces_nearer_to_its_nodes(
    name, method, monkeypatch
):
    definition, config, nodes, current, shares = CASES[name]
    config = config.model_copy(update=LONG_DIVES)
    estimator = definition.estimator.model_copy(update={"method": method})
    monkeypatch.setattr(RobotDefinition, "estimator", estimator)
    robot = replace(definition, start_ne_m=nodes[0], drift_m_sqrt_s=0.0, current_ne_m_s=current)
    aware = config.model_copy(
        update={"current": PlannedCurrentConfig(north_m_s=current[0], east_m_s=current[1])}
    )
    aimed = dives_between(aware, robot, nodes)
    assert violations(tuple(leg for dive in aimed for leg in dive), aware, robot.site) == ()
    assert limits_of(aware, 20.0).has_current
    known = surfacing_errors_m(robot, aimed, nodes)
    unknown = surfacing_errors_m(robot, dives_between(config, robot, nodes), nodes)
    assert sum(known) < shares[method] * sum(unknown)
    assert max(known) < max(unknown)


@pytest.mark.parametrize("name", CASES)
def test_legs_lead_to_their_nodes_over_ground_and_tell_the_current_of_each_dive(name):
    robot, config, nodes, current, _ = CASES[name]
    config = config.model_copy(update=LONG_DIVES)
    aware = config.model_copy(
        update={"current": PlannedCurrentConfig(north_m_s=current[0], east_m_s=current[1])}
    )
    legs = tuple(leg for dive in dives_between(aware, robot, nodes) for leg in dive)
    course = over_ground(legs)
    assert course.currents_ne_m_s == tuple(pytest.approx(current) for _ in legs)
    ends = [leg.end_ned for leg in course.legs if leg.end_ned[2] <= 0.0]
    assert ends == [pytest.approx((*node, 0.0), abs=1e-6) for node in nodes[1:]]
    for before, after in itertools.pairwise(course.legs):
        assert after.start_ned == pytest.approx(before.end_ned, abs=1e-6)


def test_a_swim_counts_on_the_current_of_the_dive_after_it_and_stays_where_it_is():
    robot, config, nodes, current, _ = CASES["tank"]
    aware = config.model_copy(
        update={"current": PlannedCurrentConfig(north_m_s=current[0], east_m_s=current[1])}
    )
    dives = [leg for dive in dives_between(aware, robot, nodes) for leg in dive]
    swim = primitive.swim(aware, (0.2, 0.5, 0.0), dives[0].start_ned)
    course = over_ground((swim, *dives))
    assert course.legs[0] == swim
    assert course.currents_ne_m_s == tuple(pytest.approx(current) for _ in range(5))


def test_a_plan_without_a_current_tells_of_none():
    robot, config, nodes, _, _ = CASES["tank"]
    legs = tuple(leg for dive in dives_between(config, robot, nodes) for leg in dive)
    assert over_ground(legs) == GroundCourse(legs, ())
