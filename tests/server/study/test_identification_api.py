"""Identifications by REST: begun on a recording, watched, called off, resumed, accepted."""

import asyncio
import re
import threading
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from sqlalchemy import update

from autonomy.identification.config import IdentificationConfig, NoiseLevels
from autonomy.identification.recording import Recording
from autonomy.vehicle.config import MINIGLIDER
from db.fault import StoreUnavailableError
from db.query.camera.fixes import FixRecord
from db.query.fleet.deployments import get_deployment
from db.query.mission import studies as query
from db.tables import Deployment
from robot_link.camera.fix import CameraFix
from robot_link.messages import RobotMode
from server.access.role import Role
from server.base.study import Refusal
from server.study import flight_recording, identification_task
from server.study.flight_recording import read_flight
from server.study.task import IdentificationProblem
from tests.autonomy.identification_flight import open_loop_recording
from tests.server.conftest import MINI, api_client, open_station, until
from tests.server.fake_link import state_report

pytestmark = pytest.mark.usefixtures("in_threads")

BEGIN = datetime(2026, 11, 20, 8, 0, tzinfo=UTC)
TRUTH = replace(MINIGLIDER, parameters=MINIGLIDER.parameters.model_copy(update={"drag_0": 2.6}))
DRAG = {
    name: name == "drag"
    for name in (
        "masses",
        "inertias",
        "sliding_mass",
        "offset_mass",
        "drag",
        "side_force",
        "lift",
        "roll_moment",
        "pitch_moment",
        "yaw_moment",
    )
}
QUICK = {
    "method": "least_squares",
    "model": "thesis",
    "descents": 6,
    "free": DRAG,
    "fits_offsets": False,
}
SLOW = {**QUICK, "method": "swarm", "particles": 40, "iterations": 2000, "polish": False}


def flown() -> Recording:
    """Return two short flights of a Miniglider with more drag than the catalogue's."""
    return open_loop_recording(
        TRUTH, np.random.default_rng(5), runs=2, duration_s=30.0, period_s=0.2, noise=NoiseLevels()
    )


@pytest.fixture(scope="module")
def recording() -> Recording:
    return flown()


@pytest.fixture
def go_on(monkeypatch) -> threading.Event:
    """While it is cleared, searches go no further than their third iteration."""
    go_on, run = threading.Event(), identification_task.run

    def held(task, report, is_cancelled):
        def report_and_wait(news):
            report(news)
            while news.iteration >= 3 and not go_on.wait(0.02) and not is_cancelled():
                pass

        return run(task, report_and_wait, is_cancelled)

    go_on.set()
    monkeypatch.setattr(identification_task, "run", held)
    return go_on


def reports(recording, **changes):
    for row in range(recording.time_s.size):
        at = BEGIN + timedelta(seconds=float(recording.time_s[row]))
        roll, pitch, heading = recording.attitude_rad[row].tolist()
        values = {
            "position_ned": tuple(recording.position_ned[row].tolist()),
            "position_std_m": float(recording.position_std_m[row]),
            "roll_rad": roll,
            "pitch_rad": pitch,
            "heading_rad": heading,
            "net_buoyancy_kg": float(recording.net_buoyancy_kg[row]),
            "mass_position_m": float(recording.mass_position_m[row]),
            "tail_rad": float(recording.tail_rad[row]),
            "mode": RobotMode.GLIDING,
            "has_fix": bool(recording.has_fix[row]),
        }
        yield state_report(MINI, at=at, **(values | changes))


async def deployed(station, recording, **changes):
    """Let the robot have flown, and return what begins an identification of that flight."""
    store = station.foundation.store
    await store.write(_redate)
    await asyncio.wrap_future(store.append(list(reports(recording, **changes))))
    return {"deployment": "deployment-1", "end": (BEGIN + timedelta(hours=1)).isoformat()}


def _redate(session):
    session.execute(update(Deployment).values(started_at=BEGIN))


