"""The cameras' server with real clients: what is sent, to whom, and when it ends."""

import asyncio
import contextlib
import threading
from contextlib import asynccontextmanager
from dataclasses import replace

import httpx
import numpy as np
import pytest

from autonomy.vision.lens import Lens
from robot_link.clock import SystemClock
from simulator.camera import stream
from simulator.camera.fault import faulty_camera, faulty_tank
from simulator.camera.laboratory import true_scene
from simulator.camera.painter import Painter
from simulator.camera.scene import Lighting, Sensor
from simulator.camera.stream import Account, CameraServer
from simulator.camera.tank import EmulatedTank
from tests.server.conftest import until

pytest.importorskip("cv2", reason="the extra camera is not installed")


def small_tank(count=1, **changes):
    """A tank whose cameras have small pictures; of its scene something may be otherwise."""
    scene = true_scene([], count)
    lens = Lens("pinhole", 320, 180, (184.0, 184.0), (159.5, 89.5))
    cameras = tuple(replace(camera, lens=lens) for camera in scene.cameras)
    return EmulatedTank(replace(scene, cameras=cameras, **changes), SystemClock())


@asynccontextmanager
async def served(tank, account=None, clients_max=16, fps=25.0):
    server = CameraServer(tank, account, fps=fps, clients_max=clients_max)
    async with server.serve() as url, httpx.AsyncClient(base_url=url, timeout=120.0) as client:
        yield server, client


async def jpegs(response):
    """The pictures of an answer, one after the other."""
    data = b""
    async for chunk in response.aiter_raw():
        data += chunk
        while b"\r\n\r\n" in data:
            head, _, rest = data.partition(b"\r\n\r\n")
            length = int(head.lower().partition(b"content-length: ")[2].split(b"\r\n")[0])
            if len(rest) < length + 2:
                break
            yield rest[:length]
            data = rest[length + 2 :]


def grey(jpeg):
    import cv2

    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)


@asynccontextmanager
async def watching(client, path="/camera/tank-1", **more):
    async with client.stream("GET", path, **more) as response:
        assert response.status_code == 200
        assert "multipart/x-mixed-replace" in response.headers["content-type"]
        pictures = jpegs(response)
        async with contextlib.aclosing(pictures):
            yield pictures


async def test_a_client_gets_picture_after_picture_of_the_camera_that_it_asks_for():
    async with served(small_tank(2)) as (_, client):
        shown = []
        for name in ("tank-1", "tank-2"):
            async with watching(client, f"/camera/{name}") as pictures:
                first, second = await anext(pictures), await anext(pictures)
            assert first != second
            assert grey(first).shape == (180, 320)
            shown.append(grey(first).astype(float))
        assert np.abs(shown[0] - shown[1]).mean() > 5.0


async def test_nothing_is_drawn_while_nobody_looks():
    async with served(small_tank(2)) as (server, client):
        async with watching(client) as pictures:
            await anext(pictures)
        await until(lambda: server.clients == 0)
        drawn = server.drawn("tank-1")
        await asyncio.sleep(0.3)
        assert server.drawn("tank-1") <= drawn + 1
        assert server.drawn("tank-2") == 0


async def test_a_client_that_does_not_read_holds_up_nobody(monkeypatch):
    monkeypatch.setattr(stream, "_STALLED_S", 600.0)  # a slow machine hangs up on nobody
    async with served(small_tank()) as (server, client):
        reader, writer = await asyncio.open_connection("127.0.0.1", client.base_url.port, limit=1)
        writer.write(b"GET /camera/tank-1 HTTP/1.1\r\nHost: x\r\n\r\n")
        await reader.read(1)
        async with watching(client) as pictures:
            for _ in range(60):
                await anext(pictures)
        assert server.clients == 2
        writer.close()


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [("GET", "/", 404), ("GET", "/camera/tank-9", 404), ("GET", "/tank-1", 404),
     ("POST", "/camera/tank-1", 405)],
)  # fmt: skip
async def test_what_is_no_camera_is_refused(method, path, status):
    async with served(small_tank()) as (_, client):
        assert (await client.request(method, path)).status_code == status


async def test_nonsense_ends_its_own_connection_alone():
    async with served(small_tank()) as (server, client):
        for nonsense in (b"\x00\xff\r\n\r\n", b"x" * 20000):
            reader, writer = await asyncio.open_connection("127.0.0.1", client.base_url.port)
            writer.write(nonsense)
            with contextlib.suppress(OSError):
                await reader.read()
            writer.close()
        await until(lambda: server.clients == 0)
        async with watching(client) as pictures:
            assert grey(await anext(pictures)).shape == (180, 320)


