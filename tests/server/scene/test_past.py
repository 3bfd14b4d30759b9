"""The 3D view of a moment: what the station believed then, and nothing goes out of it."""

import asyncio
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
import viser
import websockets

from db.query.fleet.robots import robot_key
from db.query.measured.maps import add_map
from db.tables import StateRow
from robot_link.messages import RobotMode
from server.access.role import Role
from server.map.record import record_of
from server.scene import past_host
from server.scene.past_host import PastScenes
from tests.server.conftest import MINI, until
from tests.server.scene.test_pipe import CAMERA, control, say, update
from tests.server.station_app import bearer, token_of
from tests.server.transfer.test_upload import draft, plan_in, upload
from tests.webui.fake_source import lake_source

SECOND = timedelta(seconds=1)


async def report(station, measured, received, depth_m, north_m=1.0):
    """Keep what a robot measured at one moment and the station heard at another."""

    def write(session):
        session.add(
            StateRow(
                robot_key=robot_key(session, MINI), measured_at=measured, received_at=received,
                north_m=north_m, east_m=0.5, depth_m=depth_m, position_std_m=0.1, has_fix=False,
                mode=int(RobotMode.GLIDING), pitch_rad=-0.3,
            )
        )  # fmt: skip

    await station.foundation.store.write(write)


async def told(client, at, robot=MINI):
    answer = await client.get(f"/api/robots/{robot}/view/at/{at.isoformat()}")
    assert answer.status_code == 200, answer.text
    return answer.json()


async def past(station, at, robot=MINI):
    return await station.foundation.services.get(PastScenes).scene(robot, at)


def place(scene):
    pose = scene._source.pose()
    return None if pose is None else pose.position_ned


async def test_the_robot_stands_where_it_was_believed_to_be_not_where_it_told_later_to_have_been(
    client, station
):
    now = datetime.now(UTC)
    dived, silent = now - 60 * SECOND, now - 40 * SECOND
    await report(station, dived, dived, 0.1)
    await report(station, dived + 10 * SECOND, now - 20 * SECOND, 0.9, north_m=1.4)
    then = await past(station, silent)
    assert place(then.scene) == (1.0, 0.5, 0.1), "that it was deeper came twenty seconds later"
    assert then.scene._source.pose().is_old, "a past view never looks alive"
    way = then.scene._source.track_since(0)
    assert way.position_ned[:, 2].tolist() == [0.1]
    found = await told(client, silent)
    assert datetime.fromisoformat(found["measured_at"]) == dived
    after = await past(station, now - 10 * SECOND)
    assert place(after.scene) == (1.4, 0.5, 0.9)
    assert (await told(client, now - 90 * SECOND))["measured_at"] is None
    assert place((await past(station, now - 90 * SECOND)).scene) is None


async def test_a_past_view_does_not_move_when_the_robot_does(client, world, station):
    now = datetime.now(UTC)
    await report(station, now - 60 * SECOND, now - 60 * SECOND, 0.1)
    then = await past(station, now - 30 * SECOND)
    await report(station, now - 5 * SECOND, now - 5 * SECOND, 0.7)
    assert (await past(station, now - 30 * SECOND)) is then
    assert place(then.scene) == (1.0, 0.5, 0.1)
    assert then.scene._source.title.endswith("not live")


async def test_the_map_is_the_one_that_was_kept_last_before_and_its_age_is_told(client, station):
    now = datetime.now(UTC)
    begun = (await client.get(f"/api/robots/{MINI}")).json()["deployment"]["started_at"]
    start = datetime.fromisoformat(begun)
    view = lake_source().map_view("recursive")
    for number in (1, 2, 3):
        kept = record_of(MINI, replace(view, mean=np.full_like(view.mean, number)), None,
                         start + number * 0.25 * (now - start))  # fmt: skip
        await station.foundation.store.write(lambda session, kept=kept: add_map(session, kept))
    between = start + 0.6 * (now - start)
    shown = (await told(client, between))["map"]
    assert datetime.fromisoformat(shown["kept_at"]) == start + 2 * 0.25 * (now - start)
    source = (await past(station, between)).scene._source
    (model,) = source.maps()
    assert float(source.map_view(model).mean.flat[0]) == 2.0
    assert (await told(client, start + 0.1 * (now - start)))["map"] is None
    assert (await past(station, start + 0.1 * (now - start))).scene._source.maps() == ()


