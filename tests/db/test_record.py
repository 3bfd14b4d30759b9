"""Robots, missions, plans, transfers, commands, configurations, maps, people."""

from dataclasses import replace
from datetime import timedelta

import pytest

from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.query.fleet import robots
from db.query.fleet.deployments import list_deployments
from db.query.measured import maps
from db.query.mission import commands, missions, plans, transfers
from db.query.station import configurations, people
from db.query.station.grants import Holder
from robot_link.messages import CommandKind, CommandLevel
from tests.db.conftest import START, robot_record

LATER = START + timedelta(minutes=1)


def do(store, function, *args, **kwargs):
    return store.change(lambda session: function(session, *args, **kwargs)).result(60)


def see(store, function, *args, **kwargs):
    with store.read() as session:
        return function(session, *args, **kwargs)


@pytest.mark.parametrize(
    "bad", ["plan", "plan-", "plan-x", "mission-3", "plan-٣", "plan-" + "9" * 30]
)
def test_an_id_of_another_kind_is_unknown(bad):
    with pytest.raises(UnknownIdError):
        key_of("plan", bad)


def test_ids_are_short_and_go_both_ways():
    assert public_id("plan", 14) == "plan-14"
    assert key_of("plan", "plan-14") == 14


def test_a_robot_comes_back_as_it_was_added(store):
    assert see(store, robots.get_robot, "mini-1") == replace(robot_record(), water="test-tank")
    with pytest.raises(robots.RobotExistsError, match="mini-1"):
        do(store, robots.add_robot, robot_record())
    with pytest.raises(robots.RobotExistsError, match="System id 1"):
        do(store, robots.add_robot, robot_record(name="other"))


def test_a_robot_in_the_water_has_a_deployment_and_a_recording_has_not(store):
    do(store, robots.add_robot, robot_record("old", None, kind="recorded"))
    found = see(store, list_deployments)
    assert [(d.robot, d.kind, d.ended_at) for d in found] == [("mini-1", "live", None)]


def test_a_robot_changes_only_where_it_may(store):
    do(store, robots.add_robot, robot_record("grace-1", 2))
    changed = do(store, robots.change_robot, "grace-1", name="Grace", links=("xbee:///dev/x",))
    assert (changed.name, changed.links) == ("Grace", ("xbee:///dev/x",))
    with pytest.raises(robots.RobotExistsError):
        do(store, robots.change_robot, "grace-1", system_id=1)
    with pytest.raises(ValueError, match="kind"):
        do(store, robots.change_robot, "grace-1", kind="real")
    with pytest.raises(UnknownIdError):
        do(store, robots.change_robot, "nobody", name="x")


def new_mission(store):
    return do(
        store, missions.add_mission, "mini-1", "adaptive_survey", state="planning",
        automation=False, config={"a": 1}, document={"message": ""}, at=START, by="a",
    )  # fmt: skip


def new_plan(store, **more):
    return do(
        store, plans.add_plan, "mini-1", "adaptive_survey", config={}, at=START, by="a", **more
    )


def test_a_mission_keeps_what_is_not_changed(store):
    mission = new_mission(store)
    changed = do(store, missions.change_mission, mission, state="ready", document={"spent": 3})
    assert changed.state == "ready"
    assert changed.document == {"message": "", "spent": 3}
    assert see(store, missions.list_missions, robot="mini-1", states=("ready",)) == [changed]
    assert see(store, missions.list_missions, before=mission) == []
    with pytest.raises(UnknownIdError):
        do(store, missions.change_mission, "mission-99", state="ready")


def test_a_plan_notes_the_moment_of_each_step(store):
    plan = new_plan(store, mission=new_mission(store), round_number=2)
    do(store, plans.change_plan, plan, at=START, state="draft", sha256="ab" * 32)
    sent = do(store, plans.change_plan, plan, at=LATER, state="sent", only_from=("draft",))
    assert (sent.draft_at, sent.sent_at, sent.on_board_at) == (START, LATER, None)
    assert (sent.mission, sent.round) == ("mission-1", 2)
    with pytest.raises(plans.PlanStateError, match="is sent"):
        do(store, plans.change_plan, plan, at=LATER, state="sent", only_from=("draft",))