async def test_an_account_is_asked_for_where_there_is_one():
    async with served(small_tank(), Account("ann", "secret")) as (_, client):
        for auth in (None, ("ann", "wrong")):
            assert (await client.get("/camera/tank-1", auth=auth)).status_code == 401
        async with watching(client, auth=("ann", "secret")) as pictures:
            await anext(pictures)


async def test_no_more_clients_are_taken_than_there_is_room_for():
    async with served(small_tank(), clients_max=1) as (server, client):
        async with watching(client) as pictures:
            await anext(pictures)
            assert (await client.get("/camera/tank-1")).status_code == 503
        await until(lambda: server.clients == 0)
        async with watching(client) as pictures:
            await anext(pictures)


async def test_the_server_ends_while_clients_look():
    ended = asyncio.Event()

    async def look(client):
        async with client.stream("GET", "/camera/tank-1") as response:
            with contextlib.suppress(httpx.HTTPError):
                async for _ in jpegs(response):
                    pass
        ended.set()

    tank = small_tank()
    server = CameraServer(tank)
    async with httpx.AsyncClient(timeout=120.0) as client:
        async with server.serve() as url:
            client.base_url = url
            looking = asyncio.create_task(look(client))
            await until(lambda: server.drawn("tank-1") > 1)
        async with asyncio.timeout(60):
            await ended.wait()
        await looking
        with pytest.raises(httpx.ConnectError):
            await client.get("/camera/tank-1")


async def test_a_frozen_camera_sends_the_same_picture_and_goes_on_afterwards():
    tank = small_tank()
    camera = faulty_camera(tank, "tank-1")
    async with served(tank) as (_, client), watching(client) as pictures:
        last = await anext(pictures)
        camera.cause("frozen")
        while (shown := await anext(pictures)) != last:  # of before, on its way
            last = shown
        camera.mend("frozen")
        while await anext(pictures) == last:
            pass


async def test_a_cut_stream_ends_and_is_there_again_when_it_is_mended():
    tank = small_tank()
    camera = faulty_camera(tank, "tank-1")
    async with served(tank) as (_, client):
        async with watching(client) as pictures:
            await anext(pictures)
            camera.cause("cut")
            async for _ in pictures:
                pass
        with pytest.raises(httpx.RemoteProtocolError):
            await client.get("/camera/tank-1")
        camera.mend("cut")
        async with watching(client) as pictures:
            await anext(pictures)


async def test_a_silent_camera_says_nothing_until_it_is_mended():
    tank = small_tank()
    camera = faulty_camera(tank, "tank-1")
    async with served(tank) as (_, client), watching(client) as pictures:
        await anext(pictures)
        camera.cause("silent")
        waiting = asyncio.ensure_future(drained(pictures))
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(asyncio.shield(waiting), 1.5)
        camera.mend("silent")
        async with asyncio.timeout(60):
            await waiting


async def drained(pictures, count=8):
    """Take more pictures than may have been on their way."""
    for _ in range(count):
        await anext(pictures)


async def test_light_level_ripples_and_bumps_are_seen_in_the_pictures():
    still = {
        "lighting": Lighting(caustics_std=0.0),
        "sensor": Sensor(shot_variance=0.0, read_std=0.0),
    }
    tank = small_tank(**still)
    camera, water = faulty_camera(tank, "tank-1"), faulty_tank(tank)
    async with served(tank) as (_, client), watching(client) as pictures:
        usual = grey(await anext(pictures)).astype(float)

        async def until_off(least, most):
            """Wait for a picture that is as different from the usual one as that."""
            while not least <= np.abs(grey(await anext(pictures)) - usual).max() <= most:
                pass

        parts = ((camera, "bump"), (camera, "board"), (water, "level"), (water, "ripples"))
        for faulty, name in parts:
            faulty.cause(name)
            await until_off(15.0, 255.0)
            faulty.mend(name)
            await until_off(0.0, 3.0)
        water.cause("dark")
        while grey(await anext(pictures)).mean() >= 12.0:
            pass
        water.mend("dark")
        await until_off(0.0, 3.0)


async def test_drawing_leaves_the_event_loop_its_time(monkeypatch):
    true_picture, is_drawing, may_go_on = Painter.picture, threading.Event(), threading.Event()

    def picture(*arguments):
        is_drawing.set()
        assert may_go_on.wait(60.0), "the loop stands still"
        return true_picture(*arguments)

    monkeypatch.setattr(Painter, "picture", picture)
    async with served(small_tank()) as (_, client), watching(client) as pictures:
        await until(is_drawing.is_set)
        may_go_on.set()
        await anext(pictures)
