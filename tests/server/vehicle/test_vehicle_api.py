"""The catalogue of vehicles by REST, and robots that are switched to a vehicle of their own."""

import pytest

from autonomy.control.catalogue import CONTROLLERS
from autonomy.planner.config import EnergyConfig, PrimitiveConfig
from autonomy.planner.preset import planner_preset
from autonomy.site import TANK
from autonomy.vehicle.config import GRACE3, MINIGLIDER
from autonomy.vehicle.parameter_file import vehicle_document
from db.fault import StoreUnavailableError
from db.store import Store
from server.access.role import Role
from server.base.worker import WorkerPool
from server.vehicle import vehicles
from tests.server.conftest import MINI, api_client, open_station

pytestmark = pytest.mark.usefixtures("in_threads")


def document(key="mini-b", base=MINIGLIDER, **head):
    return {**vehicle_document(base), "key": key, "title": "Miniglider B", **head}


async def test_built_in_vehicles_are_listed_with_their_robots(client):
    listed = (await client.get("/api/vehicles")).json()["vehicles"]
    assert [(one["key"], one["origin"], one["robots"]) for one in listed] == [
        ("miniglider", "built-in", ["mini-1"]),
        ("grace3", "built-in", ["grace-1"]),
    ]
    assert listed[1]["note"] == "scaled, not identified"


async def test_a_vehicle_from_a_file_is_kept_over_a_restart(tmp_path, world):
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        answer = await pilot.post("/api/vehicles", json=document(note="after the refit"))
        assert answer.status_code == 201
        assert answer.json()["created_by"] == "test pilot"
    async with open_station(tmp_path, world) as station, api_client(station, Role.VIEWER) as viewer:
        listed = (await viewer.get("/api/vehicles")).json()["vehicles"]
        assert [(one["key"], one["origin"]) for one in listed][2:] == [("mini-b", "file")]
        kept = (await viewer.get("/api/vehicles/mini-b")).json()
        assert kept == document(note="after the refit")


@pytest.mark.parametrize("field", ["title", "note"])
async def test_words_that_cannot_be_seen_are_refused(client, field):
    refused = await client.post("/api/vehicles", json=document(**{field: "Mini\u202eB\x07"}))
    assert refused.status_code == 422
    assert [error["loc"] for error in refused.json()["errors"]] == [[field]]
    lines = document(note="after the refit\nin spring")
    assert (await client.post("/api/vehicles", json=lines)).status_code == 201


async def test_wrong_entries_of_a_file_are_all_named_with_their_range(client):
    wrong = document()
    wrong["parameters"] = {**wrong["parameters"], "mass_1_kg": {"value": -1.0, "unit": "kg"}}
    del wrong["parameters"]["mass_2_kg"]
    wrong["parameters"]["mass_3_kg"] = {"value": 8.0}
    wrong["parameters"]["colour"] = {"value": 8.0, "unit": ""}
    refused = await client.post("/api/vehicles", json=wrong)
    assert refused.status_code == 422
    errors = {tuple(error["loc"]): error["msg"] for error in refused.json()["errors"]}
    assert set(errors) == {
        ("parameters", "mass_1_kg", "value"),
        ("parameters", "mass_2_kg"),
        ("parameters", "mass_3_kg", "unit"),
        ("parameters", "colour"),
    }
    assert "from" in errors["parameters", "mass_1_kg", "value"]
    assert len((await client.get("/api/vehicles")).json()["vehicles"]) == 2


async def test_the_key_of_a_vehicle_is_taken_once(client):
    assert (await client.post("/api/vehicles", json=document())).status_code == 201
    for key in ("mini-b", "grace3"):
        refused = await client.post("/api/vehicles", json=document(key))
        assert refused.status_code == 409
        assert key in refused.json()["detail"]


async def test_a_repeated_request_adds_one_vehicle(client):
    headers = {"Idempotency-Key": "once"}
    first, second = [
        await client.post("/api/vehicles", json=document(), headers=headers) for _ in range(2)
    ]
    assert first.json() == second.json()
    assert second.headers["Idempotent-Replayed"] == "true"


