import io
from dataclasses import replace
from datetime import UTC, datetime

import httpx
import numpy as np
import pytest

from autonomy.channel import CHANNELS
from autonomy.field.config import FIELD_PRESETS
from autonomy.field.grid import grid_of
from autonomy.site import TANK
from db.query.fleet.robots import add_robot
from db.query.measured.maps import MapRecord, add_map
from db.query.measured.samples import SampleColumns
from robot_link.messages import RobotId
from server.camera.rig import CameraRig
from server.fix.fusion import Fusion
from server.map.site_map import Seen, SiteMap
from server.prediction.predictions import Predictions
from server.scene.source import StationSceneSource
from tests.server.conftest import GRACE, MINI, open_station, robot_record, until
from tests.server.fake_link import state_report

LIVE = FIELD_PRESETS["blue_light"].model


def test_samples_that_cannot_be_carried_are_told_of():
    """A map of the current that tells too little carries nothing, and the switch stays in sight."""
    north_m = np.linspace(0.2, 2.0, 5)
    place, std_m = np.column_stack([north_m, 0.5 + 0.0 * north_m, 0.3 + 0.0 * north_m]), 0.02
    numbers = np.arange(5)
    stds_m, zeros = np.full(5, std_m), np.zeros(5, dtype=np.int64)
    columns = SampleColumns(
        place, stds_m, place, stds_m, north_m, 1_000_000 * numbers, zeros, zeros, numbers
    )
    told, channel = {}, CHANNELS["blue_light"]
    for carriage in ("still", "water"):
        config = FIELD_PRESETS["blue_light"].model_copy(update={"carriage": carriage})
        grid = grid_of(config, TANK.domain, TANK)
        told[carriage] = SiteMap.from_columns(config, channel, grid, (MINI,), columns).water_moved
    assert told == {
        "still": "",
        "water": "The samples are not carried: the map of the current tells too little.",
    }


def samples_of(client):
    async def total():
        answer = await client.get("/api/robots/mini-1/maps/blue_light")
        return answer.json()["samples"]["total"] if answer.status_code == 200 else None

    return total


async def grown(client, count):
    total = samples_of(client)

    async def there():
        return await total() == count

    await until(there)


async def test_map_of_the_configured_model_grows_with_each_sample(client, world):
    robot = world.robots[MINI]
    for x in np.linspace(0.2, 2.5, 12):
        robot.sample((float(x), 0.6, 0.3))
    await grown(client, 12)
    listed = (await client.get("/api/robots/mini-1/maps")).json()
    assert [(entry["variable"], entry["models"]) for entry in listed] == [("blue_light", [LIVE])]
    shown = (await client.get("/api/robots/mini-1/maps/blue_light")).json()
    axes = shown["axes"]
    count = len(axes["x_m"]) * len(axes["y_m"]) * len(axes["z_m"])
    assert len(shown["mean"]) == len(shown["std"]) == count
    assert (shown["scale"], shown["unit"], shown["model"]) == ("log", "counts", LIVE)
    assert min(shown["std"]) > 0.0
    assert max(shown["mean"]) - min(shown["mean"]) > 0.5
    assert sum(shown["samples"]["per_fidelity"]) == 12
    assert (shown["mask"], shown["smoothed_samples"], shown["models"]) == (None, 0, [LIVE])


async def test_sample_told_twice_is_in_the_map_once(client, world):
    sample = world.robots[MINI].sample((1.0, 0.5, 0.2))
    await grown(client, 1)
    world.tell(sample)
    world.robots[MINI].sample((1.2, 0.5, 0.2))
    await grown(client, 2)


async def test_worse_located_samples_count_for_a_lower_fidelity(client, world):
    robot = world.robots[MINI]
    for std_m in (0.01, 0.08, 0.3):
        robot.sample((1.0, 0.5 + std_m, 0.2), position_std_m=std_m)
    await grown(client, 3)
    shown = (await client.get("/api/robots/mini-1/maps/blue_light")).json()
    assert shown["samples"]["per_fidelity"] == [1, 1, 1]


