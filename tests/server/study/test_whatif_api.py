"""What-if runs by REST: compared on the same seeds, kept, shown, called off, interrupted."""

import asyncio

import numpy as np
import pytest

from autonomy.control.catalogue import CONTROLLERS
from db.fault import StoreUnavailableError
from db.store import Store
from robot_link.messages import RobotMode
from server.access.role import Role
from server.base import study
from server.base.worker import WorkerPool
from server.current.currents import Currents
from server.study.task import WHATIF
from tests.server.conftest import GRACE, MINI, api_client, open_station, until
from tests.server.fake_link import state_report
from tests.server.plan.test_plan_flow import told

pytestmark = pytest.mark.usefixtures("in_threads")

SHORT = {
    "reference": "linear_glide",
    "duration_s": 20.0,
    "runs": 2,
    "disturbance": {"net_buoyancy_error_kg": 0.002},
}
LONG = {"duration_s": 2000.0, "runs": 200}
"""It takes a minute on a fast machine."""
TWO = [{"kind": "controller.backstepping"}, {"kind": "controller.pid", "title": "Mine"}]


async def start(client, scenario=SHORT, controllers=TWO, robot=MINI):
    body = {"scenario": scenario, "controllers": controllers}
    answer = await client.post(f"/api/robots/{robot}/whatif", json=body)
    assert answer.status_code == 202, answer.text
    return {"id": answer.json()["about"], "job": answer.json()["id"]}


async def ended(client, begun):
    async def has_ended():
        found = (await client.get(f"/api/whatifs/{begun['id']}")).json()
        job = (await client.get(f"/api/jobs/{begun['job']}")).json()
        return None if "running" in {found["state"], job["state"]} else found

    return await until(has_ended)


async def test_controllers_are_compared_on_the_same_seeds(client):
    begun = await start(client)
    found = await ended(client, begun)
    assert found["state"] == "done", found["message"]
    assert found["title"] == "Backstepping, Mine: linear glide"
    assert found["scenario"]["disturbance"]["net_buoyancy_error_kg"] == 0.002
    assert found["vehicle"] == "miniglider"
    result = found["result"]
    assert [run["title"] for run in result["runs"]] == ["Backstepping", "Mine"]
    assert len(result["seeds"]) == 2
    for run in result["runs"]:
        assert len(run["north_m"]) == len(result["time_s"])
        assert run["summary"]["depth_rms_m"] > 0.0
    job = (await client.get(f"/api/jobs/{begun['job']}")).json()
    assert (job["state"], job["result"]) == ("done", {"whatif": begun["id"]})


async def test_the_same_request_gives_the_same_result(client):
    first, second = [await ended(client, await start(client)) for _ in range(2)]
    assert first["id"] != second["id"]
    assert first["result"] == second["result"]


async def test_what_is_not_given_is_what_holds_for_the_robot(client):
    await client.patch("/api/config/trial?robot=mini-1", json={"duration_s": 30.0, "runs": 1})
    await client.patch("/api/config/controller.pid?robot=mini-1", json={"z_integral": 0.01})
    controllers = [{"kind": "controller.pid", "config": {"z_derivative": 0.5}}] * 2
    found = await ended(client, await start(client, {}, controllers))
    assert found["scenario"]["duration_s"] == 30.0
    assert [one["title"] for one in found["controllers"]] == ["PID", "PID 2"]
    config = found["controllers"][0]["config"]
    assert (config["z_integral"], config["z_derivative"]) == (0.01, 0.5)
    held = (await client.get("/api/config/controller.pid?robot=mini-1")).json()["value"]
    assert held["z_derivative"] != 0.5


async def test_every_wrong_field_is_named_by_its_path_at_once(client):
    body = {
        "scenario": {"duration_s": -1.0, "start": {"pitch_rad": 9.0}},
        "controllers": [
            {"kind": "controller.pid", "config": {"z_integral": "much"}},
            {"kind": "planner"},
            {"kind": "controller.backstepping", "config": {"k_zz": 1.0}},
        ],
    }
    refused = await client.post("/api/robots/mini-1/whatif", json=body)
    assert refused.status_code == 422
    errors = {tuple(error["loc"]): error["msg"] for error in refused.json()["errors"]}
    assert set(errors) == {
        ("scenario", "duration_s"),
        ("scenario", "start", "pitch_rad"),
        ("controllers", 0, "config", "z_integral"),
        ("controllers", 1, "kind"),
        ("controllers", 2, "config", "k_zz"),
    }
    assert all(kind in errors["controllers", 1, "kind"] for kind in CONTROLLERS)
    assert (await client.get("/api/robots/mini-1/whatifs")).json()["whatifs"] == []


