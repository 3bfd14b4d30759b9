"""Trim advice by REST: worked out of recorded dives, accepted by a person in steps."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.vehicle.config import MINIGLIDER
from autonomy.vehicle.parameter_file import vehicle_document
from autonomy.vehicle.trim import TrimConfig
from db.fault import StoreUnavailableError
from db.query.measured.state_columns import state_columns
from db.query.mission import studies as query
from server.access.role import Role
from server.study import flight_recording, trim
from server.study.trim import in_words
from tests.autonomy.identification_flight import open_loop_recording
from tests.server.conftest import api_client, until
from tests.server.study.test_identification_api import BEGIN, deployed

pytestmark = pytest.mark.usefixtures("in_threads")

BIAS_KG = 0.003
ACCEPT = "/api/robots/mini-1/trim/accept"


@pytest.fixture(scope="module")
def recording():
    """A Miniglider that is 3 g lighter than its pump believes."""
    return open_loop_recording(
        MINIGLIDER,
        np.random.default_rng(3),
        runs=2,
        duration_s=40.0,
        period_s=0.2,
        net_buoyancy_bias_kg=BIAS_KG,
        extended=True,
    )


async def advised(client, body=None):
    answer = await client.post("/api/robots/mini-1/trim/advice", json=body or {})
    assert answer.status_code == 202, answer.text
    job = answer.json()["id"]

    async def has_ended():
        found = (await client.get(f"/api/jobs/{job}")).json()
        return None if found["state"] in {"queued", "running"} else found

    return await until(has_ended)


@pytest.fixture
async def advice(client, station, recording):
    await deployed(station, recording)
    job = await advised(client, {"deployment": "deployment-1"})
    assert job["state"] == "done", job["message"]
    return job["result"]


async def trim_of(client):
    return (await client.get("/api/config/trim?robot=mini-1")).json()


async def test_advice_finds_the_error_and_changes_nothing_by_itself(client, advice):
    assert advice["id"] == "advice-1"
    assert advice["net_buoyancy_offset_kg"] == pytest.approx(BIAS_KG, abs=0.0006)
    assert advice["rmse_proposed"]["depth_rate_m_s"] < advice["rmse_now"]["depth_rate_m_s"]
    assert advice["is_worth_it"]
    assert (await trim_of(client))["id"] is None


async def test_half_a_step_becomes_the_trim_with_an_event_that_names_who_took_it(client, advice):
    answer = await client.post(ACCEPT, json={"advice": advice["id"], "share": 0.5})
    assert answer.status_code == 200
    accepted, half = answer.json(), advice["half_step"]
    assert accepted["net_buoyancy_offset_kg"] == half["net_buoyancy_offset_kg"]
    assert half["net_buoyancy_offset_kg"] == pytest.approx(BIAS_KG / 2.0, abs=0.0004)
    assert accepted["reaches_robot"] == "It reaches mini-1 with the next plan."
    held = await trim_of(client)
    assert (held["id"], held["value"]) == (accepted["config_id"], half)
    events = (await client.get("/api/events?after=0&limit=1000")).json()["events"]
    (event,) = [event for event in events if event["kind"] == "trim.accepted"]
    assert event["text"].startswith("test admin accepted half a trim step for mini-1: net buoy")
    assert event["data"]["advice"] == advice["id"]


async def test_a_draft_of_before_is_said_to_have_the_old_trim(client, advice):
    legs = [{"kind": "dive", "end_ned": [0, 0, depth]} for depth in (0.5, 0)]
    body = {"kind": "primitives", "legs": legs}
    plan = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    answer = await client.post(ACCEPT, json={"advice": advice["id"], "share": 1.0})
    assert f"the draft {plan} has the old trim" in answer.json()["reaches_robot"]
    assert (await trim_of(client))["value"] == advice["full_step"]


async def test_a_plan_on_board_is_said_to_keep_its_trim(client, advice):
    legs = [{"kind": "dive", "end_ned": [0, 0, depth]} for depth in (0.5, 0)]
    body = {"kind": "primitives", "legs": legs}
    plan = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    await client.post(f"/api/plans/{plan}/upload", json={})

    async def on_board():
        return (await client.get(f"/api/plans/{plan}")).json()["state"] == "on_board"

    await until(on_board)
    answer = await client.post(ACCEPT, json={"advice": advice["id"]})
    assert f"{plan}, which is on board, keeps the trim" in answer.json()["reaches_robot"]


async def test_advice_is_taken_once(client, advice):
    assert (await client.post(ACCEPT, json={"advice": advice["id"]})).status_code == 200
    refused = await client.post(ACCEPT, json={"advice": advice["id"]})
    assert refused.status_code == 409
    assert "test admin accepted advice-1 already" in refused.json()["detail"]


async def test_advice_for_another_trim_than_the_present_is_refused(client, advice):
    change = {"net_buoyancy_offset_kg": 0.001}
    await client.patch("/api/config/trim?robot=mini-1", json=change)
    refused = await client.post(ACCEPT, json={"advice": advice["id"]})
    assert refused.status_code == 409
    assert "changed since advice-1" in refused.json()["detail"]
    held = (await trim_of(client))["value"]
    assert held["net_buoyancy_offset_kg"] == 0.001


async def test_advice_for_another_vehicle_than_the_present_is_refused(client, advice):
    other = {**vehicle_document(MINIGLIDER), "key": "mini-b"}
    assert (await client.post("/api/vehicles", json=other)).status_code == 201
    await client.patch("/api/robots/mini-1", json={"model": "mini-b"})
    refused = await client.post(ACCEPT, json={"advice": advice["id"]})
    assert refused.status_code == 409
    assert "for the vehicle miniglider, which mini-1 is not now" in refused.json()["detail"]
    assert (await trim_of(client))["id"] is None
    await client.patch("/api/robots/mini-1", json={"model": "miniglider"})
    assert (await client.post(ACCEPT, json={"advice": advice["id"]})).status_code == 200


async def test_a_trim_that_no_plan_could_hold_is_refused(client, advice, monkeypatch):
    monkeypatch.setattr(trim, "trim_flaw", lambda *_: "the trim is beyond the travel")
    refused = await client.post(ACCEPT, json={"advice": advice["id"]})
    assert refused.status_code == 409
    assert "No plan could hold this: the trim is beyond" in refused.json()["detail"]


async def test_an_acceptance_that_cannot_be_kept_changes_nothing(client, advice, monkeypatch):
    def failing(*_, **__):
        raise StoreUnavailableError("The disk is full.")

    with monkeypatch.context() as broken:
        broken.setattr(query, "use_study", failing)
        refused = await client.post(ACCEPT, json={"advice": advice["id"]})
    assert refused.status_code == 503
    assert (await trim_of(client))["id"] is None
    assert (await client.post(ACCEPT, json={"advice": advice["id"]})).status_code == 200


async def test_what_cannot_be_accepted_is_refused(client, advice, station):
    cases = (
        ("mini-1", {"advice": advice["id"], "share": 0.7}, 422),
        ("mini-1", {"advice": advice["id"], "part": 1}, 422),
        ("mini-1", {"advice": "advice-9"}, 404),
        ("mini-1", {"advice": "whatif-1"}, 404),
        ("grace-1", {"advice": advice["id"]}, 404),
        ("nobody", {"advice": advice["id"]}, 404),
    )
    for robot, body, status in cases:
        refused = await client.post(f"/api/robots/{robot}/trim/accept", json=body)
        assert refused.status_code == status, body
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.post(ACCEPT, json={"advice": advice["id"]})).status_code == 403
        path = "/api/robots/mini-1/trim/advice"
        assert (await viewer.post(path, json={})).status_code == 403


async def test_too_little_gliding_is_said_by_the_job(client, station, recording):
    await deployed(station, recording.taken(np.arange(40)))
    job = await advised(client, {"deployment": "deployment-1"})
    assert job["state"] == "failed"
    assert "gliding" in job["message"]


async def test_a_robot_that_was_never_under_water_gets_no_advice(client):
    for robot, status, words in (
        ("grace-1", 409, "has no state report"),
        ("nobody", 404, "no robot"),
    ):
        refused = await client.post(f"/api/robots/{robot}/trim/advice", json={})
        assert refused.status_code == status
        assert words in refused.json()["detail"]
    other = {"deployment": "deployment-2"}
    refused = await client.post("/api/robots/mini-1/trim/advice", json=other)
    assert refused.status_code == 422


def test_a_trim_is_told_in_the_units_of_pilots():
    trim = TrimConfig(net_buoyancy_offset_kg=-0.0024, mass_position_offset_m=0.0011)
    assert in_words(trim) == "net buoyancy -2.4 g, mass position +1.1 mm"


async def test_only_the_last_dives_are_read(client, station, recording, monkeypatch):
    between = (recording.time_s > 38.0) & (recording.time_s < 42.0)
    position_ned = np.where(between[:, None], 0.0, recording.position_ned)
    await deployed(station, replace(recording, position_ned=position_ned))
    read = []

    def spied(session, robot, start, *rest, **limits):
        read.append(start)
        return state_columns(session, robot, start, *rest, **limits)

    monkeypatch.setattr(flight_recording, "state_columns", spied)
    await advised(client, {"deployment": "deployment-1", "dives": 1})
    await advised(client, {"deployment": "deployment-1", "dives": 2})
    at_s = [(start - BEGIN).total_seconds() for start in read]
    assert at_s == [50.0, 0.0]


async def test_a_robot_that_dived_for_too_long_is_advised_by_its_newest_reports(
    client, station, recording, monkeypatch
):
    await deployed(station, recording)
    monkeypatch.setattr(flight_recording, "ROWS_MAX", 300)
    job = await advised(client, {"deployment": "deployment-1"})
    assert job["state"] == "done", job["message"]
