"""The 3D view of a replay: it shows the moment that its tab asks for, and takes nothing."""

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
from server.scene import replay_host
from server.scene.replay_host import ReplayScenes
from tests.server.conftest import MINI, until
from tests.server.scene.test_pipe import CAMERA, control, say, update
from tests.server.station_app import bearer, token_of
from tests.server.transfer.test_upload import draft, plan_in, upload
from tests.webui.fake_source import lake_source

SECOND = timedelta(seconds=1)
TAB = "0123456789abcdef" * 2


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


async def moved(client, at, clock="measured", tab=TAB):
    answer = await client.put(
        f"/api/robots/{MINI}/view/replay/{tab}", json={"at": at.isoformat(), "clock": clock}
    )
    assert answer.status_code == 200, answer.text
    return answer.json()


def scene_of(station, tab=TAB):
    return station.foundation.services.get(ReplayScenes).find(MINI, tab)


def source_of(station):
    return scene_of(station)._source


def place(station):
    pose = source_of(station).pose()
    return None if pose is None else pose.position_ned


def drawn_m(station):
    return sum(len(one.points) for one in scene_of(station)._track.survey.pieces.values())


async def test_the_robot_stands_where_it_was_or_where_it_was_believed_to_be(client, station):
    now = datetime.now(UTC)
    dived, silent = now - 60 * SECOND, now - 40 * SECOND
    await report(station, dived, dived, 0.1)
    await report(station, dived + 10 * SECOND, now - 20 * SECOND, 0.9, north_m=1.4)
    await moved(client, silent, "received")
    assert place(station) == (1.0, 0.5, 0.1), "that it was deeper came twenty seconds later"
    assert source_of(station).pose().is_old, "a past view never looks alive"
    shown = await moved(client, silent, "measured")
    assert place(station) == (1.4, 0.5, 0.9), "though it was told later, there it was"
    assert datetime.fromisoformat(shown["measured_at"]) == dived + 10 * SECOND
    assert (await moved(client, now - 90 * SECOND))["measured_at"] is None
    assert place(station) is None
    assert not scene_of(station)._robot._body.visible, "nothing is drawn where nothing was known"


async def test_the_track_grows_and_shrinks_with_the_cursor(client, station):
    now = datetime.now(UTC)
    for second in range(5):
        at = now - 60 * SECOND + second * SECOND
        await report(station, at, at, 0.1 * second, north_m=second)
    lengths = []
    for second in (0, 2, 4, 1):
        await moved(client, now - 60 * SECOND + second * SECOND)
        lengths.append(drawn_m(station))
    assert lengths == [0, 2, 4, 1]


async def test_what_came_after_the_replay_was_opened_is_replayed_too(client, station):
    now = datetime.now(UTC)
    await report(station, now - 60 * SECOND, now - 60 * SECOND, 0.1)
    await moved(client, now - 30 * SECOND)
    first = scene_of(station)
    later = station.foundation.clock.now()
    await report(station, later, later, 0.7)
    await moved(client, station.foundation.clock.now())
    assert place(station)[2] == 0.7
    assert scene_of(station) is not first, "the stretch was read anew"


async def test_the_map_is_the_one_that_was_kept_last_before(client, station):
    now = datetime.now(UTC)
    begun = (await client.get(f"/api/robots/{MINI}")).json()["deployment"]["started_at"]
    start = datetime.fromisoformat(begun)
    view = lake_source().map_view("recursive")
    for number in (1, 2, 3):
        kept = record_of(MINI, replace(view, mean=np.full_like(view.mean, number)), None,
                         start + number * 0.25 * (now - start))  # fmt: skip
        await station.foundation.store.write(lambda session, kept=kept: add_map(session, kept))
    versions = set()
    for share, value in ((0.6, 2.0), (0.3, 1.0)):
        shown = await moved(client, start + share * (now - start))
        assert datetime.fromisoformat(shown["map_kept_at"]) == start + value * 0.25 * (now - start)
        (model,) = source_of(station).maps()
        drawn = source_of(station).map_view(model)
        assert float(drawn.mean.flat[0]) == value
        versions.add(drawn.version)
        asked = {"at": (start + share * (now - start)).isoformat()}
        rest = await client.get(f"/api/robots/{MINI}/maps/{view.variable.key}", params=asked)
        assert set(rest.json()["mean"]) - {None} == {value}
    assert len(versions) == 2, "else the second would not be drawn"
    before = start + 0.1 * (now - start)
    assert (await moved(client, before))["map_kept_at"] is None
    assert source_of(station).maps() == ()
    none = await client.get(f"/api/robots/{MINI}/maps", params={"at": before.isoformat()})
    assert none.json() == []