async def test_a_reference_that_the_vehicle_cannot_follow_is_refused_with_the_limit(client):
    cases = (
        ({"reference": "straight_glide", "straight": {"vertical_speed_m_s": 0.8}}, "cm/s"),
        ({"reference": "straight_glide", "straight": {"glide_angle_rad": -0.05}}, "glide"),
        ({"reference": "level_swim"}, "only the swimming controller"),
    )
    for scenario, limit in cases:
        body = {"scenario": {**SHORT, **scenario}, "controllers": TWO}
        refused = await client.post("/api/robots/mini-1/whatif", json=body)
        assert refused.status_code == 422
        (error,) = refused.json()["errors"]
        assert error["loc"] == ["scenario", "reference"]
        assert limit in error["msg"].lower()
    assert (await client.get("/api/robots/mini-1/whatifs")).json()["whatifs"] == []


@pytest.mark.parametrize(
    "controllers", [[], TWO * 4, [{"kind": "controller.pid", "gain": 1}], [{"config": {}}]]
)
async def test_a_list_of_controllers_that_cannot_be_is_refused(client, controllers):
    refused = await client.post("/api/robots/mini-1/whatif", json={"controllers": controllers})
    assert refused.status_code == 422


async def test_an_unknown_robot_is_refused(client):
    body = {"controllers": TWO}
    assert (await client.post("/api/robots/nobody/whatif", json=body)).status_code == 404
    assert (await client.get("/api/robots/nobody/whatifs")).status_code == 404
    assert (await client.get("/api/whatifs/whatif-9")).status_code == 404


async def test_a_run_that_the_station_stops_in_is_interrupted(tmp_path, world):
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        begun = await start(pilot, LONG)
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        found = (await pilot.get(f"/api/whatifs/{begun['id']}")).json()
        assert found["state"] == "interrupted"
        assert "stopped" in found["message"]


async def test_a_repeated_request_begins_one_run(client):
    body = {"scenario": SHORT, "controllers": TWO}
    headers = {"Idempotency-Key": "once"}
    answers = [
        await client.post("/api/robots/mini-1/whatif", json=body, headers=headers) for _ in range(2)
    ]
    assert answers[0].json() == answers[1].json()
    listed = (await client.get("/api/robots/mini-1/whatifs")).json()["whatifs"]
    assert len(listed) == 1
    begun = answers[0].json()
    await ended(client, {"id": begun["about"], "job": begun["id"]})


async def test_runs_are_listed_the_newest_first(client):
    for _ in range(2):
        await ended(client, await start(client))
    listed = (await client.get("/api/robots/mini-1/whatifs")).json()["whatifs"]
    assert [one["id"] for one in listed] == ["whatif-2", "whatif-1"]
    assert {one["created_by"] for one in listed} == {"test admin"}
    path = "/api/robots/mini-1/whatifs?before=whatif-2"
    assert [one["id"] for one in (await client.get(path)).json()["whatifs"]] == ["whatif-1"]
    assert (await client.get("/api/robots/grace-1/whatifs")).json()["whatifs"] == []


async def test_a_run_is_shown_in_3d_from_where_the_robot_is(tmp_path, world):
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.3), mode=RobotMode.GLIDING))
        source = station.scene_source(MINI)
        assert source.comparison() is None
        begun = await start(pilot)
        found = await ended(pilot, begun)
        path = "/api/robots/mini-1/whatif/shown"
        assert (await pilot.put(path, json={"id": begun["id"]})).json() == {"id": begun["id"]}
        view = source.comparison()
        assert view is source.comparison()
        assert [run.title for run in view.runs] == ["Backstepping", "Mine"]
        run = found["result"]["runs"][0]
        expected = np.column_stack([run["north_m"], run["east_m"], run["depth_m"]])
        np.testing.assert_allclose(
            view.runs[0].position_ned - expected, [[1.2, 0.6, 0.0]] * len(expected)
        )
        listed = (await pilot.get("/api/robots/mini-1/whatifs")).json()["whatifs"]
        assert listed[0]["shown"]
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        again = station.scene_source(MINI).comparison()
        np.testing.assert_array_equal(again.reference_ned, view.reference_ned)
        assert again.version == view.version
        assert (await pilot.put(path, json={"id": None})).json() == {"id": None}
        assert station.scene_source(MINI).comparison() is None