async def start(client, body, config=QUICK):
    path = "/api/robots/mini-1/identifications"
    answer = await client.post(path, json={**body, "config": config})
    assert answer.status_code == 202, answer.text
    return named(answer)


def named(answer):
    """Return the ids of a search that was begun and of its job."""
    return {"id": answer.json()["about"], "job": answer.json()["id"]}


async def get(client, begun):
    return (await client.get(f"/api/identifications/{begun['id']}")).json()


async def ended(client, begun):
    async def has_ended():
        found = await get(client, begun)
        job = (await client.get(f"/api/jobs/{found['job'] or begun['job']}")).json()
        return None if "running" in {found["state"], job["state"]} else found

    return await until(has_ended)


async def checkpointed(client, begun):
    async def has_checkpoint():
        found = await get(client, begun)
        return found if found["has_checkpoint"] and len(found["convergence"]) > 1 else None

    return await until(has_checkpoint)


async def test_a_search_finds_what_differs_and_becomes_a_vehicle(client, station, recording):
    begun = await start(client, await deployed(station, recording))
    found = await ended(client, begun)
    assert found["state"] == "done", found["message"]
    assert (found["robot"], found["base_vehicle"]) == ("mini-1", "miniglider")
    assert found["data_start_at"] == "2026-11-20T08:00:00Z"
    result = found["result"]
    assert result["cost_after"] < 0.5 * result["cost_before"]
    drag = next(one for one in result["parameters"] if one["name"] == "drag_0")
    assert drag["after"] == pytest.approx(2.6, rel=0.05)
    assert [point["iteration"] for point in found["convergence"]] == sorted(
        {point["iteration"] for point in found["convergence"]}
    )
    job = (await client.get(f"/api/jobs/{begun['job']}")).json()
    assert job["result"] == {"identification": begun["id"]}

    accepted = await client.post(f"/api/identifications/{begun['id']}/accept", json={})
    assert accepted.status_code == 201
    assert accepted.json() == {
        "vehicle": "mini-1-identified",
        "offsets": [],
        "trim_advice": None,
        "trim_message": "identification-1 did not seek offsets of the actuators.",
    }
    vehicles = (await client.get("/api/vehicles")).json()["vehicles"]
    assert [(one["key"], one["origin"], one["robots"]) for one in vehicles][-1] == (
        "mini-1-identified",
        "identified",
        [],
    )
    document = (await client.get("/api/vehicles/mini-1-identified")).json()
    assert document["parameters"]["drag_0"]["value"] == drag["after"]
    assert document["note"] == "identified from deployment-1 by identification-1"
    changed = await client.patch("/api/robots/mini-1", json={"model": "mini-1-identified"})
    assert changed.json()["model_origin"] == "identified"
    again = await client.post(f"/api/identifications/{begun['id']}/accept", json={})
    assert again.status_code == 409
    assert "mini-1-identified" in again.json()["detail"]
    events = (await client.get("/api/events?after=0&limit=1000")).json()["events"]
    assert "identification.accepted" in {event["kind"] for event in events}


async def test_a_search_that_was_called_off_goes_on_to_the_same_result(
    client, station, recording, go_on
):
    body = await deployed(station, recording)
    config = {**SLOW, "iterations": 80, "particles": 10}
    straight = await ended(client, await start(client, body, config))
    go_on.clear()
    begun = await start(client, body, config)
    await checkpointed(client, begun)
    answer = await client.post(f"/api/identifications/{begun['id']}/cancel")
    assert answer.json()["state"] == "cancelled"
    go_on.set()
    resumed = await client.post(f"/api/identifications/{begun['id']}/resume")
    assert resumed.status_code == 202
    assert resumed.json()["id"] != begun["job"]
    found = await ended(client, begun)
    assert found["state"] == "done"
    assert found["result"] == straight["result"]
    assert found["convergence"] == straight["convergence"]