async def test_a_robot_is_switched_to_a_vehicle_of_the_catalogue(client, station):
    await client.post("/api/vehicles", json=document(note="after the refit"))
    changed = (await client.patch("/api/robots/mini-1", json={"model": "mini-b"})).json()
    assert (changed["model"], changed["model_key"]) == ("Miniglider B", "mini-b")
    assert (changed["model_note"], changed["model_origin"]) == ("after the refit", "file")
    listed = (await client.get("/api/vehicles")).json()["vehicles"]
    assert [one["robots"] for one in listed] == [[], ["grace-1"], ["mini-1"]]
    assert station.scene_source(MINI).hull == MINIGLIDER.hull


async def test_an_unknown_model_is_refused_with_those_that_exist(client):
    await client.post("/api/vehicles", json=document())
    refused = await client.patch("/api/robots/mini-1", json={"model": "submarine"})
    assert refused.status_code == 422
    (error,) = refused.json()["errors"]
    assert error["loc"] == ["model"]
    assert error["msg"] == "must be one of miniglider, grace3, mini-b"


@pytest.mark.parametrize("base", [MINIGLIDER, GRACE3], ids=lambda base: base.key)
async def test_a_vehicle_begins_with_the_presets_of_the_one_nearest_in_mass(client, base):
    lighter = document(base=base)
    lighter["hull"] = {**lighter["hull"], "displaced_mass_kg": {"value": 7.0, "unit": "kg"}}
    heavier = document("mini-c", base=base)
    heavier["hull"] = {**heavier["hull"], "displaced_mass_kg": {"value": 25.0, "unit": "kg"}}
    for body, nearest in ((lighter, "miniglider"), (heavier, "grace3")):
        await client.post("/api/vehicles", json=body)
        await client.patch("/api/robots/mini-1", json={"model": body["key"]})
        found = (await client.get("/api/config/planner?robot=mini-1")).json()
        preset = planner_preset(nearest, "tank").model_copy(update={"domain": TANK.domain})
        assert found["value"] == preset.model_dump(mode="json")


@pytest.mark.parametrize("kind", CONTROLLERS)
async def test_every_controller_has_settings_and_gains_for_exact_states(client, kind):
    found = (await client.get(f"/api/config/{kind}?robot=mini-1")).json()
    expected = CONTROLLERS[kind].preset("miniglider").model_dump(mode="json")
    assert found["value"] == expected
    simulated = CONTROLLERS[kind].simulation_preset.model_dump(mode="json")
    assert found["simulation_preset"] == simulated
    assert (await client.get("/api/config/planner")).json()["simulation_preset"] is None


async def test_a_polar_tells_where_a_vehicle_glides_and_is_worked_out_once(
    client, station, monkeypatch
):
    first = (await client.get("/api/vehicles/miniglider/polar")).json()
    shape = (len(first["m0_kg"]), len(first["rp1_m"]))
    for table in ("speed_m_s", "glide_angle_rad", "greatest_growth_per_s", "stable"):
        assert (len(first[table]), len(first[table][0])) == shape
    speeds = [speed for row in first["speed_m_s"] for speed in row if speed is not None]
    assert len(speeds) > 50
    assert 0.0 < min(speeds) < max(speeds) < 1.0

    async def never(*_):
        raise AssertionError

    monkeypatch.setattr(station.workers, "run", never)
    assert (await client.get("/api/vehicles/miniglider/polar")).json() == first


async def test_a_polar_follows_the_numbers_of_its_vehicle(client):
    slick = document()
    slick["parameters"] = {**slick["parameters"], "drag_0": {"value": 0.2, "unit": ""}}
    assert (await client.post("/api/vehicles", json=slick)).status_code == 201
    polars = [
        (await client.get(f"/api/vehicles/{key}/polar")).json() for key in ("miniglider", "mini-b")
    ]
    fastest = [
        max(speed for row in polar["speed_m_s"] for speed in row if speed is not None)
        for polar in polars
    ]
    assert fastest[1] > 1.1 * fastest[0]


async def test_a_steady_spiral_is_told_with_its_radius_and_eigenvalues(client):
    path = "/api/vehicles/miniglider/steady?m0_kg=0.015&rp1_m=0.01"
    straight = (await client.get(path)).json()
    assert straight["turn_radius_m"] is None
    assert straight["vertical_speed_m_s"] > 0.0
    spiral = (await client.get(f"{path}&delta_rad=0.5")).json()
    assert spiral["turn_radius_m"] > 0.0
    assert spiral["turn_rate_rad_s"] != 0.0
    assert spiral["stable"] == all(value["real"] < 0.0 for value in spiral["eigenvalues"])