async def test_the_plan_is_the_one_that_was_on_board_then(client, world, station):
    clock = station.foundation.clock
    plan = await draft(client)
    await plan_in(client, plan, "draft")
    before = clock.now()
    assert (await upload(client, plan)).status_code == 202
    await plan_in(client, plan, "on_board")
    after = clock.now()
    assert (await moved(client, before))["plan"] is None
    assert source_of(station).plan() is None
    assert (await moved(client, after))["plan"] == plan
    drawn = source_of(station).plan()
    assert (drawn.plan_id, drawn.state) == (plan, "on_board")
    told = await client.get(f"/api/robots/{MINI}/moment", params={"at": after.isoformat()})
    assert (told.json()["plan"]["id"], told.json()["plan"]["state"]) == (plan, "on_board")


async def test_nothing_but_a_camera_goes_into_a_replay_not_even_of_a_pilot(
    client, address, station
):
    await moved(client, datetime.now(UTC))
    scene = scene_of(station)
    before = scene.state
    async with websockets.connect(
        f"ws://{address}/view/{MINI}/replay/{TAB}",
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
    at = datetime.now(UTC).isoformat()
    from_outside = bearer(await token_of(client.app, Role.NONE))
    moving = await client.put(
        f"/api/robots/{MINI}/view/replay/{TAB}", json={"at": at}, headers=from_outside
    )
    asked = [
        await client.get(f"/api/robots/{MINI}/{one}", params={"at": at}, headers=from_outside)
        for one in ("moment", "timeline")
    ]
    page = await client.get(f"/view/{MINI}/replay/{TAB}/", headers=from_outside)
    assert {one.status_code for one in (moving, page, *asked)} <= {403, 404}
    with pytest.raises(websockets.InvalidStatus):
        await websockets.connect(
            f"ws://{address}/view/{MINI}/replay/{TAB}",
            additional_headers=from_outside,
            subprotocols=[f"viser-v{viser.__version__}"],
        )


@pytest.mark.parametrize(
    "at",
    ["3026-01-01T00:00:00Z", "0001-01-01T00:00:00Z", "yesterday", "2026-01-01T00:00:00",
     "9999-12-31T23:59:59-14:00"],
)  # fmt: skip
async def test_what_is_no_moment_of_the_past_is_refused(client, at):
    answers = [await client.put(f"/api/robots/{MINI}/view/replay/{TAB}", json={"at": at})]
    answers += [
        await client.get(f"/api/robots/{MINI}/{path}", params={"at": at})
        for path in ("moment", "timeline")
    ]
    for answer in answers:
        assert (answer.status_code, answer.json()["errors"][0]["loc"][-1]) == (422, "at")


async def test_a_tab_is_32_digits_and_a_robot_one_that_there_is(client):
    now = {"at": datetime.now(UTC).isoformat()}
    wrong = await client.put(f"/api/robots/{MINI}/view/replay/me", json=now)
    assert (wrong.status_code, wrong.json()["errors"][0]["loc"][-1]) == (422, "tab")
    missing = await client.put(f"/api/robots/nobody/view/replay/{TAB}", json=now)
    assert missing.status_code == 404


async def test_replays_that_nobody_looks_at_make_room_for_others(client, station, monkeypatch):
    monkeypatch.setattr(replay_host, "OPEN_MAX", 2)
    tabs = [f"{number:032x}" for number in range(3)]
    opened = []
    for tab in tabs:
        await moved(client, datetime.now(UTC), tab=tab)
        opened.append(scene_of(station, tab))
    assert [one.socket.exists() for one in opened] == [False, True, True]


async def test_the_page_of_a_replay_is_marked_as_not_live(client):
    page = await client.get(f"/view/{MINI}/replay/{TAB}/")
    assert page.status_code == 200
    assert "not live" in page.text
    foreign = await client.get(f"/view/{MINI}/replay/{TAB}/?websocket=ws://evil.example")
    assert foreign.status_code == 400
