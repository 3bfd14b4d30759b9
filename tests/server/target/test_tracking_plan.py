"""Plans that follow a target, from the request to what the robot says of its end."""

import sqlite3
from datetime import timedelta

import pytest

from autonomy.tracking.config import TRACKING_PRESETS, TrackingConfig
from db.query.mission.plans import get_plan
from robot_link.messages import CommandKind, LinkState, OnboardPlanState, RobotMode
from robot_link.mission import TARGET_FORMAT
from robot_link.target_settings import TargetSettings
from server.plan.document import mission_of
from server.plan.target_check import outdated_target
from tests.server.conftest import GRACE, MINI, open_station, until
from tests.server.fake_link import current_report, state_report
from tests.server.transfer.test_upload import plan_in, transfer_in, upload

PRESET = TRACKING_PRESETS["miniglider"]


async def ask(client, config=None, robot=MINI):
    body = {"kind": "track_target", "config": config or {}}
    return await client.post(f"/api/robots/{robot}/plans", json=body)


async def draft(client, config=None, robot=MINI):
    answer = await ask(client, config, robot)
    assert answer.status_code == 202, answer.text
    return (await client.get(f"/api/plans/{answer.json()['id']}")).json()


async def test_it_is_a_draft_at_once_with_settings_account_and_hash(client):
    found = await draft(client, {"motion": {"duration_s": 300.0}})
    assert (found["state"], found["kind"]) == ("draft", "track_target")
    motion = PRESET.motion.model_copy(update={"duration_s": 300.0})
    travels = TargetSettings.of(PRESET.model_copy(update={"motion": motion})).config()
    assert found["tracking"] == found["config"] == travels.model_dump(mode="json")
    assert found["violations"] == found["warnings"] == []
    assert found["legs"] == found["points"] == []
    assert found["account"]["duration_s"] == 300.0
    assert found["account"]["energy"] > 0.0
    assert len(found["sha256"]) == 64
    assert found["ladder"]["draft_at"] is not None
    assert found["message"] == "It follows a virtual target for 300 s, at the surface."


async def test_it_has_no_legs_to_rehearse(client):
    found = await draft(client)
    refused = await client.post(f"/api/plans/{found['id']}/rehearse")
    assert refused.status_code == 409
    assert "no draft with legs" in refused.json()["detail"]


async def test_path_of_a_virtual_target_lasts_as_long_as_the_mission(client):
    target = {"path": "line", "speed_m_s": 0.001, "north_m": 1.0, "east_m": 0.5}
    found = await draft(client, {"target": target, "motion": {"duration_s": 200.0}})
    path = found["target_path"]
    assert path[0] == [0.0, 1.0, 0.5]
    assert path[-1] == pytest.approx([200.0, 1.2, 0.5])
    beacon = await draft(client, {"target": {"kind": "beacon"}})
    assert beacon["target_path"] == []


async def test_what_travels_says_what_the_plan_says(client, station):
    found = await draft(client, {"barrier": {"slope": 0.5}})
    mission = mission_of(await station.plans.get(found["id"]))
    assert mission.format == TARGET_FORMAT
    assert mission.sha256() == found["sha256"]
    assert mission.legs == ()
    assert mission.tracking.config().barrier.slope == 0.5
    assert (mission.settings.start_x_m, mission.settings.start_y_m) == (1.2, 0.6)
    assert mission.settings.timeout_s > found["account"]["duration_s"]


async def test_settings_that_differ_are_kept_as_a_version_that_the_plan_cites(client):
    first = await draft(client, {"barrier": {"slope": 0.5}})
    kept = (await client.get("/api/config/tracking", params={"robot": MINI})).json()
    assert kept["id"] == first["config_id"]
    assert kept["value"]["barrier"]["slope"] == 0.5
    assert kept["reach"] == "mission"
    again = await draft(client)
    assert again["config_id"] == first["config_id"]
    assert again["tracking"]["barrier"]["slope"] == 0.5


async def test_the_schema_describes_every_field(client):
    schema = (await client.get("/api/config/tracking/schema")).json()
    fields = [field for group in schema["$defs"].values() for field in group["properties"].values()]
    assert len(fields) > 30
    assert all(field["title"] and field["description"] for field in fields)


@pytest.mark.parametrize(
    ("config", "path", "limit"),
    [
        ({"motion": {"duration_s": 0}}, ["motion", "duration_s"], "greater than 0"),
        ({"ranging": {"period_s": 0.01}}, ["ranging", "period_s"], "0.05"),
        ({"target": {"path": "spiral"}}, ["target", "path"], "circle"),
        ({"barrier": {"epsilon": "much"}}, ["barrier", "epsilon"], "number"),
        ({"sonar": 1}, ["sonar"], "no such field"),
        ({"ranging": {"lost_after_s": 1.0}}, ["ranging"], "must ascend"),
    ],
)
async def test_a_wrong_field_is_named_with_its_limit(client, config, path, limit):
    answer = await ask(client, config)
    assert answer.status_code == 422
    error = answer.json()["errors"][0]
    assert error["loc"] == ["config", *path]
    assert limit in error["msg"]
    assert (await client.get("/api/robots/mini-1/plans")).json() == []


