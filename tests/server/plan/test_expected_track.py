"""What a draft promises once it was flown ahead, and what its flight is held against."""

import itertools

import numpy as np
import pytest

from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.planner.preset import MINIGLIDER
from autonomy.site import TANK
from db.query.measured.telemetry import track
from robot_link.messages import OnboardPlanState, RobotMode
from server.access.role import Role
from server.plan.ahead import planned_rest
from server.plan.dry_run import RUNS, DryRuns
from server.plan.expected import expected_of, is_on_leg, judged, off_track_m
from tests.server.conftest import MINI, api_client, open_station, until
from tests.server.fake_link import current_report, state_report
from tests.server.plan.test_plan_dry_run import laid_out
from tests.server.survey.test_plan_choice import plan_in

_BEFORE = DryRuns.before


@pytest.fixture(autouse=True)
def _rehearsed(monkeypatch, _unrehearsed, workers):
    monkeypatch.setattr(DryRuns, "before", _BEFORE)


async def drafted(client, **config):
    return await plan_in(client, await laid_out(client, **config), "draft")


async def test_draft_promises_what_its_flights_let_expect(client, workers):
    draft = await drafted(client)
    account, found = draft["account"], draft["rehearsal"]
    assert found["spread_m"] == 0.08
    assert found["expected_times_s"] == [[20.0, 50.0], [70.0, 100.0]]
    assert account["expected_from"] == RUNS
    assert account["duration_s"] == found["duration_s"]
    assert account["planned_duration_s"] > 0.0
    assert account["worst_std_m"] == 0.06
    legs, expected = draft["legs"], np.array(found["expected"]).reshape(2, 3, 5)
    for leg, rows in zip(legs, expected, strict=True):
        np.testing.assert_allclose(rows[0, 1:4], np.add(leg["start_ned"], (0.0, 0.2, 0.0)))
        np.testing.assert_allclose(rows[-1, 1:4], np.add(leg["end_ned"], (0.0, 0.2, 0.0)))
    assert workers.dry_runs[0].unknown_current_std_m_s == pytest.approx(
        draft["config"]["position_filter"]["steady_current_m_s"]
    )


async def test_plan_flown_ahead_once_promises_its_legs(client, workers):
    workers.breaks_off = 1
    draft = await drafted(client)
    assert draft["rehearsal"]["expected"] == []
    assert draft["account"]["expected_from"] == 0
    assert draft["account"]["planned_duration_s"] is None


async def test_expected_track_is_held_against_the_limits(client):
    start = (await drafted(client))["legs"][0]["start_ned"]
    north, east = start[0], start[1] + 0.2  # in the way of the expected track, not of the legs
    corners = [[north - 0.1, east - 0.1], [north + 0.1, east - 0.1], [north, east + 0.1]]
    draft = await drafted(client, keep_outs=[{"name": "reeds", "corners_m": corners}])
    assert draft["violations"] == []
    (near,) = draft["rehearsal"]["nearest"]
    assert near["name"] == "reeds"
    assert near["distance_m"] <= 0.0
    assert [one["message"] for one in draft["warnings"]] == [
        'The expected track enters the keep-out "reeds".'
    ]
    refused = await client.post(f"/api/plans/{draft['id']}/upload")
    assert refused.status_code == 409
    assert 'says: The expected track enters the keep-out "reeds".' in refused.json()["detail"]
    (held,) = (await client.post(f"/api/plans/{draft['id']}/check")).json()["violations"]
    assert held["field"] == "adaptive.rehearse"
    aside = [[n, e + 0.4] for n, e in corners]
    draft = await drafted(client, keep_outs=[{"name": "reeds", "corners_m": aside}], margin_m=0.35)
    (near,) = draft["rehearsal"]["nearest"]
    assert 0.25 < near["distance_m"] < 0.35
    assert "comes within" in draft["warnings"][0]["message"]
    assert (await client.post(f"/api/plans/{draft['id']}/check")).json()["violations"] == []


async def test_expected_time_and_uncertainty_are_held_against_their_limits():
    expected = np.array([(0.0, 1.0, 0.5, 0.0, 0.02), (60.0, 1.0, 0.5, 0.4, 0.31)])
    config = MINIGLIDER.model_copy(update={"time_budget_s": 100.0, "max_uncertainty_m": 0.2})
    broken = judged(expected, 120.0, config, TANK)["broken"]
    assert [one["field"] for one in broken] == ["max_uncertainty_m", "time_budget_s"]
    assert "0.31 m" in broken[0]["message"]
    assert "120 s" in broken[1]["message"]
    assert judged(expected[:1], 90.0, config, TANK)["broken"] == []
    beyond = np.array([(0.0, TANK.water.x_max_m + 0.1, 0.5, 0.0, 0.02)])
    (one,) = judged(beyond, 90.0, config, TANK)["broken"]
    assert "north edge" in one["message"]