async def test_map_is_the_same_after_a_restart(tmp_path, world):
    async with open_station(tmp_path, world) as station:
        world.tell(state_report(MINI))
        for x in (0.4, 1.1, 1.9):
            world.robots[MINI].sample((x, 0.7, 0.3))
        key = ("blue_light", LIVE)
        await until(
            lambda: (
                key in station.maps.views(MINI)
                and sum(station.maps.views(MINI)[key].samples_per_level) == 3
            )
        )
        before = station.maps.views(MINI)[key]
    async with open_station(tmp_path, world) as station:
        await until(lambda: key in station.maps.views(MINI))
        after = station.maps.views(MINI)[key]
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-9)
    np.testing.assert_allclose(after.std, before.std, atol=1e-9)


async def test_new_fidelity_thresholds_sort_the_samples_anew(client, world):
    world.robots[MINI].sample((1.0, 0.5, 0.2), position_std_m=0.08)
    await grown(client, 1)
    patch = {"fidelity_thresholds_m": [0.09, 0.2]}
    await client.patch("/api/config/planner?robot=mini-1", json=patch)

    async def sorted_anew():
        shown = (await client.get("/api/robots/mini-1/maps/blue_light")).json()
        return shown["samples"]["per_fidelity"] == [0, 0, 1]

    await until(sorted_anew)


async def test_archive_holds_the_same_numbers_and_says_that_they_are_simulated(client, world):
    world.robots[MINI].sample((1.0, 0.5, 0.2))
    await grown(client, 1)
    answer = await client.get("/api/robots/mini-1/maps/blue_light?format=npz")
    assert "SIMULATION" in answer.headers["content-disposition"]
    said = await client.get("/api/robots/mini-1/maps/blue_light")
    assert said.headers["content-disposition"].endswith('_SIMULATION.json"')
    shown = said.json()
    with np.load(io.BytesIO(answer.content)) as arrays:
        assert bool(arrays["simulation"])
        assert (str(arrays["unit"]), str(arrays["scale"]), int(arrays["samples"])) == (
            "counts",
            "log",
            1,
        )
        assert str(arrays["config_version"]) == shown["config_version"] == "preset"
        np.testing.assert_array_equal(arrays["mean"].ravel(), shown["mean"])
        axes = [len(shown["axes"][name]) for name in ("x_m", "y_m", "z_m")]
        assert arrays["shape"].tolist() == shown["shape"] == axes
        assert str(arrays["order"]) == shown["order"] == "x slowest, z fastest"
        assert str(arrays["value_unit"]) == shown["value_unit"] == "ln(counts)"
        assert str(arrays["site"]) == shown["site"]
        assert float(arrays["origin_latitude_deg"]) == shown["origin_latitude_deg"]
        assert float(arrays["origin_longitude_deg"]) == shown["origin_longitude_deg"]


async def test_table_of_the_map_explains_itself(client, world):
    world.robots[MINI].sample((1.0, 0.5, 0.2))
    await grown(client, 1)
    answer = await client.get("/api/robots/mini-1/maps/blue_light?format=csv")
    assert "SIMULATION.csv" in answer.headers["content-disposition"]
    lines = answer.text.splitlines()
    comments = [line for line in lines if line.startswith("#")]
    assert comments[0].startswith("# SIMULATION")
    assert f"# model: {LIVE}" in comments
    head, *rows = lines[len(comments) :]
    assert head.split(",")[5:] == ["median [counts]", "mean [ln(counts)]", "std [ln(counts)]"]
    shown = (await client.get("/api/robots/mini-1/maps/blue_light")).json()
    assert len(rows) == len(shown["mean"])
    last = [float(cell) for cell in rows[-1].split(",")]
    assert last[6] == pytest.approx(shown["mean"][-1], rel=1e-5)
    assert last[5] == pytest.approx(np.exp(shown["mean"][-1]), rel=1e-4)
    assert last[3] == pytest.approx(42.725, abs=1e-2)