async def test_a_search_that_was_killed_with_the_station_is_interrupted(tmp_path, world, recording):
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        begun = await start(pilot, await deployed(station, recording), SLOW)
        await checkpointed(pilot, begun)
        # Nobody notes how it ended: so it looks in the database after SIGKILL.
        station.identifications._end = _keep_nothing
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        found = await get(pilot, begun)
        assert (found["state"], found["has_checkpoint"]) == ("interrupted", True)
        assert found["message"].startswith("The station stopped")
        assert (await pilot.get(f"/api/jobs/{begun['job']}")).json()["state"] != "running"


async def _keep_nothing(record, state, message):
    del record, state, message


async def test_a_search_converges_while_it_is_watched(client, station, recording):
    begun = await start(client, await deployed(station, recording), SLOW)
    first = await checkpointed(client, begun)

    async def longer():
        now = await get(client, begun)
        return now if len(now["convergence"]) > len(first["convergence"]) + 2 else None

    later = await until(longer)
    assert later["convergence"][: len(first["convergence"])] == first["convergence"]
    costs = [point["cost"] for point in later["convergence"]]
    assert costs == sorted(costs, reverse=True)
    (listed,) = (await client.get("/api/robots/mini-1/identifications")).json()["identifications"]
    assert (listed["state"], listed["method"]) == ("running", "swarm")
    assert 0.0 < listed["progress"] < 1.0
    job = (await client.get(f"/api/jobs/{begun['job']}")).json()
    assert 0.0 < job["progress"] < 1.0
    refused = await client.post(f"/api/identifications/{begun['id']}/resume")
    assert refused.status_code == 409
    await client.post(f"/api/identifications/{begun['id']}/cancel")
    assert (await client.post(f"/api/identifications/{begun['id']}/cancel")).status_code == 409
    assert (await client.post(f"/api/identifications/{begun['id']}/accept")).status_code == 409


async def test_checkpoints_that_cannot_be_kept_do_not_end_the_search(
    client, station, recording, monkeypatch, caplog
):
    def failing(*_, **__):
        raise StoreUnavailableError("The disk is full.")

    body = await deployed(station, recording)
    monkeypatch.setattr(query, "keep_checkpoint", failing)
    found = await ended(client, await start(client, body))
    assert found["state"] == "done"
    assert "The disk is full" in caplog.text


async def test_a_recording_without_actuators_is_refused_with_what_is_missing(client):
    rows = "\n".join(f"{1000 + second},43.9,10.1,{2 + second / 100},0.4" for second in range(60))
    csv = f"time,latitude,longitude,depth,chlorophyll\n{rows}\n"
    files = {"file": ("dive.csv", csv, "text/csv")}
    job = (await client.post("/api/imports", data={"robot": "eva"}, files=files)).json()["id"]
    await until(lambda: _done(client, job))
    await until(lambda: _known(client, "eva"))
    body = {"deployment": "deployment-3"}
    refused = await client.post("/api/robots/eva/identifications", json=body)
    assert refused.status_code == 409
    assert "PATCH /api/robots/eva" in refused.json()["detail"]
    await client.patch("/api/robots/eva", json={"model": "grace3"})
    refused = await client.post("/api/robots/eva/identifications", json=body)
    assert refused.status_code == 409
    missing = "roll, pitch, heading, net buoyancy, mass position and tail"
    assert f"has no record of {missing}" in refused.json()["detail"]


async def _done(client, job):
    return (await client.get(f"/api/jobs/{job}")).json()["state"] == "done"


async def _known(client, robot):
    return (await client.get(f"/api/robots/{robot}")).status_code == 200