def test_a_plan_is_found_by_the_begin_of_its_hash(store):
    first, second = new_plan(store), new_plan(store)
    for plan in (first, second):
        do(store, plans.change_plan, plan, at=START, state="draft", sha256="abcd" + "0" * 60)
    assert see(store, plans.plan_by_hash, "mini-1", "abcd").id == second
    assert see(store, plans.plan_by_hash, "mini-1", "ff") is None
    assert [p.id for p in see(store, plans.list_plans, robot="mini-1")] == [second, first]
    assert [p.id for p in see(store, plans.list_plans, before=second, states=("draft",))] == [first]


def test_a_transfer_is_open_until_it_ends(store):
    transfer = do(
        store, transfers.add_transfer, new_plan(store), "mini-1", items=5, size=240, start=True,
        at=START,
    )  # fmt: skip
    assert [t.id for t in see(store, transfers.open_transfers)] == [transfer]
    ended = do(store, transfers.change_transfer, transfer, state="on_board", ended_at=LATER)
    assert (ended.plan, ended.state, ended.items) == ("plan-1", "on_board", 5)
    assert see(store, transfers.open_transfers) == []
    with pytest.raises(ValueError, match="bytes"):
        do(store, transfers.change_transfer, transfer, bytes=3)


def new_command(store):
    return do(
        store, commands.add_command, "mini-1", CommandKind.SURFACE, at=START, expires_at=LATER,
        by="a",
    )  # fmt: skip


def test_a_command_climbs_its_levels_once_each(store):
    command = new_command(store)
    assert (command.level, command.levels) == ("created", ())
    for level in (CommandLevel.QUEUED, CommandLevel.QUEUED, CommandLevel.RADIO):
        do(store, commands.add_level, command.id, level, at=LATER, carrier="xbee")
    found = see(store, commands.get_command, command.id)
    assert [step.level for step in found.levels] == ["queued", "radio"]


def test_a_settled_command_is_never_overruled(store):
    command = new_command(store)
    do(store, commands.add_level, command.id, CommandLevel.EXPIRED, at=LATER, carrier="station")
    late = do(store, commands.add_level, command.id, CommandLevel.APPLIED, at=LATER, carrier="xbee")
    assert late.level == "expired"
    assert see(store, commands.list_commands, robot="mini-1", open_only=True) == []


def test_a_command_is_found_by_the_number_that_travels(store):
    first, second = new_command(store), new_command(store)
    assert first.number != second.number
    assert see(store, commands.command_of_number, "mini-1", first.number).id == first.id
    assert see(store, commands.command_of_number, "mini-1", 4711) is None


def test_versions_of_a_configuration_are_only_added(store):
    for number in range(3):
        do(
            store, configurations.add_configuration, "planner", "mini-1", {"a": number}, at=START,
            by="a",
        )  # fmt: skip
    newest = see(store, configurations.newest_configuration, "planner", "mini-1")
    assert newest.value == {"a": 2}
    assert see(store, configurations.newest_configuration, "planner", None) is None
    assert see(store, configurations.get_configuration, "config-1").value == {"a": 0}
    history = see(store, configurations.configuration_history, "planner", "mini-1")
    assert [version.value["a"] for version in history] == [2, 1, 0]


def test_the_newest_snapshot_of_each_map_is_found(store):
    for samples in (10, 20):
        for model in ("single", "recursive"):
            record = maps.MapRecord("mini-1", "blue_light", model, START, samples, {}, b"grid")
            do(store, maps.add_map, record)
    assert {(m.model, m.samples) for m in see(store, maps.newest_maps, "mini-1")} == {
        ("single", 20),
        ("recursive", 20),
    }


def test_a_session_ends_with_its_time_and_with_its_person(store):
    ann = Holder(person=do(store, people.add_person, "ann", "pilot", "hash", START).key)
    for secret in ("one", "two"):
        do(
            store, people.add_session, ann, secret_hash=secret, csrf_token="c", at=START,
            expires_at=LATER,
        )  # fmt: skip
    assert see(store, people.find_sessions, ("one",), START)["one"].person.name == "ann"
    assert see(store, people.find_sessions, ("one",), LATER) == {}
    do(store, people.change_person, "ann", disabled=True, at=START)
    assert see(store, people.find_sessions, ("two",), START) == {}


def test_a_one_time_sign_in_works_once(store):
    do(store, people.add_person, "ann", "pilot", None, START)
    do(
        store, people.add_token, "link", "", secret_hash="s", at=START, expires_at=LATER,
        person="ann",
    )  # fmt: skip
    assert see(store, people.find_token, "s", START) is None
    assert do(store, people.use_one_time_token, "s", START).name == "ann"
    assert do(store, people.use_one_time_token, "s", START) is None
    assert see(store, people.list_tokens) == []