async def test_the_plan_is_the_one_that_was_on_board_then(client, world, station):
    clock = station.foundation.clock
    plan = await draft(client)
    await plan_in(client, plan, "draft")
    before = clock.now()
    assert (await upload(client, plan)).status_code == 202
    await plan_in(client, plan, "on_board")
    after = clock.now()
    assert (await told(client, before))["plan"] is None
    found = await told(client, after)
    assert (found["plan"], found["plan_state"]) == (plan, "on_board")
    drawn = (await past(station, after)).scene._source.plan()
    assert (drawn.plan_id, drawn.state) == (plan, "on_board")
    assert (await past(station, before)).scene._source.plan() is None


async def test_nothing_but_a_camera_goes_into_a_past_view_not_even_of_a_pilot(
    client, address, station
):
    at = datetime.now(UTC)
    scene = (await past(station, at)).scene
    before = scene.state
    async with websockets.connect(
        f"ws://{address}/view/{MINI}/at/{at.isoformat().replace('+', '%2B')}",
        additional_headers=bearer(await token_of(client.app, Role.ADMIN)),
        subprotocols=[f"viser-v{viser.__version__}"],
        compression=None,
        max_size=None,
        max_queue=None,
    ) as stream:
        await say(
            stream,
            update(control(scene, "Opacity"), value=0.31),
            update(control(scene, "Track"), value=False),
            {"type": "GuiFormSubmitMessage", "uuid": control(scene, "Opacity")},
            CAMERA,
        )
        await until(lambda: scene.is_watched)
        await asyncio.to_thread(scene.update)
        assert scene.state == before
        assert stream.close_code is None


async def test_who_may_not_see_the_robot_sees_none_of_its_past(client, address):
    at = datetime.now(UTC).isoformat().replace("+00:00", "Z")
    from_outside = await token_of(client.app, Role.NONE)
    for path in (f"/api/robots/{MINI}/view/at/{at}", f"/view/{MINI}/at/{at}/"):
        refused = await client.get(path, headers=bearer(from_outside))
        assert refused.status_code in (403, 404), path
    with pytest.raises(websockets.InvalidStatus):
        await websockets.connect(
            f"ws://{address}/view/{MINI}/at/{at}",
            additional_headers=bearer(from_outside),
            subprotocols=[f"viser-v{viser.__version__}"],
        )


@pytest.mark.parametrize(
    ("at", "status"),
    [("3026-01-01T00:00:00Z", 422), ("0001-01-01T00:00:00Z", 422), ("yesterday", 422),
     ("2026-01-01T00:00:00", 422), ("9999-12-31T23:59:59-14:00", 422)],
)  # fmt: skip
async def test_what_is_no_moment_of_the_past_is_refused(client, at, status):
    for path in (f"/api/robots/{MINI}/view/at/{at}", f"/view/{MINI}/at/{at}/"):
        answer = await client.get(path)
        assert (answer.status_code, answer.json()["errors"][0]["loc"][-1]) == (status, "at")
    missing = await client.get(f"/api/robots/nobody/view/at/{datetime.now(UTC).isoformat()}")
    assert missing.status_code == 404


async def test_views_that_nobody_looks_at_make_room_for_others(client, station, monkeypatch):
    monkeypatch.setattr(past_host, "OPEN_MAX", 2)
    now = datetime.now(UTC)
    opened = [await past(station, now - number * SECOND) for number in range(3)]
    assert [one.scene.socket.exists() for one in opened] == [False, True, True]


async def test_the_page_of_a_past_view_is_marked_as_not_live(client):
    at = datetime.now(UTC).isoformat().replace("+00:00", "Z")
    page = await client.get(f"/view/{MINI}/at/{at}/")
    assert page.status_code == 200
    assert "not live" in page.text
    foreign = await client.get(f"/view/{MINI}/at/{at}/?websocket=ws://evil.example")
    assert foreign.status_code == 400
