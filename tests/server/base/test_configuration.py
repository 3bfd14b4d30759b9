"""Tunable models by REST: validated, versioned, never overwritten."""

from dataclasses import replace

import pytest

from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.quality.rules import QualityRules
from autonomy.site import LAKE, TANK
from db.query.fleet.robots import add_robot
from db.query.station.configurations import add_configuration
from server.base.configuration import merge
from server.base.configuration_kind import KINDS
from tests.db.conftest import robot_record
from tests.server.station_app import running, signed_in


@pytest.fixture(autouse=True)
def _known_fleet():
    """Begin with an empty database."""


@pytest.fixture
async def app(tmp_path):
    async with running(tmp_path) as app:
        store = app.state.foundation.store
        await store.write(lambda session: add_robot(session, robot_record()))
        yield app


@pytest.fixture
async def admin(app):
    async with signed_in(app) as client:
        yield client


@pytest.mark.parametrize(("kind", "current_m_s"), [("tank", 0.01), ("lake", 0.05), ("sea", 0.2)])
def test_plans_and_maps_take_the_unknown_current_of_the_kind_of_water(kind, current_m_s):
    robot = replace(robot_record(), site=LAKE.model_copy(update={"kind": kind}))
    planner = KINDS["planner"].preset(robot, "grace3")
    assert planner.position_filter.steady_current_m_s == current_m_s
    assert KINDS["field"].preset(robot, "grace3").steady_current_m_s == current_m_s


async def test_every_kind_has_a_value_and_a_schema_with_units(admin):
    kinds = (await admin.get("/api/config")).json()
    assert {kind["kind"] for kind in kinds} == set(KINDS)
    for kind in kinds:
        fitting = [] if kind["kind"] in ("standard_commands", "storage") else ["mini-1"]
        assert kind["robots"] == fitting
        path = f"/api/config/{kind['kind']}"
        value = (await admin.get(path, params={"robot": "mini-1"})).json()["value"]
        schema = (await admin.get(f"{path}/schema")).json()
        hidden = set(value) - set(schema["properties"])
        assert hidden <= {"untold_current_m_s"}, "the station writes it; nobody sets it"
        assert set(schema["properties"]) <= set(value)
        models = (schema, *schema.get("$defs", {}).values())
        fields = [field for model in models for field in model.get("properties", {}).values()]
        described = [field for field in fields if "unit" in field]
        assert described or kind["kind"] == "delivery", "but one kind has numbers"
        assert all(field.get("title") and field.get("description") for field in described)


async def test_a_robot_begins_with_the_preset_of_its_vehicle(admin):
    found = (await admin.get("/api/config/planner", params={"robot": "mini-1"})).json()
    assert found["id"] is None
    assert found["changed_by"] is None
    assert found["value"] == PLANNER_PRESETS["miniglider"].model_dump(mode="json")


async def test_a_change_keeps_what_it_does_not_name(admin):
    before = (await admin.get("/api/config/planner?robot=mini-1")).json()["value"]
    change = {"total_budget": 60.0, "domain": {"depth_max_m": 0.5}}
    answer = await admin.patch("/api/config/planner?robot=mini-1", json=change)
    after = answer.json()
    assert answer.status_code == 200
    assert after["changed_by"] == "ann"
    assert after["value"]["total_budget"] == 60.0
    assert after["value"]["domain"] == {**before["domain"], "depth_max_m": 0.5}
    assert after["value"]["objective"] == before["objective"]


async def test_null_returns_a_field_to_its_preset(admin):
    path = "/api/config/planner?robot=mini-1"
    preset = (await admin.get(path)).json()["preset"]
    await admin.patch(path, json={"total_budget": 60.0, "domain": {"depth_max_m": 0.5}})
    value = (await admin.patch(path, json={"total_budget": None, "domain": None})).json()["value"]
    assert value == preset


async def test_wrong_fields_are_named_and_nothing_is_saved(admin):
    path = "/api/config/planner?robot=mini-1"
    change = {"domain": {"depth_max_m": -1.0}, "total_budget": "much", "speed": 3}
    answer = await admin.patch(path, json=change)
    assert answer.status_code == 422
    assert {tuple(error["loc"]) for error in answer.json()["errors"]} == {
        ("domain", "depth_max_m"),
        ("total_budget",),
        ("speed",),
    }
    assert (await admin.get(path)).json()["id"] is None