async def test_map_that_does_not_exist_is_refused_with_those_that_do(client, station):
    await until(lambda: station.maps.views(MINI))
    refused = await client.get("/api/robots/mini-1/maps/salinity")
    assert refused.status_code == 404
    assert f"blue_light ({LIVE})" in refused.json()["detail"]
    assert (await client.get("/api/robots/nobody/maps")).status_code == 404


async def test_recorded_robot_shows_the_map_that_its_import_kept(client, station):
    name = RobotId("eva-035")
    packed = io.BytesIO()
    np.savez_compressed(packed, mean=np.arange(12.0), std=np.ones(12))
    record = replace(
        robot_record(name, 9, "", station.fleet.status(GRACE).record.site),
        kind="recorded",
        system_id=None,
        links=(),
    )
    scores = {"model": "single", "title": "held out", "rmse": 0.3, "nlpd": 0.1, "wmse": 1.0}
    kept = MapRecord(
        robot=name,
        variable="chlorophyll",
        model="single",
        at=datetime.now(UTC),
        samples=900,
        document={
            "axes": {"x_m": [0, 1], "y_m": [0, 1], "z_m": [0, 1, 2]},
            "scores": {**scores, "coverage_90": 0.9, "samples": 900, "held_out": 400},
        },
        grid=packed.getvalue(),
    )

    def write(session):
        add_robot(session, record)
        add_map(session, kept)

    await station.foundation.store.write(write)
    await station.refresh(name)
    shown = (await client.get(f"/api/robots/{name}/maps/chlorophyll")).json()
    assert shown["mean"] == list(range(12))
    assert shown["scores"]["rmse"] == 0.3
    robot = (await client.get(f"/api/robots/{name}")).json()
    assert (robot["activity"], robot["kind"]) == ("Recording", "recorded")
    assert (
        await client.post(f"/api/robots/{name}/commands", json={"kind": "hold"})
    ).status_code == 409


async def test_scene_draws_pose_track_plan_and_map_of_the_same_robot(client, station, world):
    services = station.foundation.services
    source = StationSceneSource(
        MINI,
        station.fleet,
        station.maps,
        station.vehicles,
        station.whatifs.shown,
        services.get(Predictions),
        services.get(Fusion),
        services.get(CameraRig),
    )
    world.tell(state_report(MINI, (1.3, 0.7, 0.4)))
    assert source.pose().position_ned == (1.3, 0.7, 0.4)
    first = source.track_since(0)
    assert first.restarted
    assert len(first.position_ned) == 2
    world.tell(state_report(MINI, (1.5, 0.7, 0.4)))
    more = source.track_since(first.cursor)
    assert not more.restarted
    assert more.position_ned.tolist() == [[1.5, 0.7, 0.4]]
    assert source.plan() is None
    await client.post(
        "/api/robots/mini-1/plans",
        json={"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, 0.5]}]},
    )
    plan = source.plan()
    assert plan is source.plan()
    assert plan.state == "draft"
    assert plan.points.shape[1] == 5
    await until(lambda: source.maps() == (LIVE,))
    view = source.map_view(LIVE)
    assert view is source.map_view(LIVE)
    assert view.mean.shape == (len(view.x_m), len(view.y_m), len(view.z_m))


def test_numbers_without_a_gap_cost_no_memory():
    seen = Seen()
    for number in (0, 1, 2, 5, 4, 3):
        assert seen.add(1, number)
    assert not any(seen.add(1, number) for number in range(6))
    assert seen.add(2, 0)
    assert not any(seen._beyond.values())


@pytest.mark.parametrize("path", ["maps", "state", "track", "samples?channel=depth_m", "plans"])
async def test_everything_about_a_robot_needs_a_sign_in(client, path):
    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(client.app), base_url="http://127.0.0.1"
    ) as stranger:
        assert (await stranger.get(f"/api/robots/mini-1/{path}")).status_code == 401