async def test_settings_that_cannot_travel_are_refused_and_not_kept(client):
    before = (await client.get("/api/config/tracking", params={"robot": MINI})).json()
    answer = await ask(client, {"target": {"north_m": 16778.0}})
    assert answer.status_code == 409
    assert "target.north_m: 16778 cannot travel" in answer.json()["detail"]
    assert (await client.get("/api/config/tracking", params={"robot": MINI})).json() == before
    assert (await ask(client)).status_code == 202


async def test_two_plans_of_the_same_settings_have_different_names(client):
    first, second = await draft(client), await draft(client)
    assert first["tracking"] == second["tracking"]
    assert first["sha256"] != second["sha256"]


async def test_it_goes_the_road_of_every_plan_to_its_end(client, world):
    world.robots[MINI].may_end.clear()
    plan = (await draft(client))["id"]
    transfer = (await upload(client, plan, start=True)).json()["id"]
    running = await plan_in(client, plan, "running")
    assert world.uploads == [(MINI, running["sha256"])]
    assert world.robots[MINI].plan.tracking.config() == TrackingConfig(**running["tracking"])
    done = await transfer_in(client, transfer, "running")
    assert done["items"] > 1
    assert [kind for _, kind, _ in world.commands] == [CommandKind.START]
    world.robots[MINI].may_end.set()
    ended = await plan_in(client, plan, "done")
    ladder = ended["ladder"]
    assert ladder["draft_at"] < ladder["on_board_at"] < ladder["running_at"] < ladder["ended_at"]


async def test_it_fails_with_the_robots_own_sentence(client, world):
    world.robots[MINI].may_end.clear()
    plan = (await draft(client))["id"]
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    world.robots[MINI].end_early("the target was lost for 120 s")
    found = await plan_in(client, plan, "failed")
    assert found["message"] == "mini-1 ended plan-1 early: the target was lost for 120 s"


async def test_a_plan_that_breaks_a_limit_is_not_sent(client, world):
    found = await draft(client, {"target": {"north_m": 40.0}})
    assert [one["field"] for one in found["violations"]] == ["target.north_m"]
    answer = await upload(client, found["id"])
    assert answer.status_code == 409
    assert answer.json()["errors"][0]["loc"] == ["target.north_m"]
    assert world.uploads == []


async def test_teaching_is_marked_and_may_be_sent_all_the_same(client):
    found = await draft(client, {"barrier": {"controller": "nominal"}})
    assert found["violations"] == []
    assert [one["field"] for one in found["warnings"]] == ["teaching"]
    assert "diverge" in found["warnings"][0]["message"]
    await upload(client, found["id"])
    await plan_in(client, found["id"], "on_board")


async def test_the_page_of_plans_the_log_and_the_status_line_say_that_it_teaches(client, world):
    world.robots[MINI].may_end.clear()
    found = await draft(client, {"barrier": {"controller": "nominal"}})
    assert found["message"].endswith("at the surface (teaching: barrier off).")
    await upload(client, found["id"], start=True)
    await plan_in(client, found["id"], "running")
    events = (await client.get("/api/events", params={"limit": 200})).json()["events"]
    texts = [one["text"] for one in events]
    assert f"mini-1 flies {found['id']} (teaching: barrier off)." in texts


@pytest.mark.parametrize("config", [{}, {"barrier": {"slope": 0.4}}, {"target": {"depth_m": 0.1}}])
async def test_nobody_inherits_the_teaching_mode_of_the_plan_before(client, config):
    await draft(client, {"barrier": {"controller": "nominal", "epsilon": 0.002}})
    found = await draft(client, config)
    assert found["tracking"]["barrier"]["controller"] == "barrier"
    assert found["tracking"]["barrier"]["epsilon"] == 0.002, "all else is inherited"
    assert found["warnings"] == []
    kept = (await client.get("/api/config/tracking", params={"robot": MINI})).json()
    assert kept["id"] == found["config_id"]
    assert kept["value"]["barrier"]["controller"] == "barrier"


async def test_other_controllers_are_inherited_and_teaching_may_be_asked_for_again(client):
    await draft(client, {"barrier": {"controller": "mpc_condition"}})
    assert (await draft(client))["tracking"]["barrier"]["controller"] == "mpc_condition"
    teaching = {"barrier": {"controller": "nominal"}}
    for _ in range(2):
        assert (await draft(client, teaching))["tracking"]["barrier"]["controller"] == "nominal"
    wrong = await ask(client, {"barrier": 3})
    assert wrong.status_code == 422
    assert wrong.json()["errors"][0]["loc"][:2] == ["config", "barrier"]


