"""What a design leaves of the robot's battery, as its account says it."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from autonomy.design.document import Design, Manner, Way, Waypoint
from autonomy.planner.preset import GRACE3
from autonomy.site import LAKE
from autonomy.vehicle.config import VEHICLES
from robot_link.satellite.config import SatelliteConfig
from server.design.outline import Surroundings, lay, outline_view
from server.plan.battery import WayHome, battery_of_legs
from tests.server.conftest import MINI, until
from tests.server.design.test_designs import LINE
from tests.server.fake_link import state_report
from tests.server.target.test_tracking_account import by_model

AROUND = Surroundings(
    config=GRACE3,
    current_text="",
    site=LAKE,
    spacing_m=50.0,
    robot_ned=None,
    battery_left=0.6,
    vehicle=VEHICLES["grace3"],
    tariff=SatelliteConfig().tariff,
    now=datetime(2026, 6, 1, 12, tzinfo=UTC),
    battery=by_model("grace3", 0.6),
)


def drawn(seed):
    """Return a yo-yo over some drawn places of the lake."""
    places = np.random.default_rng(seed).uniform(150.0, 350.0, (6, 2))
    waypoints = tuple(Waypoint(north_m=north, east_m=east) for north, east in places)
    return Design(content=Way(waypoints=waypoints), manner=Manner(deep_m=10.0))


def after(design, **changes):
    found = outline_view(design, replace(AROUND, **changes)).account
    assert found is not None
    return found.battery_after


@pytest.mark.parametrize("seed", range(4))
def test_a_design_takes_what_the_plan_of_its_legs_takes(seed):
    design = drawn(seed)
    found, account = after(design), outline_view(design, AROUND).account
    legs = tuple(lay(design, AROUND).laid_out.legs)
    plan = battery_of_legs(AROUND.battery, legs, account.duration_s, WayHome(), GRACE3.energy)
    assert found.used_wh.mean == pytest.approx(plan.used_wh)
    assert account.energy_wh == pytest.approx(plan.used_wh)
    assert (found.used_wh.low, found.used_wh.high) == pytest.approx(
        (plan.used_low_wh, plan.used_high_wh)
    )
    assert found.left.mean == pytest.approx(0.6 - plan.used)
    assert found.left.low < found.left.mean < found.left.high < 0.6
    for share, energy_wh in zip(
        (found.left.low, found.left.high), (found.left_wh.low, found.left_wh.high), strict=True
    ):
        assert share * found.capacity_wh == pytest.approx(energy_wh)


def test_the_way_there_and_the_way_home_take_their_part():
    design = drawn(5)
    first = design.content.waypoints[0]
    here = (first.north_m, first.east_m, 0.0)
    far = (here[0] - 100.0, here[1], 0.0)
    at_once, later = after(design, robot_ned=here), after(design, robot_ned=far)
    assert later.left.mean == pytest.approx(at_once.left.mean - later.there)
    assert later.there > at_once.there == 0.0
    assert (at_once.home, at_once.home_m) == (None, None)
    home = after(design, robot_ned=here, home_ne_m=far[:2])
    last = design.content.waypoints[-1]
    assert home.home_m == pytest.approx(math.dist(far[:2], (last.north_m, last.east_m)), abs=0.1)
    assert home.home.mean < home.left.mean == at_once.left.mean
    assert home.home.low < home.home.mean < home.home.high


def test_a_battery_that_does_not_last_is_empty_and_not_below():
    found = after(drawn(6), battery=by_model("grace3", 1e-5))
    assert (found.left.low, found.left.mean, found.left_wh.mean) == (0.0, 0.0, 0.0)


def test_nothing_is_said_where_the_robot_did_not_say_what_it_has():
    assert after(drawn(7), battery=None) is None
    assert after(drawn(7), battery=by_model("grace3", None)) is None


async def test_the_account_of_a_design_says_what_is_left_after_it(client, world):
    world.tell(state_report(MINI, (1.2, 0.6, 0.0), battery_fraction=0.5))

    async def told():
        path = f"/api/robots/{MINI}/designs/check"
        account = (await client.post(path, json={"document": LINE})).json()["account"]
        return account if account["battery_left"] == 0.5 else None

    account = await until(told)
    found = account["battery_after"]
    assert 0.0 < found["left"]["low"] < found["left"]["mean"] < found["left"]["high"] < 0.5
    assert found["reserve"] == pytest.approx(0.1)
