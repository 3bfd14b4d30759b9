"""A robot that falls silent: where it should be, what it will do, and the fix that judges it."""

import asyncio
import shutil
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from db.fault import StoreUnavailableError
from robot_link.messages import OnboardPlanState, RobotMode
from robot_link.report import CurrentReport
from server.access.role import Role
from server.fleet.event import RobotReported
from server.plan.dry_run import DryRuns
from server.prediction.predictions import Predictions
from tests.server.conftest import GRACE, MINI, api_client, open_station, until
from tests.server.fake_link import state_report
from tests.server.plan.test_plan_dry_run import laid_out
from tests.server.survey.test_plan_choice import plan_in

_BEFORE = DryRuns.before
HOUR = timedelta(hours=1)


def believed(robot, at, current=(0.05, 0.0), std=0.01):
    return CurrentReport(robot, at, at, current, std, 1.0, 5, 0)


async def get(client, robot, what="prediction"):
    answer = await client.get(f"/api/robots/{robot}/{what}")
    assert answer.status_code == 200, answer.text
    return answer.json()


async def judged(client, robot, count=1):
    async def are_kept():
        found = await get(client, robot, "predictions")
        return found if len(found["predictions"]) >= count else None

    return await until(are_kept)


@pytest.fixture
def predictions(station):
    return station.foundation.services.get(Predictions)


async def silent(client, robot):
    async def is_predicted():
        found = await get(client, robot)
        return found if found["is_silent"] else None

    return await until(is_predicted)


async def test_robot_that_lies_afloat_is_predicted_to_drift_and_judged_by_its_fix(
    client, world, still
):
    said = still - HOUR
    world.tell(state_report(GRACE, (200.0, 300.0, 0.0), at=said, position_std_m=1.5))
    world.tell(believed(GRACE, said))
    found = await silent(client, GRACE)
    assert found["kind"] == "afloat"
    now = found["now"]
    assert now["north_m"] == pytest.approx(200.0 + 0.05 * 3600.0, rel=0.05)
    assert now["east_m"] == pytest.approx(300.0, abs=1.0)
    axes = [place["ellipse_m"][0] for place in found["path"]]
    assert np.all(np.diff(axes) >= 0.0)
    assert axes[0] < 5.0 < axes[-1]
    assert found["path"][0]["at"].startswith(said.strftime("%Y-%m-%dT%H:%M:%S"))
    state = await get(client, GRACE, "state")
    assert state["position"]["ned_m"][:2] == [200.0, 300.0], "what the robot said stays its word"
    found_at = (now["north_m"] + 20.0, now["east_m"], 0.0)
    world.tell(state_report(GRACE, found_at, at=still, position_std_m=1.5))
    (one,) = (await judged(client, GRACE))["predictions"]
    assert one["is_inside"]
    assert one["miss_m"] == pytest.approx(20.0, abs=1.0)
    assert one["silent_s"] == pytest.approx(3600.0, abs=60.0)
    assert 0.0 < one["ellipse_units"] < 1.0
    heard = await get(client, GRACE)
    assert not heard["is_silent"]
    assert heard["path"] == []
    assert heard["now"] is None

    async def is_logged():
        events = (await client.get("/api/events")).json()["events"]
        return [one["text"] for one in events if one["kind"] == "prediction.judged"]

    (text,) = await until(is_logged)
    assert "grace-1 was found 20 m from where it was predicted after 60 min" in text
    assert "inside the 90 % ellipse" in text


async def test_fix_far_away_is_outside_and_widens_the_next(client, world, station):
    predictions = station.foundation.services.get(Predictions)
    before = datetime.now(UTC) - 6 * HOUR
    world.tell(believed(GRACE, before, current=(0.15, 0.0)))
    for number in range(5):
        at = before + number * HOUR
        world.tell(state_report(GRACE, (200.0, 300.0 + number, 0.0), at=at, position_std_m=1.5))
        if number:
            await judged(client, GRACE, number)
    found = await get(client, GRACE, "predictions")
    assert found["share_inside"] < 1.0
    assert found["median_miss_m"] == pytest.approx(510.0, rel=0.1)
    assert await predictions.widened(GRACE, "afloat") > 1.2
    assert await predictions.widened(GRACE, "flying") == 1.0


async def test_report_that_says_nothing_newer_does_not_hide_the_prediction(
    client, world, predictions, monkeypatch
):
    widened = predictions.widened

    async def reported_meanwhile(robot, kind):
        predictions.take(RobotReported(robot))
        return await widened(robot, kind)

    monkeypatch.setattr(predictions, "widened", reported_meanwhile)
    told = predictions.told

    async def told_meanwhile(robot):
        predictions.take(RobotReported(robot))
        return await told(robot)

    monkeypatch.setattr(predictions, "told", told_meanwhile)
    world.tell(state_report(GRACE, (200.0, 300.0, 0.0), at=datetime.now(UTC) - HOUR))
    await until(lambda: predictions.path(GRACE))
    assert (await get(client, GRACE))["is_silent"]