async def test_infinity_is_not_a_number_to_plan_with(admin):
    answer = await admin.patch(
        "/api/config/planner",
        content='{"total_budget": Infinity}',
        headers={"Content-Type": "application/json"},
    )
    assert answer.status_code == 422


async def test_versions_are_added_and_none_is_lost(admin):
    path = "/api/config/planner?robot=mini-1"
    ids = [(await admin.patch(path, json={"seed": seed})).json()["id"] for seed in (3, 4)]
    assert ids == ["config-1", "config-2"]
    history = (await admin.get("/api/config/planner/history?robot=mini-1")).json()
    assert [(version["id"], version["value"]["seed"]) for version in history] == [
        ("config-2", 4),
        ("config-1", 3),
    ]
    old = (await admin.get("/api/config/versions/config-1")).json()
    assert (old["value"]["seed"], old["robot"]) == (3, "mini-1")


async def test_whoever_saves_second_is_told_instead_of_overwriting(admin):
    path = "/api/config/planner?robot=mini-1"
    tag = (await admin.get(path)).headers["ETag"]
    first = await admin.patch(path, json={"seed": 3}, headers={"If-Match": tag})
    assert first.status_code == 200
    second = await admin.patch(path, json={"seed": 4}, headers={"If-Match": tag})
    assert second.status_code == 412
    assert second.json()["detail"].startswith("ann changed it at ")
    again = await admin.patch(path, json={"seed": 4}, headers={"If-Match": first.headers["ETag"]})
    assert again.status_code == 200
    assert again.headers["ETag"] == '"config-2"'


async def test_what_is_saved_for_all_holds_where_nothing_of_its_own_is(admin):
    await admin.patch("/api/config/estimator", json={"fix_std_m": 0.5})
    path = "/api/config/estimator?robot=mini-1"
    assert (await admin.get(path)).json()["value"]["fix_std_m"] == 0.5
    await admin.patch(path, json={"fix_std_m": 0.25})
    assert (await admin.get(path)).json()["value"]["fix_std_m"] == 0.25
    assert (await admin.get("/api/config/estimator")).json()["value"]["fix_std_m"] == 0.5


async def test_a_change_is_in_the_log(admin):
    await admin.patch("/api/config/planner?robot=mini-1", json={"seed": 3})
    events = (await admin.get("/api/events?robot=mini-1")).json()["events"]
    assert [(event["kind"], event["text"]) for event in events] == [
        ("config.changed", "ann changed the Planner settings of mini-1.")
    ]
    assert events[0]["data"] == {"kind": "planner", "id": "config-1"}


async def test_a_plan_may_lay_changes_on_top_without_saving_them(app):
    book = app.state.foundation.configurations
    merged = await book.merged("planner", "mini-1", {"seed": 9})
    assert merged.value.model_dump()["seed"] == 9
    assert (await book.current("planner", "mini-1")).id is None


def test_a_patch_goes_into_objects_and_replaces_lists():
    value = {"a": {"b": 1, "c": [1, 2]}, "d": 4}
    preset = {"a": {"b": 7, "c": []}, "d": 8}
    assert merge(value, {"a": {"c": [3]}}, preset) == {"a": {"b": 1, "c": [3]}, "d": 4}
    assert merge(value, {"a": {"b": None}, "d": None}, preset) == {
        "a": {"b": 7, "c": [1, 2]},
        "d": 8,
    }


def test_null_removes_from_a_map_what_it_names_and_leaves_the_rest():
    limits = {"fail_low": 0.0, "spike_fail": 6.0}
    value = {"version": "1.0.1", "series": {"temperature": limits, "salinity": {"fail_low": 0.0}}}
    preset = {"version": "1.0.0", "series": {"temperature": limits}}

    def patched(patch):
        return merge(value, {"series": patch}, preset, QualityRules)["series"]

    assert patched({"temperature": {"spike_fail": None}}) == {
        "temperature": {"fail_low": 0.0},
        "salinity": {"fail_low": 0.0},
    }
    assert patched({"salinity": None}) == {"temperature": limits}
    assert patched({"temperature": None}) == {"salinity": {"fail_low": 0.0}}
    assert patched({"ph": {"fail_low": 6.0, "fail_high": None}})["ph"] == {"fail_low": 6.0}
    assert merge(value, {"series": None, "version": None}, preset, QualityRules) == preset


