"""What a browser may do to a scene that everybody sees, and who else may reach it."""

import os
import re
import stat
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest
import viser
import websockets

from server.access.role import Role
from server.scene.host import SceneHost
from tests.server.conftest import GRACE, until
from tests.server.station_app import bearer, token_of

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [0, 0, 1], "fov": 1,
    "near": 0.1, "far": 100, "image_height": 600, "image_width": 800, "look_at": [0, 0, 0],
    "up_direction": [0, 0, 1],
}  # fmt: skip


@pytest.fixture
async def scene(client, station):
    return await station.foundation.services.get(SceneHost).scene(GRACE)


def control(scene, label):
    handles = scene._server.gui._gui_input_handle_from_uuid
    return next(uuid for uuid, one in handles.items() if one.label == label)


def update(uuid, **updates):
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}


async def look_on(client, address, role):
    token = await token_of(client.app, role)
    return await websockets.connect(
        f"ws://{address}/view/{GRACE}",
        additional_headers=bearer(token),
        subprotocols=[f"viser-v{viser.__version__}"],
        compression=None,
        max_size=None,
        max_queue=None,
    )


async def say(stream, *messages):
    for message in messages:
        await stream.send(msgspec.msgpack.encode(message))


MADE_BY_MAPS = ("model", "models", "legend", "colours", "target_legend")
"""What changes by itself: a fit may end at any time."""


async def seen(client):
    """Return what is set, but for what a new map sets."""
    state = (await client.get(f"/api/robots/{GRACE}/view")).json()
    layers = [{**one, "has_content": None} for one in state.pop("layers")]
    return {**{key: one for key, one in state.items() if key not in MADE_BY_MAPS}, "layers": layers}


async def test_a_pilot_turns_a_knob_and_nothing_else(client, address, scene):
    opacity, box = control(scene, "Opacity"), control(scene, "Track")
    before = await seen(client)
    async with await look_on(client, address, Role.PILOT) as stream:
        await say(
            stream,
            CAMERA,
            update(opacity, removed=True),
            update(opacity, value=0.4, removed=True),
            update(opacity, value="much"),
            update(opacity, value=7.0),
            update(opacity, value=float("nan")),
            update(opacity, visible=False),
            update(box, value=0),
            update("nobody", value=0.4),
            {"type": "ShareUrlRequest"},
            {"type": "GuiFormSubmitMessage", "uuid": opacity},
            ["what"],
        )
        await stream.send("what")
        await stream.send(b"\xc1")
        await say(stream, update(opacity, value=0.31))

        async def changed():
            state = await seen(client)
            return state if state["opacity"] == 0.31 else None

        after = await until(changed)
        assert stream.close_code is None
    assert after == {**before, "opacity": 0.31}
    patched = await client.patch(f"/api/robots/{GRACE}/view", json={"opacity": 0.5})
    assert patched.json()["opacity"] == 0.5


async def test_a_viewer_changes_nothing_for_the_others(client, address, scene):
    before = await seen(client)
    async with await look_on(client, address, Role.VIEWER) as stream:
        await say(stream, update(control(scene, "Opacity"), value=0.31), CAMERA)
        await until(lambda: scene.is_watched)
        assert (await seen(client))["opacity"] == before["opacity"]


def listening_ports():
    """TCP ports on which this process listens."""
    ours = set()
    for path in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # another thread closed it meanwhile
            ours.add(os.readlink(path))
    rows = [
        line.split()
        for table in ("tcp", "tcp6")
        for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]
    ]
    return {row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in ours}


async def test_a_scene_has_no_port_and_its_socket_is_for_this_user_alone(client, station):
    before = listening_ports()
    scene = await station.foundation.services.get(SceneHost).scene(GRACE)
    assert listening_ports() <= before  # what an earlier test left may close meanwhile
    assert stat.S_ISSOCK(scene.socket.stat().st_mode)
    assert stat.S_IMODE(scene.socket.parent.stat().st_mode) == 0o700


async def test_a_scene_serves_no_tunnel_upload_command_or_form(scene):
    served = {message.__name__ for message in scene._server._websock_server._incoming_handlers}
    assert not [name for name in served if re.search("Share|File|Command|Form|Hold", name)]
    assert "GuiUpdateMessage" in served