async def test_motion_that_does_not_exist_is_refused_in_words(client):
    neutral = await client.get("/api/vehicles/miniglider/steady?m0_kg=0&rp1_m=0.01")
    assert neutral.status_code == 422
    assert "neutrally buoyant" in neutral.json()["detail"]
    beyond = await client.get("/api/vehicles/miniglider/steady?m0_kg=0.5&rp1_m=-0.2")
    assert beyond.status_code == 422
    assert [error["loc"] for error in beyond.json()["errors"]] == [
        ["query", "m0_kg"],
        ["query", "rp1_m"],
    ]
    assert "0.0225" in beyond.json()["errors"][0]["msg"]


@pytest.mark.parametrize("path", ["", "/polar", "/steady?m0_kg=0.01&rp1_m=0"])
async def test_an_unknown_vehicle_is_refused_with_those_that_exist(client, path):
    refused = await client.get(f"/api/vehicles/submarine{path}")
    assert refused.status_code == 404
    assert "miniglider, grace3" in refused.json()["detail"]


async def test_only_a_pilot_adds_vehicles(station):
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.post("/api/vehicles", json=document())).status_code == 403
        assert (await viewer.get("/api/vehicles")).status_code == 200


async def test_a_vehicle_that_cannot_be_kept_is_not_in_the_catalogue(client, station, monkeypatch):
    async def failing(self, function):
        raise StoreUnavailableError("The disk is full.")

    monkeypatch.setattr(Store, "write", failing)
    refused = await client.post("/api/vehicles", json=document())
    assert refused.status_code == 503
    assert "disk is full" in refused.json()["detail"]
    monkeypatch.undo()
    assert (await client.post("/api/vehicles", json=document())).status_code == 201


async def test_only_the_last_polars_are_kept(station, monkeypatch):
    monkeypatch.setattr(vehicles, "ANSWERS_KEPT", 1)
    asked = []

    async def run(task, vehicle):
        asked.append(vehicle.key)
        return {}

    monkeypatch.setattr(station.workers, "run", run)
    for key in ("miniglider", "grace3", "grace3", "miniglider"):
        await station.vehicles.polar(key)
    assert asked == ["miniglider", "grace3", "miniglider"]


@pytest.mark.parametrize(
    ("wish", "key"),
    [("Mini 2026/11", "mini-2026-11"), ("miniglider", "miniglider-2"), ("...", "vehicle")],
)
async def test_a_free_key_is_as_near_to_the_wish_as_it_gets(station, wish, key):
    assert station.vehicles.free_key(wish) == key


@pytest.mark.parametrize(
    ("kind", "reach", "words"),
    [
        ("planner", "station", "Used by the station"),
        ("field", "station", "Used by the station"),
        ("trim", "mission", "with the next plan"),
        ("estimator", "none", "Not on board"),
        ("controller.backstepping", "mission", "with the next plan"),
        *(
            (kind, "none", "Not on board")
            for kind in CONTROLLERS
            if kind != "controller.backstepping"
        ),
    ],
)
async def test_settings_say_how_far_they_reach(client, kind, reach, words):
    found = (await client.get(f"/api/config/{kind}?robot=mini-1")).json()
    assert found["reach"] == reach
    assert words in found["reach_text"]


async def test_capability_tells_what_a_vehicle_can_fly_in_water_of_a_depth(
    client, in_threads, monkeypatch
):
    deep = (await client.get("/api/vehicles/miniglider/capability")).json()
    tank = (await client.get("/api/vehicles/miniglider/capability?depth_m=0.65")).json()
    assert tank["primitives"]["depth_change_min_m"] <= 0.65
    assert deep["primitives"]["depth_change_min_m"] > tank["primitives"]["depth_change_min_m"]
    PrimitiveConfig.model_validate(tank["primitives"])
    EnergyConfig.model_validate(tank["energy"])
    assert tank["joules_per_unit"] > 0.0
    # The second time it comes from memory.
    monkeypatch.setattr(WorkerPool, "run", None)
    again = await client.get("/api/vehicles/miniglider/capability?depth_m=0.65")
    assert again.json() == tank
    assert (await client.get("/api/vehicles/whale/capability")).status_code == 404
    assert (await client.get("/api/vehicles/grace3/capability?depth_m=0")).status_code == 422