async def test_only_a_run_of_the_robot_with_a_result_is_shown(client):
    begun = await start(client, LONG)
    path = "/api/robots/{}/whatif/shown"
    refused = await client.put(path.format("mini-1"), json={"id": begun["id"]})
    assert refused.status_code == 409
    assert "running" in refused.json()["detail"]
    for robot, whatif in (("grace-1", begun["id"]), ("mini-1", "whatif-9")):
        refused = await client.put(path.format(robot), json={"id": whatif})
        assert refused.status_code == 404
    await client.delete(f"/api/jobs/{begun['job']}")


async def test_a_viewer_reads_runs_but_begins_none(client, station):
    begun = await start(client)
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await ended(viewer, begun))["state"] == "done"
        body = {"controllers": TWO}
        assert (await viewer.post("/api/robots/mini-1/whatif", json=body)).status_code == 403
        path = "/api/robots/mini-1/whatif/shown"
        assert (await viewer.put(path, json={"id": None})).status_code == 403


async def test_a_result_waits_for_the_storage(client, monkeypatch):
    monkeypatch.setattr(study, "RETRY_S", 0.02)
    write, run, broken = Store.write, WorkerPool.run, asyncio.Event()

    async def failing(store, function):
        raise StoreUnavailableError("The disk is full.")

    async def held(pool, task, *told, **more):
        if task == WHATIF:
            await broken.wait()
        return await run(pool, task, *told, **more)

    monkeypatch.setattr(WorkerPool, "run", held)
    begun = await start(client)
    monkeypatch.setattr(Store, "write", failing)
    broken.set()

    async def waiting():
        job = (await client.get(f"/api/jobs/{begun['job']}")).json()
        return job["state"] == "running" and "disk is full" in job["message"]

    await until(waiting)
    monkeypatch.setattr(Store, "write", write)
    assert (await ended(client, begun))["result"] is not None


async def test_nothing_begins_while_the_storage_fails(client, station, monkeypatch):
    async def failing(store, function):
        raise StoreUnavailableError("The disk is full.")

    with monkeypatch.context() as broken:
        broken.setattr(Store, "write", failing)
        body = {"scenario": SHORT, "controllers": TWO}
        refused = await client.post("/api/robots/mini-1/whatif", json=body)
    assert refused.status_code == 503
    assert (await client.get("/api/robots/mini-1/whatifs")).json()["whatifs"] == []
    assert station.foundation.jobs.running == []


async def test_a_run_flies_in_the_current_that_dives_tell_of(client, station, world):
    mapped = SHORT | {"disturbance": {"current_source": "map"}, "duration_s": 60.0}
    body = {"scenario": mapped, "controllers": TWO}
    refused = await client.post("/api/robots/grace-1/whatif", json=body)
    assert refused.status_code == 422
    (error,) = refused.json()["errors"]
    assert error["loc"] == ["scenario", "disturbance", "current_source"]
    assert error["msg"].startswith("the map of the current tells too little yet")
    world.tell(state_report(GRACE, (200.0, 200.0, 0.0)))
    await until(lambda: station.fleet.status(GRACE).state)
    now_s = station.foundation.clock.now().timestamp()
    station.foundation.services.get(Currents).of(GRACE).known = told(8, now_s)
    found = await ended(client, await start(client, mapped, robot=GRACE))
    still = await ended(client, await start(client, mapped | {"disturbance": {}}, robot=GRACE))
    assert found["current_text"] == "Flown in the current that 8 dives tell of."
    assert still["current_text"] == ""
    north = [one["result"]["runs"][0]["north_m"][-1] for one in (found, still)]
    assert north[0] > north[1] + 0.5