async def test_what_was_kept_from_plans_before_is_said_and_can_be_left_behind(client):
    first = await draft(client, {"barrier": {"alpha": "negative"}, "motion": {"duration_s": 300.0}})
    assert first["inherited"] == []
    second = await draft(client, {"motion": {"duration_s": 300.0}})
    usual = PRESET.barrier.alpha
    kept = {"field": "barrier.alpha", "value": "negative", "usual": usual}
    assert second["inherited"] == [kept]
    body = {"kind": "track_target", "base": "preset", "config": {"barrier": {"slope": 0.3}}}
    answer = await client.post(f"/api/robots/{MINI}/plans", json=body)
    third = (await client.get(f"/api/plans/{answer.json()['id']}")).json()
    assert third["inherited"] == []
    assert third["tracking"]["barrier"]["alpha"] == usual
    assert third["tracking"]["motion"]["duration_s"] == PRESET.motion.duration_s
    assert third["tracking"]["barrier"]["slope"] == 0.3
    wrong = {**body, "config": {"barrier": {"slope": 0.0}}}
    refused = await client.post(f"/api/robots/{MINI}/plans", json=wrong)
    assert refused.json()["errors"][0]["loc"] == ["config", "barrier", "slope"]


@pytest.mark.parametrize(
    ("controller", "teaches"), [("nominal", True), ("mpc_none", False), ("barrier", False)]
)
async def test_the_station_says_whether_a_plan_teaches(client, controller, teaches):
    found = await draft(client, {"barrier": {"controller": controller}})
    assert found["teaches"] is teaches
    (summary,) = (await client.get("/api/robots/mini-1/plans")).json()
    assert summary["teaches"] is teaches


async def test_a_draft_that_waits_behind_a_flight_is_listed(client, world):
    world.robots[MINI].may_end.clear()
    flown = (await draft(client))["id"]
    await upload(client, flown, start=True)
    await plan_in(client, flown, "running")
    waits = (await draft(client))["id"]
    assert (await client.get("/api/robots/mini-1")).json()["plan_id"] == flown
    found = (await client.get("/api/robots/mini-1/plans", params={"state": "draft"})).json()
    assert [one["id"] for one in found] == [waits]


async def test_a_draft_can_be_thrown_away(client):
    plan = (await draft(client))["id"]
    assert (await client.post(f"/api/plans/{plan}/cancel")).status_code == 202
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "cancelled"


async def test_check_says_what_changed_since_it_was_made(client, world):
    plan = (await draft(client))["id"]
    fresh = (await client.post(f"/api/plans/{plan}/check")).json()
    assert fresh == {"plan_id": plan, "violations": []}
    world.tell(state_report(MINI, (-0.3, -0.2, 0.0), battery_fraction=0.1))

    async def said():
        found = (await client.post(f"/api/plans/{plan}/check")).json()["violations"]
        return [one["field"] for one in found]

    assert set(await until(said)) == {"start", "battery"}
    outdated = (await client.get(f"/api/plans/{plan}")).json()["outdated"]
    assert [one["field"] for one in outdated] == ["start"]
    assert (await upload(client, plan)).status_code == 409


async def test_a_robot_that_drifted_since_may_follow_its_target_as_planned(client, world):
    plan = (await draft(client))["id"]
    world.tell(state_report(MINI, (3.0, 2.0, 0.0)))
    checked = (await client.post(f"/api/plans/{plan}/check")).json()
    assert checked["violations"] == []
    assert (await client.get(f"/api/plans/{plan}")).json()["outdated"] == []


async def test_a_draft_grows_old(client, station):
    plan = (await draft(client))["id"]
    record = await station.foundation.store.query(lambda session: get_plan(session, plan))
    limit = timedelta(seconds=record.document["draft_age_s"])
    status = station.fleet.status(MINI)
    assert outdated_target(record, status, record.created_at + limit) == []
    late = outdated_target(record, status, record.created_at + 2 * limit)
    assert [one.field for one in late] == ["mission.draft_age_s"]


async def test_satellite_quotes_it_as_any_plan(client):
    plan = (await draft(client))["id"]
    quote = (await client.get(f"/api/plans/{plan}/satellite")).json()
    assert quote["sha256"] == (await client.get(f"/api/plans/{plan}")).json()["sha256"]
    assert quote["bytes"] > 0
    assert quote["credits"] > 0


async def test_there_is_no_search_to_go_on_with(client):
    plan = (await draft(client))["id"]
    for step, body in (("choose", {"runner_up": 0}), ("continue", {})):
        answer = await client.post(f"/api/plans/{plan}/{step}", json=body)
        assert answer.status_code == 409
        assert "follows a target" in answer.json()["detail"]


