"""Quality of data by REST: rules run in a worker, people flag by hand, signed data stay."""

from datetime import UTC, datetime, timedelta

import pytest

from server.access.role import Role
from server.delivery.quality import run_of
from tests.server.conftest import MINI, api_client, until
from tests.server.deployment.shore import answered, sample_at


async def run(client, path):
    job = await answered(client.post(f"{path}/quality"), 202)

    async def ended():
        told = await answered(client.get(f"/api/jobs/{job['id']}"))
        return told["state"] not in ("queued", "running") and told

    told = await until(ended, timeout_s=240.0)
    assert told["state"] == "done", told["message"]
    return await answered(client.get(f"{path}/quality"))


async def test_a_run_flags_what_the_rules_do_not_believe_and_says_by_which(client, deployment):
    before = await answered(client.get(f"{deployment}/quality"))
    assert (before["run"], before["stretches"]) == (None, [])
    assert before["series"] == ["temperature", "position", "depth"]
    found = await run(client, deployment)
    assert (found["run"]["name"], found["run"]["version"]) == ("grace-qartod", "1.0.0")
    counts = found["run"]["counts"]["temperature"]
    assert (counts["range"]["fail"], counts["all"]["fail"]) == (1, 3)
    assert counts["spike"]["not_evaluated"] == 2
    bad = [one for one in found["stretches"] if one["series"] == "temperature" and one["flag"] == 4]
    assert [one["tests"] for one in bad] == [["spike"], ["range", "spike"], ["spike"]]
    assert found["run"]["counts"]["position"]["all"]["fail"] == 0
    assert not found["is_cut"]
    first = await answered(client.get(f"{deployment}/quality?limit=1"))
    assert (first["stretches"], first["is_cut"]) == (found["stretches"][:1], True)


async def test_a_chart_has_the_flags_of_the_rules_and_of_people(client, deployment):
    asked = f"/api/robots/{MINI}/samples?channel=temperature"
    ours = f"{asked}&deployment={deployment.rsplit('/', 1)[-1]}"
    assert (await answered(client.get(ours)))["flag"] is None, "nobody looked"
    found = await run(client, deployment)
    told = await answered(client.get(ours))
    assert sum(one == 4 for one in told["flag"]) == 3
    assert set(told["flag"]) == {1, 4}
    bad = [one for one in found["stretches"] if one["series"] == "temperature" and one["flag"] == 4]
    flagged = zip(told["measured_at"], told["flag"], strict=True)
    assert {at for at, flag in flagged if flag == 4} >= {one["first_at"] for one in bad}
    body = {
        "series": "temperature", "flag": 3, "reason": "A hand on the sensor",
        "first_at": told["measured_at"][0], "last_at": told["measured_at"][-1],
    }  # fmt: skip
    await answered(client.post(f"{deployment}/flags", json=body), 201)
    assert set((await answered(client.get(ours)))["flag"]) == {3}
    assert (await answered(client.get(asked)))["flag"] is None, "of no deployment in particular"


async def test_rules_of_a_robot_are_a_new_version_and_old_runs_stay(client, deployment):
    first = await run(client, deployment)
    rule = {
        "version": "1.0.1",
        "series": {
            "temperature": {
                "fail_high": None,
                "spike_fail": None,
                "suspect_high": None,
                "spike_suspect": None,
            }
        },
    }
    await answered(client.patch(f"/api/config/quality?robot={MINI}", json=rule))
    second = await run(client, deployment)
    assert second["run"]["version"] == "1.0.1"
    assert second["run"]["sha256"] != first["run"]["sha256"]
    before, after = (one["run"]["counts"]["temperature"] for one in (first, second))
    assert ("spike" in before, before["all"]["fail"]) == (True, 3)
    assert ("spike" in after, after["all"]["suspect"], after["all"]["fail"]) == (False, 0, 0)
    events = (await answered(client.get("/api/events")))["events"]
    told = [one["data"]["sha256"] for one in events if one["kind"] == "deployment.checked"]
    assert told == [first["run"]["sha256"], second["run"]["sha256"]]
    wrong = {"series": {"temperature": {"fail_low": 50.0, "fail_high": 40.0}}}
    await answered(client.patch(f"/api/config/quality?robot={MINI}", json=wrong), 422)


async def test_a_check_says_how_many_values_came_after_it(client, deployment, world, station):
    found = await run(client, deployment)
    assert found["run"]["came_after"] == 0
    at = datetime.now(UTC) - timedelta(minutes=25)
    world.tell(sample_at(MINI, at, 1000, "temperature"))
    station.ingest.flush()

    async def counted():
        told = await answered(client.get(f"{deployment}/quality"))
        return told["run"]["came_after"] == 1

    await until(counted)
    assert (await run(client, deployment))["run"]["came_after"] == 0


