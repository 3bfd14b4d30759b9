"""Surveys that are refused at once, in words, and the settings that plans are made with."""

import sqlite3

from tests.server.conftest import GRACE, MINI, until
from tests.server.fake_link import state_report


async def test_robot_that_was_never_heard_cannot_be_planned_for(client):
    refused = await client.post(f"/api/robots/{GRACE}/missions", json={"kind": "adaptive_survey"})
    assert refused.status_code == 409
    assert "has not said where it is" in refused.json()["detail"]


async def test_robot_outside_its_domain_is_refused_in_words(client, world):
    world.tell(state_report(MINI, (3.5, 2.1, 0.0)))
    little = {"total_budget": 4.0, "round_budget": 2.0}
    refused = await client.post(
        "/api/robots/mini-1/plans", json={"kind": "adaptive_survey", "config": little}
    )
    assert refused.status_code == 409
    assert "outside the domain" in refused.json()["detail"]


async def test_settings_outside_their_schema_are_named_by_their_path(client):
    refused = await client.post(
        "/api/robots/mini-1/plans",
        json={"kind": "adaptive_survey", "config": {"primitives": {"glide_speed_m_s": -1}}},
    )
    assert refused.status_code == 422
    loc = ["config", "primitives", "glide_speed_m_s"]
    assert [error["loc"] for error in refused.json()["errors"]] == [loc]


async def test_domain_outside_the_water_is_refused(client):
    refused = await client.post(
        "/api/robots/mini-1/missions",
        json={"kind": "adaptive_survey", "config": {"domain": {"depth_max_m": 2.0}}},
    )
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["loc"] == ["config", "domain"]
    assert "tank floor 1.2 m" in refused.json()["errors"][0]["msg"]


async def test_plan_cites_the_version_of_the_settings_it_was_made_with(client):
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, 0.5]}]}
    plans = [
        (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"] for _ in range(2)
    ]
    body["config"] = {"max_uncertainty_m": 0.2}
    plans.append((await client.post("/api/robots/mini-1/plans", json=body)).json()["id"])
    cited = [(await client.get(f"/api/plans/{plan}")).json()["config_id"] for plan in plans]
    assert cited[0] == cited[1] != cited[2]
    version = (await client.get(f"/api/config/versions/{cited[2]}")).json()
    assert version["value"]["max_uncertainty_m"] == 0.2


async def test_no_plan_is_accepted_while_storage_fails(client, station, tmp_path):
    other = sqlite3.connect(tmp_path / "station.sqlite3", timeout=60, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, 0.5]}]}
    refused = await client.post("/api/robots/mini-1/plans", json=body)
    assert refused.status_code == 503
    # The fault is known now, so that the next one is refused before anything is tried.
    again = await client.post("/api/robots/mini-1/plans", json=body)
    assert again.status_code == 503
    assert again.json()["detail"].startswith("The database stayed locked for 1 s.")

    async def alarm():
        alarms = (await client.get("/api/alarms")).json()["alarms"]
        return [one["level"] for one in alarms if "locked" in one["text"]] == ["critical"]

    await until(alarm)
    other.execute("ROLLBACK")
    other.close()

    async def accepted():
        return (await client.post("/api/robots/mini-1/plans", json=body)).status_code == 202

    await until(accepted)
