"""What is told of a reference that does not fit into the robot's water."""

from datetime import UTC, datetime

import numpy as np
import pytest

from autonomy.site import LAKE, TANK
from autonomy.vehicle.config import VEHICLES
from autonomy.whatif.result import Track
from autonomy.whatif.setting import packed_references
from db.query.fleet.robots import RobotRecord
from server.base.configuration_kind import KINDS
from server.study.whatif import water_notices
from tests.server.study.test_whatif_api import SHORT, ended, start

pytestmark = pytest.mark.usefixtures("in_threads")


def reference(north_m=0.0, east_m=0.0, depth_m=0.0):
    """From the origin straight to a point."""
    share = np.linspace(0.0, 1.0, 5)
    ends = {"north_m": north_m, "east_m": east_m, "depth_m": depth_m}
    along = {name: [*(end * share).tolist()] for name, end in ends.items()}
    return Track(**along, pitch_rad=[0.0] * share.size)


@pytest.mark.parametrize(
    ("site", "given", "notices"),
    [
        (LAKE, reference(300.0, -300.0, 16.2), []),
        (
            TANK,
            reference(depth_m=16.2),
            ["The reference goes 16.2 m deep; Test tank (tank) is 1.2 m deep."],
        ),
        (TANK, reference(depth_m=-0.4), ["The reference rises 0.4 m above the surface."]),
        (
            TANK,
            reference(-9.0, 8.0, 1.0),
            [
                "The reference takes 9.0 m from south to north; Test tank (tank) has 4.6 m.",
                "The reference takes 8.0 m from west to east; Test tank (tank) has 3.1 m.",
            ],
        ),
    ],
)
def test_each_border_that_a_reference_crosses_is_told(site, given, notices):
    assert water_notices(given, site) == notices


@pytest.mark.parametrize("site", [TANK, LAKE], ids=["tank", "lake"])
@pytest.mark.parametrize("vehicle", [*VEHICLES, "of-ones-own"])
def test_the_scenario_that_a_form_begins_with_stays_in_the_robots_water(site, vehicle):
    at = datetime(2026, 11, 21, tzinfo=UTC)
    robot = RobotRecord("mini-1", "mini-1", "miniglider", "simulated", 1, (), site, at)
    trial = KINDS["trial"].preset(robot, vehicle)
    packed = packed_references(VEHICLES.get(vehicle, VEHICLES["miniglider"]), trial)
    north_m, east_m, depth_m = packed[:, :3].T.tolist()
    level = [0.0] * len(depth_m)
    along = Track(north_m=north_m, east_m=east_m, depth_m=depth_m, pitch_rad=level)
    assert water_notices(along, site) == []
    assert trial.duration_s >= 60.0
    assert max(depth_m) <= site.domain.depth_max_m


async def test_a_run_in_a_tank_says_that_its_reference_leaves_it(client):
    begun = await start(client, {**SHORT, "duration_s": 300.0, "runs": 1})
    before = (await client.get(f"/api/whatifs/{begun['id']}")).json()
    assert before["notices"] == [] or before["state"] == "done"
    found = await ended(client, begun)
    assert found["state"] == "done"
    assert any("m deep; Test tank (tank) is 1.2 m deep." in one for one in found["notices"])


async def test_an_unknown_field_is_told_what_there_is(client):
    path = "/api/config/planner?robot=mini-1"
    refused = await client.patch(path, json={"search": {"iteration_max": 9}})
    (error,) = refused.json()["errors"]
    assert error["loc"] == ["search", "iteration_max"]
    assert error["msg"].startswith("there is no such field; there are ")
    assert "iterations_max" in error["msg"]
    body = {"scenario": {}, "controllers": [], "colour": 1}
    refused = await client.post("/api/robots/mini-1/whatif", json=body)
    messages = {tuple(error["loc"]): error["msg"] for error in refused.json()["errors"]}
    assert messages["colour",] == "there is no such field"