async def test_expected_track_goes_with_its_plan_over_a_restart(tmp_path, world, workers):
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        draft = await drafted(client)
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        again = (await client.get(f"/api/plans/{draft['id']}")).json()
        assert again["rehearsal"] == draft["rehearsal"]
        assert again["account"] == draft["account"]
        hand = station.fleet.status(MINI).plan
        np.testing.assert_allclose(hand.expected, draft["rehearsal"]["expected"])


async def test_plan_of_an_earlier_version_expects_no_track(client, station):
    draft = await drafted(client)
    old = dict(draft["rehearsal"])
    for name in ("expected", "expected_times_s", "spread_m", "nearest", "broken"):
        del old[name]
    await station.plans.note(draft["id"], {"rehearsal": old}, only_from=("draft",))
    view = (await client.get(f"/api/plans/{draft['id']}")).json()
    assert view["rehearsal"]["expected"] == []
    assert view["rehearsal"]["spread_m"] is None
    assert view["account"]["duration_s"] == draft["account"]["planned_duration_s"]


async def test_samples_to_come_are_expected_on_the_expected_track(client, station):
    draft = await drafted(client)
    record = await station.plans.get(draft["id"])
    coming = planned_rest(record, None)
    promised = np.array(draft["points"])
    np.testing.assert_allclose(coming[:, (0, 4)], promised[:, (0, 4)])
    np.testing.assert_allclose(coming[:, 2] - promised[:, 2], 0.2, atol=1e-3)


async def test_flying_robot_is_held_against_the_expected_track(client, world, station):
    draft = await drafted(client)
    assert (await client.post(f"/api/plans/{draft['id']}/upload")).status_code == 202
    await plan_in(client, draft["id"], "on_board")
    north, east, _ = draft["legs"][0]["start_ned"]

    robot = world.robots[MINI]

    def fly(off_m, mode=RobotMode.DIVING):
        robot.say(OnboardPlanState.RUNNING)
        world.tell(state_report(MINI, (north, east + 0.2 + off_m, 0.1), mode=mode))

    async def off_track_is(off_m):
        async def said():
            plan = (await client.get(f"/api/plans/{draft['id']}")).json()
            return plan["onboard"] is not None and plan["onboard"]["off_track_m"] == off_m

        await until(said)

    fly(0.1)
    await plan_in(client, draft["id"], "running")
    fly(0.1)
    await off_track_is(0.1)
    fly(0.3)
    await off_track_is(0.3)
    fly(0.3, RobotMode.TURNING)
    await off_track_is(None)

    async def all_is_stored():
        flown = await station.foundation.store.query(lambda session: track(session, MINI))
        return RobotMode.TURNING in flown.mode

    await until(all_is_stored)
    robot.leg = 2
    robot.say(OnboardPlanState.DONE)
    done = await plan_in(client, draft["id"], "done")
    assert 0.1 <= done["onboard"]["off_track_rms_m"] <= 0.3
    events = (await client.get("/api/events", params={"limit": 1000})).json()["events"]
    (told,) = [one["text"] for one in events if "its track" in one["text"]]
    assert "by its own word 0." in told
    assert told.endswith(" m (rms) beside its track.")


def test_distance_from_a_track_is_that_of_the_leg_that_is_flown():
    ends = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.5), (2.0, 0.0, 0.0)]
    legs = [
        Leg(PrimitiveKind.GLIDE, start, end, 0.02, 50.0, 1.0)
        for start, end in itertools.pairwise(ends)
    ]
    assert off_track_m(None, legs, 0, (0.5, 0.3)) == pytest.approx(0.3)
    assert off_track_m(None, legs, 0, (1.3, 0.4)) == pytest.approx(0.5)
    assert off_track_m(None, legs, 1, (1.3, 0.4)) == pytest.approx(0.4)
    bent = np.array([(0, 0, 0), (50, 1, 0), (50, 1, 0.3), (100, 2, 0.3)], dtype=float)
    expected = np.column_stack([bent, np.zeros((4, 2))])
    assert off_track_m(expected, legs, 0, (0.5, 0.3)) == pytest.approx(0.3)
    assert off_track_m(expected, legs, 1, (1.5, 0.3)) == pytest.approx(0.0)
    assert not is_on_leg(RobotMode.SWIMMING, legs[0])
    assert is_on_leg(RobotMode.GLIDING, legs[0])
    assert expected_of({}) is None
