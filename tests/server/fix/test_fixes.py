"""Robots that cameras see: found, kept, told to the robots, held against what they say."""

import asyncio
import csv
import os
import signal
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from autonomy.site import TANK
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Layout, Tag
from db.fault import StoreUnavailableError
from db.query.camera.fixes import list_fixes
from robot_link.camera.config import CameraConfig
from robot_link.camera.sighting import Sighting
from robot_link.messages import RobotId
from server.base.worker import WorkerEndedError, WorkerPool
from server.camera.processes import CameraProcesses
from server.camera.rig import CameraRig
from server.fix import follow, records
from server.fix import fusion as fusing
from server.fix.event import FixFound
from server.fix.follow import CAUSE
from server.fix.fusion import Fusion
from server.fix.gathering import Gathering, Picture
from server.fleet.fleet import Fleet
from server.fleet.link_panel import link_views
from tests.autonomy.vision.tank import ROBOT, tank_layout
from tests.server.conftest import MINI, open_station, until
from tests.server.fake_link import state_report
from tests.server.fix.sighted import LINK, OTHER, Cameraman, calibrate, give_link, put_tags

HERE = Pose.of_angles([2.0, 1.4, 0.5], 0.05, -0.2, 1.0)
THERE = Pose.of_angles([2.6, 1.0, 0.3], 0.0, 0.0, -1.0)


@pytest.fixture
async def filming(client, foundation):
    """A station with calibrated cameras that look for mini-1, and who draws their pictures."""
    await calibrate(foundation, client)
    await give_link(client)
    return Cameraman(foundation)