async def test_lists_and_the_robot_page_know_it(client, station):
    plan = (await draft(client))["id"]
    summary = (await client.get("/api/robots/mini-1/plans")).json()[0]
    assert (summary["id"], summary["kind"], summary["violations"]) == (plan, "track_target", 0)
    robot = (await client.get("/api/robots/mini-1")).json()
    assert robot["plan_id"] == plan
    source = station.scene_source(MINI)
    assert source.plan() is None
    assert source.keep_outs() == ()
    assert source.target_path().shape == (301, 3)


async def test_a_survey_can_be_planned_beside_it(client, workers):
    """A plan without legs is no obstacle to who plans for the same water."""
    await draft(client)
    answer = await client.post("/api/robots/mini-1/plans", json={"kind": "adaptive_survey"})
    assert answer.status_code == 202, answer.text
    await plan_in(client, answer.json()["id"], "draft")


async def test_a_mission_of_this_kind_names_the_road_of_plans(client):
    answer = await client.post("/api/robots/mini-1/missions", json={"kind": "track_target"})
    assert answer.status_code == 422
    error = answer.json()["errors"][0]
    assert error["loc"] == ["kind"]
    assert "POST /api/robots/{robot}/plans" in error["msg"]


async def test_a_robot_that_never_said_where_it_is_gets_no_plan(client):
    answer = await ask(client, robot=GRACE)
    assert answer.status_code == 409
    assert "has not said where it is" in answer.json()["detail"]
    assert (await ask(client, robot="nobody")).status_code == 404


async def test_nothing_is_begun_while_storage_fails(client, tmp_path):
    blocker = sqlite3.connect(tmp_path / "station.sqlite3", timeout=60)
    blocker.execute("BEGIN EXCLUSIVE")
    try:
        answer = await ask(client)
        assert answer.status_code == 503
    finally:
        blocker.rollback()
        blocker.close()

    async def works():
        return (await ask(client)).status_code == 202

    await until(works)
    assert len((await client.get("/api/robots/mini-1/plans")).json()) == 1


async def test_a_draft_survives_a_restart_and_is_flown_then(tmp_path, world):
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        plan = await station.tracks.plan(MINI, {}, by="test")
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        assert (await station.plans.get(plan.id)).state == "draft"
        await station.transfers.send(plan.id, start=True)

        async def done():
            return (await station.plans.get(plan.id)).state == "done"

        await until(done)
    assert world.robots[MINI].state is OnboardPlanState.DONE


async def test_the_log_says_that_time_ended_a_pursuit(client, station, world):
    plan = await draft(client)
    await station.transfers.send(plan["id"], start=True)

    async def told():
        events = (await client.get("/api/events?robot=mini-1")).json()["events"]
        return [event["text"] for event in events if event["kind"] == "plan.done"]

    await until(told)
    assert await told() == [f"{MINI} followed the target of {plan['id']} until its time was over."]


async def test_a_robot_that_obeyed_to_be_quiet_is_warned_of_until_it_pings_again(client, world):
    for kind, warned in (("quiet", ["quiet"]), ("ping", [])):
        answer = await client.post(f"/api/robots/{MINI}/commands", json={"kind": kind})
        await until(lambda answer=answer: is_applied(client, answer.json()["id"]))
        assert [one["field"] for one in (await draft(client))["warnings"]] == warned


async def is_applied(client, command):
    return (await client.get(f"/api/commands/{command}")).json()["level"] == "applied"


@pytest.mark.parametrize(
    ("robot", "depth_m", "mode", "seen"),
    [
        (GRACE, 2.0, RobotMode.TRACKING, LinkState.SUBMERGED),
        (GRACE, 2.0, RobotMode.SEARCHING, LinkState.SUBMERGED),
        (GRACE, 0.0, RobotMode.TRACKING, LinkState.STALE),
        (GRACE, 2.0, RobotMode.HOLDING, LinkState.STALE),
        (MINI, 0.5, RobotMode.TRACKING, LinkState.STALE),
    ],
)
async def test_silence_of_a_robot_that_follows_under_water_is_expected(
    client, station, world, robot, depth_m, mode, seen
):
    where = {GRACE: (110.0, 140.0, 0.0), MINI: (1.2, 0.6, 0.0)}[robot]
    world.hear(robot)
    world.tell(state_report(robot, where))
    world.robots[robot].may_end.clear()
    plan = (await draft(client, {"motion": {"depth_m": depth_m}}, robot))["id"]
    answer = await upload(client, plan, start=True)
    assert answer.status_code == 202, answer.text
    await plan_in(client, plan, "running")
    world.tell(state_report(robot, where, mode=mode))
    world.hear(robot, LinkState.STALE)
    assert station.fleet.status(robot).link_state is seen