async def test_a_check_of_a_robot_that_is_back_sees_what_is_signed(client, deployment, station):
    name = deployment.rpartition("/")[2]

    async def is_smoothed():
        wanted = await station.foundation.store.query(lambda session: run_of(session, name, ""))
        return wanted.smoothed

    assert not await is_smoothed()
    await answered(client.post(f"{deployment}/end"))
    assert await is_smoothed()


async def test_a_person_flags_a_stretch_and_withdraws_it(client, deployment):
    at = datetime.now(UTC)
    said = {
        "series": "temperature",
        "first_at": (at - timedelta(minutes=45)).isoformat(),
        "last_at": (at - timedelta(minutes=35)).isoformat(),
        "flag": 4,
        "reason": "A hand on the sensor",
    }
    kept = await answered(client.post(f"{deployment}/flags", json=said), 201)
    (shown,) = (await answered(client.get(f"{deployment}/quality")))["manual"]
    assert (shown["id"], shown["reason"], shown["flag"]) == (kept["id"], said["reason"], 4)
    assert shown["by"]
    await answered(client.delete(f"{deployment}/flags/{kept['id']}"), 204)
    assert (await answered(client.get(f"{deployment}/quality")))["manual"] == []
    await answered(client.delete(f"{deployment}/flags/{kept['id']}"), 409)
    await answered(client.delete(f"{deployment}/flags/flag-99"), 404)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"series": "salinity"}, "series"),
        ({"first_at": "2001-01-01T00:00:00Z"}, "first_at"),
        ({"last_at": "2001-01-01T00:00:00Z"}, "last_at"),
        ({"flag": 5}, "flag"),
        ({"reason": " "}, "reason"),
    ],
)
async def test_a_flag_that_does_not_fit_names_its_field(client, deployment, change, field):
    at = (datetime.now(UTC) - timedelta(minutes=40)).isoformat()
    said = {"series": "depth", "first_at": at, "last_at": at, "flag": 3, "reason": "Mud"} | change
    refused = await answered(client.post(f"{deployment}/flags", json=said), 422)
    assert field in {one["loc"][-1] for one in refused["errors"]}


@pytest.mark.parametrize("late", ["first_at", "last_at"])
async def test_a_flag_beyond_the_end_names_which_of_its_times_is_wrong(client, deployment, late):
    await answered(client.post(f"{deployment}/end"))
    at, after = datetime.now(UTC) - timedelta(minutes=40), datetime.now(UTC) + timedelta(hours=1)
    said = {"series": "depth", "first_at": at.isoformat(), "flag": 3, "reason": "Mud"}
    said |= {"last_at": after.isoformat(), late: after.isoformat()}
    refused = await answered(client.post(f"{deployment}/flags", json=said), 422)
    wrong = {one["loc"][-1] for one in refused["errors"]}
    assert wrong == ({"last_at"} if late == "last_at" else {"first_at", "last_at"})


async def test_a_flag_may_begin_with_the_whole_second_that_screens_show(client, deployment):
    begun = (await answered(client.get(deployment)))["started_at"]
    assert "." in begun
    second = f"{begun[:19]}Z"
    said = {"series": "depth", "first_at": second, "last_at": begun, "flag": 3, "reason": "Mud"}
    kept = await answered(client.post(f"{deployment}/flags", json=said), 201)
    assert kept["first_at"][:19] == second[:19]


async def test_signed_data_take_no_flags_until_they_are_reopened(client, deployment):
    await answered(client.post(f"{deployment}/end"))
    await answered(client.post(f"{deployment}/review"))
    at = (datetime.now(UTC) - timedelta(minutes=40)).isoformat()
    said = {"series": "depth", "first_at": at, "last_at": at, "flag": 3, "reason": "Mud"}
    refused = await answered(client.post(f"{deployment}/flags", json=said), 409)
    assert "is reviewed; its flags are changed once it is reopened" in refused["detail"]
    await answered(client.post(f"{deployment}/reopen", json={"reason": "Mud"}))
    await answered(client.post(f"{deployment}/flags", json=said), 201)


async def test_what_has_not_begun_is_not_judged_and_a_viewer_only_looks(client, station):
    planned = await answered(client.post("/api/deployments", json={"robot": MINI}), 201)
    path = f"/api/deployments/{planned['id']}"
    await answered(client.post(f"{path}/quality"), 409)
    assert (await answered(client.get(f"{path}/quality")))["series"] == []
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get(f"{path}/quality")).status_code == 200
        assert (await viewer.post(f"{path}/quality")).status_code == 403
        assert (await viewer.post(f"{path}/flags", json={})).status_code in (403, 422)
