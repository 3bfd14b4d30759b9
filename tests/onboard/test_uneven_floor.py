from dataclasses import replace

import numpy as np
import pytest

from autonomy.site import LAKE
from autonomy.vehicle.surroundings import Surroundings
from onboard.flight.hardware import SetPoints
from onboard.flight.safety import danger
from robot_link.mission import MissionSettings
from simulator.current import DriftingCurrent
from simulator.fleet import GRACE_1, MINI_1
from simulator.plant import Plant
from tests.simulator.flight import Life

SHALLOW = (60.0, 110.0)


@pytest.mark.parametrize("place", [SHALLOW, (410.0, 150.0)])
def test_a_heavy_robot_comes_to_rest_on_the_floor_as_it_was_surveyed(place):
    still = DriftingCurrent(0.0, 20.0, np.random.default_rng(0))
    plant = Plant(GRACE_1.vehicle, Surroundings.of_site(LAKE), still, place, 0.0, LAKE)
    for _ in range(180):
        plant.advance(SetPoints(GRACE_1.vehicle.limits.m0_max_kg, 0.0), 5.0)
    north, east, down = plant.position_ned
    floor = float(LAKE.floor_m(north, east))
    assert floor < 15.0
    assert down == pytest.approx(floor, abs=0.1)


def test_a_robot_comes_up_before_it_meets_the_floor_where_it_is():
    life = Life(replace(GRACE_1, start_ne_m=SHALLOW))
    flight = life.executive._flight
    settings = MissionSettings(10.0, 50.0, 5000.0, *SHALLOW)
    floor = float(LAKE.floor_m(*SHALLOW))
    for above, reason in ((2.0, ""), (1.0, "the floor is near")):
        estimate = replace(life.estimate, position_ned=(*SHALLOW, floor - above))
        assert danger(flight, settings, estimate) == reason


def test_a_robot_that_doubts_its_position_keeps_farther_from_the_shore():
    life = Life(replace(GRACE_1, start_ne_m=SHALLOW))
    flight, settings = life.executive._flight, MissionSettings(10.0, 50.0, 5000.0, *SHALLOW)
    shore_m = LAKE.clearance_m(*SHALLOW)
    assert shore_m > 2.0 * flight.profile.shore_margin_m
    near = "a wall or the shore is near"
    for std_m, reason in ((0.1, ""), (0.49 * shore_m, ""), (0.51 * shore_m, near)):
        estimate = replace(life.estimate, position_ned=(*SHALLOW, 1.0), position_std_m=std_m)
        assert danger(flight, settings, estimate) == reason


def test_a_tank_keeps_its_flat_floor():
    assert Life(MINI_1).robot.body.plant._uneven is None