async def test_robot_that_is_heard_while_it_is_predicted_has_no_prediction(
    client, world, predictions, monkeypatch
):
    del client
    widened, has_looked = predictions.widened, asyncio.Event()
    said = datetime.now(UTC) - HOUR

    async def heard_meanwhile(robot, kind):
        factor = await widened(robot, kind)
        if not has_looked.is_set():
            world.tell(state_report(GRACE, (201.0, 300.0, 0.0)))
            await until(lambda: predictions.basis(GRACE).state.measured_at > said)
            has_looked.set()
        return factor

    monkeypatch.setattr(predictions, "widened", heard_meanwhile)
    world.tell(state_report(GRACE, (200.0, 300.0, 0.0), at=said))
    await has_looked.wait()
    assert predictions.path(GRACE) is None


async def test_failing_storage_delays_predictions_and_verdicts_and_loses_none(
    client, world, predictions, monkeypatch
):
    told, failures = predictions.told, [StoreUnavailableError("the disk is full")]

    async def failing_once(robot):
        if failures:
            raise failures.pop()
        return await told(robot)

    monkeypatch.setattr(predictions, "told", failing_once)
    world.tell(state_report(GRACE, (200.0, 300.0, 0.0), at=datetime.now(UTC) - HOUR))
    await until(lambda: predictions.path(GRACE))
    assert not failures
    failures.append(StoreUnavailableError("the disk is full"))
    world.tell(state_report(GRACE, (205.0, 300.0, 0.0), position_std_m=1.5))
    assert len((await judged(client, GRACE))["predictions"]) == 1
    assert not failures


async def test_same_fix_is_judged_once_also_after_a_restart(tmp_path, world, prepared_database):
    shutil.copy(prepared_database, tmp_path)
    said = datetime.now(UTC) - HOUR
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        world.tell(state_report(GRACE, (200.0, 300.0, 0.0), at=said, position_std_m=1.5))
        await silent(client, GRACE)
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        assert (await silent(client, GRACE))["kind"] == "afloat"
        world.tell(state_report(GRACE, (210.0, 310.0, 0.0), position_std_m=1.5))
        assert len((await judged(client, GRACE))["predictions"]) == 1


async def test_short_silence_and_robot_without_a_fix_are_not_judged(client, world):
    begin = datetime.now(UTC) - HOUR
    for second in (0.0, 30.0):
        world.tell(state_report(MINI, at=begin + timedelta(seconds=second)))
    diving = state_report(
        MINI, (1.0, 0.5, 0.3), at=begin + 0.5 * HOUR, has_fix=False, mode=RobotMode.GLIDING
    )
    world.tell(diving)
    world.tell(replace(diving, measured_at=begin + 0.75 * HOUR, received_at=begin))
    world.tell(state_report(GRACE, (200.0, 300.0, 0.0), at=begin))
    world.tell(state_report(GRACE, (201.0, 300.0, 0.0)))
    await judged(client, GRACE)
    assert (await get(client, MINI, "predictions"))["predictions"] == []
    assert (await get(client, MINI, "predictions"))["share_inside"] is None


@pytest.fixture
def _rehearsed(monkeypatch, _unrehearsed, workers):
    monkeypatch.setattr(DryRuns, "before", _BEFORE)


@pytest.mark.usefixtures("_rehearsed")
async def test_robot_that_flies_keeps_to_its_expected_track_and_tells_its_own_acts(client, world):
    robot = world.robots[MINI]
    draft = await plan_in(client, await laid_out(client), "draft")
    assert (await client.post(f"/api/plans/{draft['id']}/upload")).status_code == 202
    await plan_in(client, draft["id"], "on_board")
    acts = {one["key"]: one for one in (await get(client, MINI))["acts"]}
    assert "told to start" in acts["start"]["text"]
    assert "timeout" not in acts, "a plan that is not flown sets nothing yet"
    start = draft["legs"][0]["start_ned"]
    robot.say(OnboardPlanState.RUNNING)
    flown = await plan_in(client, draft["id"], "running")
    begun = datetime.fromisoformat(flown["ladder"]["running_at"])
    expected = np.array(draft["rehearsal"]["expected"])
    # the fake robot's clock is the station's: its word is of late, what follows is of later
    word = state_report(
        MINI,
        (start[0], start[1] + 0.2, 0.15),
        at=begun + timedelta(seconds=1),
        mode=RobotMode.DIVING,
        has_fix=False,
    )
    world.tell(word)
    found = await silent(client, MINI)
    assert found["kind"] == "flying"
    assert draft["id"] in found["text"]
    depths = [place["depth_m"] for place in found["path"]]
    assert max(depths) == pytest.approx(expected[:, 3].max(), abs=0.08)
    np.testing.assert_allclose(found["path"][0]["east_m"], start[1] + 0.2, atol=0.02)
    acts = {one["key"]: one for one in found["acts"]}
    timeout = datetime.fromisoformat(acts["timeout"]["at"])
    patience_s = (timeout - begun).total_seconds()
    assert f"{patience_s:.0f} s after it began" in acts["timeout"]["text"]
    assert acts["floor"]["text"] == "It comes up 0.15 m above the floor."
    assert acts["floor"]["source"] == "as the program on board is built"
    assert "falls below 5%" in acts["battery"]["text"]
    assert acts["battery"]["at"] is not None
    assert draft["id"] in acts["timeout"]["source"]
    times = [one["at"] for one in found["acts"] if one["at"]]
    assert times == sorted(times)


async def test_recording_and_robot_that_never_spoke_are_not_predicted(client):
    found = await get(client, GRACE)
    assert (found["kind"], found["now"], found["acts"]) == ("unknown", None, [])
    assert (await client.get("/api/robots/nobody-1/prediction")).status_code == 404