async def test_an_imported_flight_can_be_identified(client, recording):
    header = (
        "time,latitude,longitude,depth,roll_deg,pitch_deg,heading_deg,net_buoyancy_g,"
        "mass_position_mm,tail_deg\n"
    )
    table = np.column_stack(
        [
            BEGIN.timestamp() + recording.time_s,
            np.full(recording.time_s.size, 43.9),
            np.full(recording.time_s.size, 10.1),
            recording.position_ned[:, 2],
            np.degrees(recording.attitude_rad),
            recording.net_buoyancy_kg * 1e3,
            recording.mass_position_m * 1e3,
            np.degrees(recording.tail_rad),
        ]
    )
    csv = header + "\n".join(",".join(repr(float(value)) for value in row) for row in table)
    files = {"file": ("flight.csv", csv, "text/csv")}
    job = (await client.post("/api/imports", data={"robot": "other"}, files=files)).json()["id"]
    await until(lambda: _done(client, job))
    await until(lambda: _known(client, "other"))
    await client.patch("/api/robots/other", json={"model": "miniglider"})
    body = {"deployment": "deployment-3", "config": QUICK}
    begun = named(await client.post("/api/robots/other/identifications", json=body))
    found = await ended(client, begun)
    assert found["state"] == "done", found["message"]
    drag = next(one for one in found["result"]["parameters"] if one["name"] == "drag_0")
    assert drag["after"] == pytest.approx(2.6, rel=0.05)


async def test_a_robot_that_spoke_at_the_surface_only_is_refused_in_words(
    client, station, recording
):
    body = await deployed(station, recording, position_ned=(0.0, 0.0, 0.0))
    refused = await client.post("/api/robots/mini-1/identifications", json=body)
    assert refused.status_code == 409
    assert "no report from under water" in refused.json()["detail"]


async def test_what_cannot_be_asked_is_refused_at_its_field(client, station, recording):
    body = await deployed(station, recording)
    path = "/api/robots/mini-1/identifications"
    cases = (
        ({**body, "config": {"particles": 1}}, 422, ["config", "particles"]),
        ({**body, "config": {"free": {"wings": True}}}, 422, ["config", "free", "wings"]),
        ({**body, "deployment": "deployment-2"}, 422, ["deployment"]),
        ({**body, "start": body["end"]}, 422, ["end"]),
        ({**body, "start": "yesterday"}, 422, ["start"]),
        ({"config": {}}, 422, ["deployment"]),
        ({**body, "deployment": "deployment-9"}, 404, None),
        ({**body, "end": "2026-11-20T08:00:00Z", "start": "2020-01-01T00:00:00Z"}, 202, None),
        ({**body, "end": "2020-02-01T00:00:00Z", "start": "2020-01-01T00:00:00Z"}, 409, None),
    )
    for wrong, status, loc in cases:
        refused = await client.post(path, json=wrong)
        assert refused.status_code == status, (wrong, refused.text)
        if loc is not None:
            assert refused.json()["errors"][0]["loc"] == loc


async def test_positions_by_cameras_take_the_place_of_dead_reckoning(client, station, recording):
    body = await deployed(station, recording, has_fix=False)
    asked = {**body, "config": {**QUICK, "by_cameras": True}}
    path = "/api/robots/mini-1/identifications"
    answer = await client.post(path, json=asked)
    assert answer.status_code == 409
    assert "Cameras saw mini-1 0 times" in answer.json()["detail"]
    seen = [
        FixRecord(camera_fix(BEGIN + timedelta(seconds=float(at)), place), BEGIN, None)
        for at, place in zip(recording.time_s[:140], recording.position_ned[:140], strict=True)
    ]
    store = station.foundation.store
    await asyncio.wrap_future(store.append(seen))
    deployment = await store.query(lambda session: get_deployment(session, "deployment-1"))
    flight = await read_flight(store, deployment, BEGIN, None, by_cameras=True)
    found = flight.recording()
    assert found.has_fix[:139].all()
    assert not found.has_fix[141:].any()
    assert found.position_std_m[:139] == pytest.approx(np.full(139, 0.002))
    begun = await client.post(path, json=asked)
    assert begun.status_code == 202, begun.text
    await ended(client, named(begun))