async def test_a_rule_that_is_switched_off_stays_off(admin):
    path = "/api/config/quality?robot=mini-1"
    limits = (await admin.get(path)).json()["value"]["series"]["temperature"]
    assert limits["spike_suspect"] is not None
    change = {"series": {"temperature": {"spike_suspect": None}, "chlorophyll": None}}
    for _ in range(2):
        changed = (await admin.patch(path, json=change)).json()["value"]["series"]
        assert changed["temperature"] == limits | {"spike_suspect": None}
        assert set(changed) == {"temperature", "blue_light"}
    assert (await admin.patch(path, json={"series": {"salinity": None}})).status_code == 200
    assert (await admin.get(path)).json()["value"]["series"] == changed
    again = (await admin.patch(path, json={"series": None})).json()["value"]["series"]
    assert again["temperature"] == limits


@pytest.mark.parametrize(
    ("series", "path", "words"),
    [
        ({"temprature": {"fail_low": 0.0}}, ["temprature"], "temprature is no channel of the"),
        ({"salinity": {"fail_lo": 0.0}}, ["salinity", "fail_lo"], "there are fail_low, fail_high"),
        ({"salinity": {"fail_low": 9.0, "fail_high": 1.0}}, ["salinity", "fail_high"], "above"),
    ],
)
async def test_a_rule_that_does_not_fit_is_named(admin, series, path, words):
    answer = await admin.patch("/api/config/quality", json={"series": series})
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["loc"] == ["series", *path]
    assert words in error["msg"]


async def test_kept_rules_that_would_be_refused_today_can_be_mended(app, admin):
    store, kind = app.state.foundation.store, "quality"
    value = {"series": {"salinity": {"fail_low": 0.0, "suspect_low": -1.0}}}
    at = app.state.foundation.clock.now()
    await store.write(lambda s: add_configuration(s, kind, "mini-1", value, at=at, by="ann"))
    path = "/api/config/quality?robot=mini-1"
    assert (await admin.get(path)).json()["value"]["series"]["salinity"]["suspect_low"] == -1.0
    refused = await admin.patch(path, json={"version": "1.0.1"})
    assert refused.json()["errors"][0]["loc"] == ["series", "salinity", "suspect_low"]
    mended = {"series": {"salinity": {"suspect_low": None}}}
    assert (await admin.patch(path, json=mended)).status_code == 200


def test_presets_of_a_robot_follow_its_water():
    preset = KINDS["field"].preset
    for robot, site in ((robot_record(), TANK), (robot_record("grace-1", 2), LAKE)):
        assert preset(robot, robot.model).model_dump()["variable"] == site.variable


async def test_of_what_holds_for_several_robots_the_newest_that_was_saved_is_taken(app):
    foundation = app.state.foundation
    book, robots = foundation.configurations, ["mini-1", "mini-2", "mini-3"]
    for number in (2, 3):
        record = robot_record(f"mini-{number}", number)
        await foundation.store.write(lambda session, one=record: add_robot(session, one))
    first = await book.current("planner", "mini-1")
    assert (await book.newest_of("planner", robots)).value == first.value
    saved = ((None, 3), ("mini-2", 4), ("mini-1", 5), (None, 6), ("mini-2", 7))
    for robot, seed in saved:
        await book.patch("planner", robot, {"seed": seed}, by="ann")
        assert (await book.newest_of("planner", robots)).value.seed == seed
    await book.patch("planner", "mini-1", {"seed": 8}, by="ann")
    assert (await book.newest_of("planner", ["mini-3"])).value.seed == 6
    assert (await book.newest_of("planner", ["mini-2", "mini-3"])).value.seed == 7
