"""What was kept of robots that followed targets: listed and exported, by plan."""

import csv
import io
from datetime import datetime

import pytest

from autonomy.tracking.phase import TargetPhase
from robot_link.messages import OnboardPlanState
from tests.server.conftest import MINI
from tests.server.fake_link import state_report
from tests.server.target.test_tracking_plan import draft, plan_in, upload
from tests.server.target_reports import kept, now_report, tracking


async def test_every_report_is_kept_and_listed_the_oldest_first(client, world):
    reports = [now_report(age_s) for age_s in (3.0, 2.0, 1.0)]
    for report in reports:
        world.tell(report)
    found = await kept(client, 3)
    assert found["robot"] == "mini-1"
    assert found["plan_id"] is None
    moments = [datetime.fromisoformat(one["measured_at"]) for one in found["reports"]]
    assert moments == [one.measured_at for one in reports]
    newest = await tracking(client, limit=1)
    assert newest["reports"] == found["reports"][2:]
    rest = await tracking(client, after=found["reports"][0]["measured_at"], limit=1)
    assert rest["reports"] == found["reports"][1:2]


async def test_reports_of_one_plan_are_listed_and_exported_alone(client, world):
    world.tell(now_report(5.0, range_m=0.1))
    await kept(client, 1)
    world.robots[MINI].may_end.clear()
    plan = (await draft(client))["id"]
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    world.tell(now_report(range_m=0.2))
    everything = await kept(client, 2)
    assert everything["plan_id"] == plan
    mine = await tracking(client, plan=plan)
    assert [one["range_m"] for one in mine["reports"]] == [0.2]
    answer = await client.get("/api/robots/mini-1/tracking.csv", params={"plan": plan})
    assert len(answer.text.strip().splitlines()) == 4, "marks, columns, one report"


async def test_a_plan_that_never_began_has_no_reports(client, world):
    world.tell(now_report())
    await kept(client, 1)
    plan = (await draft(client))["id"]
    assert (await tracking(client, plan=plan))["reports"] == []
    assert (await tracking(client))["plan_id"] is None


async def test_bad_questions_are_answered_in_words(client):
    for asked, status, where in (
        ({"limit": 0}, 422, "limit"),
        ({"limit": 5001}, 422, "limit"),
        ({"after": "yesterday"}, 422, "after"),
    ):
        answer = await client.get("/api/robots/mini-1/tracking", params=asked)
        assert answer.status_code == status
        assert where in answer.json()["errors"][0]["loc"]
    for url in ("/api/robots/nobody/tracking", "/api/robots/nobody/tracking.csv"):
        assert (await client.get(url)).status_code == 404
    assert (
        await client.get("/api/robots/mini-1/tracking", params={"plan": "plan-99"})
    ).status_code == 404


async def test_export_has_a_column_for_every_number_and_says_that_it_is_simulated(client, world):
    report = now_report(1.0)
    world.tell(report)
    world.tell(now_report(range_m=None, true_ne_m=None, hypotheses=()))
    await kept(client, 2)
    answer = await client.get("/api/robots/mini-1/tracking.csv")
    assert answer.headers["content-type"].startswith("text/csv")
    assert "SIMULATION_mini-1" in answer.headers["content-disposition"]
    lines = answer.text.splitlines()
    assert lines[0] == "# SIMULATION: this robot does not exist"
    rows = list(csv.DictReader(io.StringIO("\n".join(lines[2:]))))
    first, second = rows
    assert float(first["time"]) == pytest.approx(report.measured_at.timestamp(), abs=1e-5)
    assert float(first["target2_weight"]) == 0.25
    assert float(first["determinant_m2_s"]) == report.determinant_m2_s
    assert (first["phase"], first["is_barrier_on"]) == ("tracking", "1")
    assert second["range_m"] == second["range_age_s"] == ""
    assert second["target1_north_m"] == second["true_north_m"] == ""
    assert (first["is_too_fast"], first["speed_class"], first["delay_s"]) == ("0", "", "")
    assert len(first) == len(second) == len(lines[2].split(","))


async def test_a_deployment_brings_it_too(client, world):
    world.tell(state_report(MINI))
    world.tell(now_report())
    await kept(client, 1)
    deployments = (await client.get("/api/deployments")).json()["deployments"]
    live = [one["id"] for one in deployments if one["robot"] == "mini-1"]
    url = f"/api/deployments/{live[0]}/export"
    answer = await client.get(url, params={"format": "tracking"})
    assert answer.status_code == 200
    assert "tracking.csv" in answer.headers["content-disposition"]
    assert len(answer.text.strip().splitlines()) == 4, "marks, columns, one report"


async def flown_to_its_end(client, world, end):
    """Fly a plan; return the newest words of it: live, listed, and as a row of the CSV."""
    fake = world.robots[MINI]
    fake.may_end.clear()
    plan = (await draft(client))["id"]
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    world.tell(now_report())
    rising = now_report(phase=TargetPhase.ENDED)
    world.tell(rising)
    before = (await kept(client, 2))["reports"][-1]
    assert (before["reason"], before["text"]) == ("", "mini-1 follows its target no longer.")
    end(fake)
    await plan_in(client, plan, "done", "failed")
    world.tell(now_report(phase=TargetPhase.ENDED))
    listed = (await kept(client, 3))["reports"]
    assert [one["reason"] for one in listed] == ["", *[listed[-1]["reason"]] * 2]
    live = (await client.get("/api/robots/mini-1/state")).json()["tracking"]
    answer = await client.get("/api/robots/mini-1/tracking.csv", params={"plan": plan})
    rows = list(csv.DictReader(io.StringIO("\n".join(answer.text.splitlines()[2:]))))
    return live, listed[-1], rows[-1]


async def test_a_mission_that_ended_early_says_why_wherever_its_end_is_shown(client, world):
    reason = 'the target was lost for 120 s, "or so"'
    found = await flown_to_its_end(client, world, lambda fake: fake.end_early(reason))
    assert {one["reason"] for one in found} == {reason}
    for shown in found[:2]:
        assert shown["text"] == f"mini-1 follows its target no longer: {reason}."


async def test_a_mission_that_lasted_says_that_its_time_is_over(client, world):
    found = await flown_to_its_end(client, world, lambda fake: fake.say(OnboardPlanState.DONE))
    assert {one["reason"] for one in found} == {"its time is over"}
