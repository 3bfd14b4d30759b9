"""A station whose lake robot is heard by satellite alone."""

import pytest
import pytest_asyncio

from tests.server.far import far_station, place_under, settled
from tests.server.sky import ManualClock, Sky


@pytest.fixture
def sky():
    return Sky(ManualClock())


@pytest.fixture
def robot(sky, tmp_path):
    return place_under(sky, tmp_path)


@pytest_asyncio.fixture
async def far(tmp_path, world, sky, robot, monkeypatch):
    """The station and its client; the robot has just called."""
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
        await robot.call()
        await settled(station)
        yield station, client


@pytest.fixture
def no_radio(world):
    """No radio reaches a robot, whatever is sent."""
    world.in_reach = False