def camera_fix(at, place):
    return CameraFix(
        robot=MINI,
        measured_at=at,
        ned_m=tuple(place.tolist()),
        covariance_m2=(4e-6, 0.0, 0.0, 4e-6, 0.0, 4e-6),
        considered_covariance_m2=(3e-6, 0.0, 0.0, 3e-6, 0.0, 3e-6),
        heading_rad=0.5,
        heading_std_rad=0.004,
        roll_rad=0.0,
        pitch_rad=-0.3,
        tilt_std_rad=0.01,
        cameras=("tank-1", "tank-2"),
        tags=(0, 2),
        rms=1.1,
        quality="good",
        reason="",
        calibration=None,
    )


async def test_too_little_to_identify_is_said_by_the_job(client, station, recording):
    body = await deployed(station, recording)
    body["end"] = (BEGIN + timedelta(seconds=3)).isoformat()
    begun = await start(client, body)
    found = await ended(client, begun)
    assert found["state"] == "failed"
    assert found["message"]
    assert (await client.get(f"/api/jobs/{begun['job']}")).json()["message"] == found["message"]


async def test_a_viewer_watches_a_search_but_begins_none(client, station, recording):
    begun = await start(client, await deployed(station, recording))
    async with api_client(station, Role.VIEWER) as viewer:
        await ended(viewer, begun)
        body = {"deployment": "deployment-1"}
        path = "/api/robots/mini-1/identifications"
        assert (await viewer.post(path, json=body)).status_code == 403
        for verb in ("cancel", "resume", "accept"):
            path = f"/api/identifications/{begun['id']}/{verb}"
            assert (await viewer.post(path)).status_code == 403


async def test_an_accepted_vehicle_has_the_key_and_title_that_were_asked_for(
    client, station, recording
):
    begun = await start(client, await deployed(station, recording))
    await ended(client, begun)
    path = f"/api/identifications/{begun['id']}/accept"
    assert (await client.post(path, json={"key": "Bad Key"})).status_code == 422
    assert (await client.post(path, json={"key": "miniglider"})).status_code == 409
    assert (await get(client, begun))["vehicle"] is None
    accepted = await client.post(path, json={"key": "mini-c", "title": "Refitted"})
    assert accepted.json()["vehicle"] == "mini-c"
    assert (await get(client, begun))["vehicle"] == "mini-c"
    assert (await client.get("/api/vehicles/mini-c")).json()["title"] == "Refitted"


def test_a_checkpoint_of_another_recording_is_refused(recording):
    config = identification_config()
    kept = []
    problem = IdentificationProblem(MINIGLIDER, recording, config, None)
    identification_task.run(problem, kept.append, lambda: False)
    checkpoint = next(news.checkpoint for news in kept if news.checkpoint is not None)
    other = recording.taken(np.arange(recording.time_s.size - 5))
    refusal = identification_task.run(
        IdentificationProblem(MINIGLIDER, other, config, checkpoint), kept.append, lambda: False
    )
    assert isinstance(refusal, Refusal)
    assert "another recording" in refusal.message


def test_a_search_that_is_cancelled_at_once_says_so(recording):
    problem = IdentificationProblem(MINIGLIDER, recording, identification_config(), None)
    found = identification_task.run(problem, lambda news: None, lambda: True)
    assert found == Refusal("The identification was cancelled.")


def identification_config():
    return IdentificationConfig.model_validate(QUICK)


async def test_a_recording_that_is_too_long_is_refused_with_what_to_name(
    client, station, recording, monkeypatch
):
    body = await deployed(station, recording)
    monkeypatch.setattr(flight_recording, "ROWS_MAX", 100)
    path = "/api/robots/mini-1/identifications"
    refused = await client.post(path, json=body)
    assert refused.status_code == 409
    detail = refused.json()["detail"]
    assert "more than 100 state reports" in detail
    begin, end = re.search(r"such as (\S+) and (\S+)\.", detail).groups()
    assert begin == "2026-11-20T08:00:00Z"
    begun = await start(client, {"deployment": body["deployment"], "start": begin, "end": end})
    assert (await ended(client, begun))["state"] == "done"
