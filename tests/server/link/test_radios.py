"""The plug of a radio that several robots share."""

import asyncio
from dataclasses import replace

import pytest

from db.query.fleet.robots import list_robots
from robot_link.clock import SystemClock
from robot_link.messages import RobotId, SystemId
from server.base.secret import SecretStore
from server.fleet.disabled_links import DisabledLinks
from server.link.radios import Radios
from server.link.signing import RobotSigning
from tests.server.conftest import MINI
from tests.server.fake_link import World

RADIO = "xbee:///dev/ttyUSB0"
FIRST, SECOND = f"{RADIO}#1", f"{RADIO}#2"


@pytest.fixture
def world():
    return World()


@pytest.fixture
def radios(world, tmp_path):
    clock = SystemClock()
    signing = RobotSigning(SecretStore(tmp_path), clock)
    return Radios(clock, lambda _event: None, world.make_link, signing)


@pytest.fixture
def robots(foundation):
    with foundation.store.read() as session:
        mini = next(robot for robot in list_robots(session) if robot.id == MINI)
    other = replace(mini, id=RobotId("mini-2"), system_id=SystemId(7), links=(SECOND,))
    return [replace(mini, links=(FIRST,)), other]


def is_open(world):
    """Return whether the shared radio was left plugged in."""
    return world.switched[-1][1]


async def test_robots_that_share_a_radio_share_its_plug(radios, world, robots):
    radios.set_robots(robots)
    radios.set_enabled(FIRST, is_enabled=False)
    assert not is_open(world)
    radios.set_enabled(SECOND, is_enabled=True)
    assert is_open(world)


async def test_both_robots_links_show_a_shared_plug_as_it_is(foundation):
    disabled_links = DisabledLinks(foundation.store, foundation.clock, foundation.bus)
    await disabled_links.set(FIRST, is_enabled=False, robot="mini-1", by="test")
    assert not disabled_links.is_enabled(SECOND)
    again = DisabledLinks(foundation.store, foundation.clock, foundation.bus)
    await again.load()
    assert not again.is_enabled(FIRST)
    await again.set(SECOND, is_enabled=True, robot="mini-1", by="test")
    assert again.is_enabled(FIRST)


async def test_links_that_are_disabled_at_once_are_both(foundation):
    links = DisabledLinks(foundation.store, foundation.clock, foundation.bus)
    ports = [f"serial:///dev/tty{number}" for number in range(4)]
    async with asyncio.TaskGroup() as people:
        for port in ports:
            people.create_task(links.set(port, is_enabled=False, robot="mini-1", by="test"))
    again = DisabledLinks(foundation.store, foundation.clock, foundation.bus)
    await again.load()
    assert links.disabled == again.disabled == set(ports)


async def test_a_radio_that_comes_back_finds_its_plug_as_it_was_left(radios, world, robots):
    radios.set_robots(robots)
    radios.set_enabled(FIRST, is_enabled=False)
    radios.set_robots([])
    world.switched.clear()
    radios.set_robots(robots)
    assert world.switched == [(RADIO, False)]