async def fixes(client, **query):
    answer = await client.get("/api/robots/mini-1/fixes", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()["fixes"]


def row(foundation, station):
    views = link_views(station.fleet.status(MINI))
    return next(view for view in views if view.uri == LINK)


async def test_a_robot_in_the_pictures_is_found_kept_and_told(
    client, station, world, filming, foundation
):
    rows = await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    fix = rows[-1]
    assert fix["ned_m"] == pytest.approx(HERE.position_m, abs=0.006)
    assert fix["heading_rad"] == pytest.approx(1.0, abs=0.02)
    assert fix["quality"] == "good"
    assert fix["cameras"] == ["tank-1", "tank-2", "tank-3"]
    assert fix["calibration"].startswith("calibration")
    assert np.all(np.array(fix["covariance_m2"])[[0, 3, 5]] > 0.0)
    assert [one.robot for one in world.fixes][:1] == [MINI]
    sent = await until(lambda: sent_ones(client))
    assert sent[0]["measured_at"] == world.fixes[0].measured_at.isoformat().replace("+00:00", "Z")

    def is_live():
        link = row(foundation, station)
        return link if link.state == "live" else None

    link = await filming.until_found(ROBOT.tags, HERE, is_live)
    assert link.kind == "camera"
    assert link.carries == ["position"]
    assert link.text.startswith("3 cameras, ")
    assert link.text.endswith(" s old.")


async def sent_ones(client):
    return [one for one in await fixes(client) if one["sent_at"] is not None]


async def test_a_fix_that_the_radio_does_not_take_is_kept_as_not_sent(
    client, station, world, filming, foundation
):
    world.in_reach = False
    rows = await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    assert rows[-1]["sent_at"] is None
    words = "not sent: mini-1 is not in radio contact"
    await filming.until_found(ROBOT.tags, HERE, lambda: words in row(foundation, station).text)
    assert world.fixes == []


async def test_an_unplugged_robot_is_neither_sought_nor_told(
    client, station, world, filming, foundation
):
    await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    await station.disabled_links.set(LINK, is_enabled=False, robot="mini-1", by="ann")
    station.fleet.set_disabled_links(station.disabled_links.disabled)
    link = row(foundation, station)
    assert (link.state, link.carries) == ("unplugged", [])
    assert "neither sought nor told" in link.text
    rig = foundation.services.get(CameraRig)
    await filming.until_found(ROBOT.tags, HERE, lambda: not rig.regions("tank-2"))
    await foundation.store.write(lambda _: None)  # behind the fixes of before
    count, told = len(await fixes(client)), len(world.fixes)
    for _ in range(5):
        filming.shoot((ROBOT.tags, HERE))
        await asyncio.sleep(0.05)
    assert (len(await fixes(client)), len(world.fixes)) == (count, told)
    assert foundation.services.get(Fusion).strangers == {}
    await station.disabled_links.set(LINK, is_enabled=True, robot="mini-1", by="ann")
    await filming.until_found(ROBOT.tags, HERE, lambda: len(world.fixes) > told)


async def test_cameras_are_told_where_to_look(filming, foundation):
    rig = foundation.services.get(CameraRig)
    await filming.until_found(ROBOT.tags, HERE, lambda: rig.regions("tank-2"))
    (region,) = rig.regions("tank-2")
    assert 0 <= region.left < region.right < 1280
    assert region.right - region.left < 400


async def test_a_robot_that_is_hidden_is_told_as_lost_with_its_age(
    client, station, filming, foundation
):
    async def told():
        found = await fixes(client)
        await filming.until_found(ROBOT.tags, HERE, lambda: more(client, len(found) + 1))
        for _ in range(40):  # a robot is looked for at its place for 5 s
            filming.shoot()
            text = row(foundation, station).text
            if "do not find its tags" in text:
                return text
            await asyncio.sleep(0.05)
        return None

    text = await until(told)
    assert "ago" in text
    assert row(foundation, station).state == "stale"


async def test_two_robots_each_get_their_own_fixes(client, foundation):
    await calibrate(foundation, client, (ROBOT, OTHER))
    await give_link(client)
    body = {
        "id": "mini-2",
        "name": "Second",
        "model": "miniglider",
        "system_id": 7,
        "links": ["cameras:///?tags=grace-1"],
        "site": TANK.model_dump(mode="json"),
    }
    added = await client.post("/api/robots", json=body)
    assert added.status_code == 201, added.text
    filming, found = Cameraman(foundation), {}
    foundation.bus.subscribe(FixFound, lambda event: found.setdefault(event.fix.robot, event.fix))

    def both():
        filming.shoot((ROBOT.tags, HERE), (OTHER.tags, THERE))
        return len(found) == 2

    await until(lambda: asyncio.sleep(0.1, both()))
    assert found[MINI].ned_m == pytest.approx(HERE.position_m, abs=0.006)
    assert found[RobotId("mini-2")].tags == (3, 4, 5)


async def test_two_robots_cannot_have_one_set_of_tags(client, filming):
    for links in ([LINK], ["cameras:/?tags=mini-1"]):
        answer = await client.patch("/api/robots/grace-1", json={"links": links})
        assert answer.status_code == 409, answer.text


async def test_a_robot_in_another_water_is_not_sought_and_told_why(
    client, station, filming, foundation
):
    found = []
    foundation.bus.subscribe(FixFound, found.append)
    await give_link(client, "grace-1", ("cameras:///?tags=grace-1",))
    await put_tags(client, (ROBOT, OTHER))

    def is_told():
        views = link_views(station.fleet.status("grace-1"))
        why = "cameras hang over a tank, and its water is Practice lake"
        return any(why in view.text for view in views)

    await filming.until_found(OTHER.tags, THERE, is_told)
    assert not found


def test_fixed_tags_far_from_a_tank_are_of_another_water():
    assert not fusing.other_water(TANK, tank_layout())
    far = Layout((Tag(100, 0.15, (9.0, 0.0, 1.2)),))
    assert "tag 100 lies outside of its water, Test tank" in fusing.other_water(TANK, far)


async def test_pictures_that_fail_once_are_sought_anew_without_what_was_known(
    client, filming, foundation
):
    await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    count = len(await fixes(client))
    foundation.services.get(Fusion)._tracks = b"no tracks"
    await filming.until_found(ROBOT.tags, HERE, lambda: more(client, count + 2))


async def test_the_gates_of_the_settings_are_those_of_fixes(client, world, filming, foundation):
    body = {"position_std_max_m": 0.005, "rms_max": 1.0}
    await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    processes = foundation.services.get(CameraProcesses)
    processes.config = CameraConfig(**{**body, "fix_rate_hz": 0.1})

    async def refused():
        return [one for one in await fixes(client) if one["quality"] == "refused"]

    await filming.until_found(ROBOT.tags, HERE, refused)


async def test_fixes_are_sent_as_often_as_the_settings_say(client, world, filming, foundation):
    foundation.services.get(CameraProcesses).config = CameraConfig(fix_rate_hz=0.1)
    begun = foundation.clock.now()
    await filming.until_found(ROBOT.tags, HERE, lambda: more(client, 8))
    lasted_s = (foundation.clock.now() - begun).total_seconds()
    # One may come half a period early.
    assert 1 <= len(world.fixes) <= 1.5 + lasted_s / 10.0


@pytest.mark.parametrize(("together_s", "moments"), [(0.06, 1), (0.01, 2)])
def test_one_moment_has_one_picture_of_each_camera_the_newest(together_s, moments):
    gathering, begun = Gathering(timedelta(seconds=together_s)), datetime.now(UTC)
    for camera, after_ms in (("a", 0), ("b", 5), ("a", 40)):
        at = begun + timedelta(milliseconds=after_ms)
        sighting = Sighting(camera, 1, at, at, (640, 480), "whole", [])
        gathering.add(Picture(at, at, sighting))
    found = []
    while moment := gathering.complete(begun + timedelta(seconds=1)):
        found.append([(one.sighting.camera, one.taken_at - begun) for one in moment])
    assert len(found) == moments
    assert all(len({camera for camera, _ in moment}) == len(moment) for moment in found)
    assert ("a", timedelta(milliseconds=40)) in found[-1]


async def test_fixes_that_were_sent_are_noted_once_storage_works_again(
    foundation, filming, monkeypatch
):
    async def fails(_):
        raise StoreUnavailableError("the disk is full")

    monkeypatch.setattr(records, "SENT_MAX", 5)
    kept = records.FixRecords(foundation.store, foundation.clock, foundation.bus, None)
    at, marked = foundation.clock.now(), []
    monkeypatch.setattr(records, "mark_sent", lambda _, robot, *__: marked.append(robot))
    with monkeypatch.context() as failing:
        failing.setattr(foundation.store, "write", fails)
        for number in range(8):
            kept.note_sent(SimpleNamespace(robot=number, measured_at=at), at)
            await kept.flush()
    await kept.flush()
    assert marked == [3, 4, 5, 6, 7]


async def test_a_tag_that_nobody_knows_is_listed_as_a_stranger(client, filming):
    listed = await filming.until_found(OTHER.tags, HERE, lambda: strangers(client))
    assert {one["tag"] for one in listed} <= {3, 4, 5}
    assert listed[0]["camera"].startswith("tank-")


async def strangers(client):
    return (await client.get("/api/tags/strangers")).json()


async def test_without_calibration_the_link_says_so(client, station, foundation):
    await give_link(client)
    text = "Cameras never saw mini-1: no camera is calibrated."

    def is_told():
        return row(foundation, station).text == text

    await Cameraman(foundation).until_found(ROBOT.tags, HERE, is_told)


async def test_a_refused_fix_is_kept_with_its_reason_and_not_sent(client, world, filming):
    far = Pose.of_angles([2.0, 1.4, 1.19], 0.0, 0.0, 0.0)
    above = Pose(far.rotation, np.array([2.0, 1.4, -0.5]))
    rows = await filming.until_found(ROBOT.tags, above, lambda: fixes(client))
    assert rows[-1]["quality"] == "refused"
    assert rows[-1]["reason"] == "the position is outside of the water"
    told = (await client.get("/api/robots/mini-1/fixes")).json()
    assert told["refused"]["the position is outside of the water"] >= 1
    assert world.fixes == []


async def test_fixes_are_kept_at_most_five_times_a_second_and_thinned_out(client, filming):
    start = filming._foundation.clock.now()
    await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    for _ in range(30):
        filming.shoot((ROBOT.tags, HERE))
        await asyncio.sleep(0.05)

    async def at_rest():
        before, some, after = (
            await fixes(client),
            await fixes(client, max_points=3),
            await fixes(client),
        )
        return (before, some) if before == after else None

    rows, thinned = await until(at_rest)
    begin, end = (np.datetime64(rows[i]["measured_at"].rstrip("Z")) for i in (0, -1))
    lasted_s = (end - begin) / np.timedelta64(1, "s")
    assert len(rows) <= 5.0 * lasted_s + 2.0
    assert len(thinned) <= 3
    assert thinned[-1] == rows[-1]
    early = await fixes(client, end=start.isoformat())
    assert early == []
    answer = await client.get(
        "/api/robots/mini-1/fixes",
        params={"start": (start + timedelta(hours=1)).isoformat(), "end": start.isoformat()},
    )
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"] == ["query", "start"]


async def test_a_robot_that_contradicts_the_cameras_raises_an_alarm_until_it_agrees(
    client, station, world, filming, foundation
):
    def standing():
        return foundation.alarms.standing(CAUSE, "mini-1")

    def say(place):
        world.tell(state_report(MINI, place, foundation.clock.now()))

    def contradict():
        say((1.0, 0.5, 0.5))
        return standing()

    alarm = await filming.until_found(ROBOT.tags, HERE, contradict)
    assert "m from where cameras see it" in alarm.text

    def agree():
        say(tuple(HERE.position_m.tolist()))
        return standing() is None

    await filming.until_found(ROBOT.tags, HERE, agree)


async def test_a_disagreement_ends_where_the_robot_is_unplugged_or_not_seen(
    station, world, filming, foundation, monkeypatch
):
    def standing():
        return foundation.alarms.standing(CAUSE, "mini-1")

    def contradict():
        world.tell(state_report(MINI, (1.0, 0.5, 0.5), foundation.clock.now()))
        return standing()

    await filming.until_found(ROBOT.tags, HERE, contradict)
    await station.disabled_links.set(LINK, is_enabled=False, robot="mini-1", by="ann")
    await until(lambda: standing() is None)
    await station.disabled_links.set(LINK, is_enabled=True, robot="mini-1", by="ann")
    await filming.until_found(ROBOT.tags, HERE, contradict)
    monkeypatch.setattr(follow, "UNSEEN", timedelta(seconds=1))
    await until(lambda: standing() is None)


async def test_an_alarm_that_robots_are_not_found_ends_with_the_last_link(
    client, filming, foundation, monkeypatch
):
    async def fails(*_):
        raise WorkerEndedError("it ended")

    def standing():
        return foundation.alarms.standing("fusion", None)

    monkeypatch.setattr(foundation.services.get(Fusion)._pool, "run", fails)
    await filming.until_found(ROBOT.tags, HERE, standing)
    await give_link(client, links=("xbee://127.0.0.1:9",))
    await until(lambda: standing() is None)


async def test_alarms_of_before_a_restart_end_where_nothing_is_wrong(
    tmp_path, world, client, foundation
):
    await foundation.alarms.raise_("fusion", "Robots are not found.")
    await foundation.alarms.raise_("fusion:robots", "More than can be followed.", level="watch")
    await foundation.alarms.raise_(CAUSE, "It is 2.0 m from where cameras see it.", robot=MINI)
    await foundation.alarms.save_waiting()
    async with open_station(tmp_path, world) as again:
        alarms = again.foundation.alarms
        for cause, robot in (("fusion", None), ("fusion:robots", None), (CAUSE, "mini-1")):
            await until(lambda of=(cause, robot): alarms.standing(*of) is None)


async def test_how_far_a_robot_is_off_is_a_channel_of_its_own(
    client, station, world, filming, foundation
):
    def off():
        place = HERE.position_m + np.array([0.0, 0.04, 0.0])
        world.tell(state_report(MINI, tuple(place.tolist()), foundation.clock.now()))
        return station.fleet.status(MINI).readings.get("off_cameras")

    told = await filming.until_found(ROBOT.tags, HERE, off)
    assert told.value == pytest.approx(0.04, abs=0.01)
    state = (await client.get("/api/robots/mini-1/state")).json()
    assert state["channels"]["off_cameras"]["unit"] == "m"


async def test_a_replay_tells_where_cameras_had_seen_the_robot(client, filming, foundation):
    rows = await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    first = rows[0]
    at = {"at": first["measured_at"], "clock": "measured"}
    then = (await client.get("/api/robots/mini-1/moment", params=at)).json()
    assert then["fix"]["measured_at"] == first["measured_at"]
    at["clock"] = "received"
    before_it_came = (await client.get("/api/robots/mini-1/moment", params=at)).json()
    assert before_it_came["fix"] is None


async def test_a_finding_process_that_dies_costs_a_moment_and_comes_back(
    client, filming, foundation
):
    found = await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    fusion = foundation.services.get(Fusion)
    pool: WorkerPool = fusion._pool
    (process,) = pool.process_ids()
    os.kill(process, signal.SIGKILL)
    await filming.until_found(ROBOT.tags, HERE, lambda: more(client, len(found) + 3))
    assert pool.process_ids() != (process,)


async def more(client, count):
    rows = await fixes(client)
    return rows if len(rows) >= count else None


async def test_kept_fixes_outlive_the_station(tmp_path, world, client, filming):
    rows = await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    async with open_station(tmp_path, world) as again:
        kept = await again.foundation.store.query(lambda session: list_fixes(session, "mini-1"))
    assert len(kept) >= len(rows)


async def test_fixes_of_a_deployment_are_exported_with_their_reasons(client, filming, foundation):
    rows = await filming.until_found(ROBOT.tags, HERE, lambda: fixes(client))
    status = foundation.services.get(Fleet).status(MINI)
    path = f"/api/deployments/{status.deployment.id}/export"
    answer = await client.get(path, params={"format": "fixes"})
    assert answer.status_code == 200, answer.text
    lines = [line for line in answer.text.splitlines() if not line.startswith("#")]
    written = list(csv.DictReader(lines))
    assert len(written) >= len(rows)
    assert float(written[0]["north_m"]) == pytest.approx(rows[0]["ned_m"][0], abs=1e-4)
    assert written[0]["cameras"] == "tank-1;tank-2;tank-3"
    assert written[0]["quality"] == "good"
