"""What is told of the current of a water: typed and from files, by REST, to the plan."""

import asyncio
from datetime import timedelta

import pytest

from autonomy.planner.config import PlannerConfig
from autonomy.planner.preset import planner_preset
from server.cli.main import main
from server.current.currents import Currents
from server.plan.flow import PlanFlows
from tests.autonomy.ocean import ocean
from tests.server.conftest import GRACE

pytestmark = pytest.mark.usefixtures("in_threads")
URL = "/api/waters/practice-lake/current"


async def read(client, path, name="model.nc"):
    """Import a file and return its job when that has ended."""
    answer = await client.post(f"{URL}/imports", files={"file": (name, path.read_bytes())})
    assert answer.status_code == 202, answer.text
    async with asyncio.timeout(120):
        while True:
            job = (await client.get(f"/api/jobs/{answer.json()['id']}")).json()
            if job["state"] not in {"queued", "running"}:
                return job
            await asyncio.sleep(0.02)


async def test_a_model_is_proposed_confirmed_used_and_taken_back(client, station, tmp_path):
    now = station.foundation.clock.now()
    path = ocean(tmp_path / "model.nc", start_s=now.timestamp() - 6 * 3600.0)
    job = await read(client, path)
    assert job["state"] == "done", job["message"]
    found = job["result"]
    assert (found["times"], found["source"], found["unknown_share"]) == (5, "Bay model", 0.0)
    assert (await client.get(URL)).json()["told"] is None
    made_at = (now - timedelta(hours=3)).isoformat()
    body = {"proposal": found["proposal"], "std_m_s": 0.02, "made_at": made_at}
    told = await client.put(URL, json=body)
    assert told.status_code == 200, told.text
    said = told.json()
    assert said["is_valid"]
    assert said["belief"] == pytest.approx(0.9)
    assert said["text"].startswith("Told: Bay model, made 3 h ago, valid until ")

    status = (await client.get(f"/api/robots/{GRACE}/current")).json()
    assert (status["is_usable"], status["dives"]) == (True, 0)
    assert status["told"].startswith("Told: Bay model, made 3 h ago")
    at = await client.get(f"/api/robots/{GRACE}/current/at", params={"north_m": 0, "east_m": 0})
    assert at.json()["velocity_ne_m_s"][0] == pytest.approx(0.1, abs=0.01)
    flow = (await client.get(f"/api/robots/{GRACE}/current/flow")).json()
    assert flow["is_tabulated"]
    assert all(arrow["is_told"] for arrow in flow["arrows"])
    config = PlannerConfig.model_validate(
        planner_preset("grace3", "lake").model_dump() | {"current": {"source": "map"}}
    )
    planned = await PlanFlows(station.foundation).planned(GRACE, config, 0.0)
    assert planned.text == "Planned in the current that Bay model tells of."
    assert planned.config.current.flow is not None
    # samples are not moved by a current that no dive bears out
    assert station.foundation.services.get(Currents).carrier(GRACE) is None

    assert (await client.delete(URL)).status_code == 204
    assert (await client.get(URL)).json()["text"] == "Nothing is told of the current of this water."
    assert not (await client.get(f"/api/robots/{GRACE}/current")).json()["is_usable"]


async def test_a_typed_profile_holds_for_its_time(client, station):
    now = station.foundation.clock.now()
    levels = [
        {"depth_m": 0.0, "north_m_s": 0.2, "east_m_s": 0.0},
        {"depth_m": 20.0, "north_m_s": 0.0, "east_m_s": 0.1},
    ]
    body = {"kind": "profile", "levels": levels, "source": "ADCP", "std_m_s": 0.02}
    past = {**body, "valid_until": (now - timedelta(hours=1)).isoformat()}
    told = (await client.put(URL, json=past)).json()
    assert not told["is_valid"]
    assert "not valid any more since" in told["text"]
    place = {"north_m": 0.0, "east_m": 0.0, "depth_m": 10.0}
    assert (await client.get(f"/api/robots/{GRACE}/current/at", params=place)).status_code == 409
    assert (await client.put(URL, json=body)).status_code == 200
    at = await client.get(f"/api/robots/{GRACE}/current/at", params=place)
    assert at.json()["velocity_ne_m_s"] == pytest.approx([0.1, 0.05], abs=0.01)


@pytest.mark.parametrize(
    ("body", "named"),
    [
        ({"kind": "constant"}, "a constant current has one level"),
        ({"kind": "profile", "levels": [{"depth_m": 1, "north_m_s": 0, "east_m_s": 0}]}, "two"),
        ({"proposal": "0123456789ab"}, "no such proposal"),
        ({"levels": [{"depth_m": 0, "north_m_s": 9.0, "east_m_s": 0}]}, "less than or equal to 3"),
    ],
)
async def test_what_cannot_be_is_refused_by_its_field(client, body, named):
    answer = await client.put(URL, json=body)
    assert answer.status_code == 422
    assert named in answer.text
    assert (await client.get(URL)).json()["told"] is None
    assert (await client.put("/api/waters/nowhere/current", json=body)).status_code in (404, 422)


async def test_a_wrong_file_is_refused_by_its_variable_and_nothing_is_kept(
    client, station, tmp_path
):
    job = await read(client, ocean(tmp_path / "model.nc", units="knots"))
    assert job["state"] == "failed"
    assert job["message"].startswith("model.nc: uo: is in 'knots'")
    assert not (station.foundation.settings.data_dir / "water_currents").exists()


def test_a_current_is_told_on_a_data_folder(tmp_path, capsys):
    path = ocean(tmp_path / "model.nc")
    water = ["water", "current", "practice-lake"]
    folder = ["--data", str(tmp_path)]
    assert main([*water, str(path), *folder]) == 1
    assert "say --yes" in capsys.readouterr().err
    assert main([*water, str(path), "--std", "0.05", "--yes", *folder]) == 0
    said = capsys.readouterr().out
    assert "5 times from 2026-09-21T" in said
    assert "Told: Bay model, made" in said
    assert "give or take 5 cm/s." in said
    assert main([*water, "--north", "0.2", *folder]) == 0
    assert capsys.readouterr().out == "Told: a typed current, give or take 10 cm/s.\n"
    assert main([*water, "--forget", *folder]) == 0
    assert capsys.readouterr().out == "Nothing is told of the current of this water.\n"
    assert main(["water", "current", "nowhere", *folder]) == 1
    broken = ocean(tmp_path / "broken.nc", units="knots")
    assert main([*water, str(broken), "--yes", *folder]) == 1
    assert "broken.nc: uo: is in 'knots'" in capsys.readouterr().err
