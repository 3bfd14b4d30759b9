"""The real process of a camera behind the robot's camera node, before a folder of pictures."""

import asyncio
import gc
import sys
from contextlib import asynccontextmanager, suppress

import cv2
import numpy as np
import pytest

from onboard.node.camera import STATE, TAGS, CameraNode
from onboard.node.camera_process import CameraProcess
from onboard.node.client import NodeClient
from robot_link.camera.sighting import SourceSettings
from simulator.background import alongside
from tests.robot_link.camera.drawn import scene
from tests.robot_link.rig import until

pytestmark = pytest.mark.process
WAIT_S = 120.0


@asynccontextmanager
async def node_of(source):
    node = CameraNode(source)
    async with node.server.serve() as address:
        client = NodeClient(address)
        tags, state = client.subscribe(TAGS), client.subscribe(STATE, 20)
        async with alongside(client.run(), "client"):
            await client.connected()
            await client.ask("describe")
            async with alongside(node.run(), "node"):
                yield tags, state


async def newest(subscription):
    async with asyncio.timeout(WAIT_S):
        return await subscription.get()


async def test_tags_in_pictures_are_published_with_the_count_of_their_moment(tmp_path):
    rng = np.random.default_rng(4)
    grey, corners = scene(rng, (1296, 972), {140: (400.0, 500.0, 90.0), 141: (900.0, 300.0, 60.0)})
    (tmp_path / "wall").mkdir()
    assert cv2.imwrite(str(tmp_path / "wall" / "0.png"), grey)
    settings = SourceSettings("onboard", "folder:wall?fps=2", folder=str(tmp_path))
    async with node_of(CameraProcess(settings, lambda: 1000.0)) as (tags, _):
        said = await newest(tags)
    assert sorted(tag["id"] for tag in said["tags"]) == [140, 141]
    assert 1000.0 - WAIT_S < said["count_s"] <= 1000.0
    for tag in said["tags"]:
        off = np.array(tag["corners_px"]) - corners[tag["id"]]
        assert np.sqrt(np.mean(off**2)) < 0.3
        assert 0.0 < tag["sigma_px"] < 1.0


async def test_a_camera_that_is_not_there_is_told_in_words():
    settings = SourceSettings("onboard", "v4l2:///dev/video99?fps=2")
    async with node_of(CameraProcess(settings, lambda: 0.0)) as (_, state):
        words = ""
        while "video99" not in words:
            words = (await newest(state))["words"]


async def test_a_process_that_speaks_nonsense_or_ends_is_begun_again(tmp_path):
    begun = tmp_path / "begun"
    command = (
        sys.executable,
        "-c",
        f"import sys; open({str(begun)!r}, 'a').write('x'); sys.stdout.write('\\xff' * 99)",
    )
    settings = SourceSettings("onboard", "folder:wall")
    async with node_of(CameraProcess(settings, lambda: 0.0, command)) as (_, state):
        assert "begun again" in (await newest(state))["words"]
        await until(lambda: begun.exists() and len(begun.read_text()) >= 2)


def test_whoever_stops_it_at_any_moment_leaves_no_process_behind():
    command = (sys.executable, "-S", "-c", "import sys; sys.stdout.write('\\xff' * 99)")
    camera = CameraProcess(SourceSettings("onboard", "folder:wall"), lambda: 0.0, command)

    async def look():
        async for _ in camera.views():
            pass

    async def look_for(wait_s):
        looking = asyncio.create_task(look())
        await asyncio.sleep(wait_s)
        looking.cancel()
        with suppress(asyncio.CancelledError):
            await looking

    for wait_s in np.random.default_rng().uniform(0.0, 0.1, 30):
        asyncio.run(look_for(wait_s))
    # A transport that was left open warns when it is collected, which fails the test.
    gc.collect()
