"""Ranges by acoustic modem: asked for again and again, kept good or bad, and their link shown."""

import asyncio
from contextlib import asynccontextmanager
from dataclasses import replace
from random import Random

import pytest

from db.query.fleet.robots import add_robot
from db.query.measured.ranges import list_ranges
from db.store import Store
from robot_link.acoustic.micromodem import MicroModem
from robot_link.messages import LinkState, RobotId, SystemId
from robot_link.station.gateway.address import acoustic_address
from server.app import create_app
from server.base.settings import Settings
from server.link.ranging import Ranging
from server.plan import install as plan
from server.station import Station
from simulator.acoustic_modem import AcousticConditions, AcousticModem, AcousticNode
from tests.robot_link.test_acoustic_modem import (
    HASTE,
    PATIENT,
    SOON_SILENT,
    FakeModem,
    replying,
    scaled_clock,
)
from tests.server.conftest import until
from tests.server.fake_link import World
from tests.server.gateway_station import _tables, blank_database, robot, station
from tests.server.station_app import signed_in

__all__ = ["_tables", "blank_database"]
GRACE, MINI = RobotId("grace-1"), RobotId("mini-1")
LINK = "micromodem:///dev/ttyS9?us=1&peer=2"
OTHER = "micromodem:///dev/ttyS9?us=1&peer=3"
NEAR = {"range_max_m": 1.0, "turnaround_s": 0.0, "period_s": 5.0}


@asynccontextmanager
async def ranging(tmp_path, fake, reports, timing=PATIENT):
    """Ranging of a station whose robots share one modem, on a clock that runs 20 times as fast."""
    opened = []

    def open_(links, clock):
        opened.append(dict(links))
        robots = {acoustic_address(uri).peer: robot_id for robot_id, uri in links.items()}
        return MicroModem(fake.open, 1, robots, clock, timing=timing)

    async with station(tmp_path) as app:
        foundation = replace(app.state.foundation, clock=scaled_clock(20.0))
        await foundation.store.write(lambda session: add_robot(session, robot((LINK,))))
        await foundation.store.write(lambda session: add_robot(session, mini()))
        await foundation.configurations.patch("acoustic", None, NEAR, by="test")
        service = Ranging(foundation, reports.append, open_)
        service.opened = opened
        service.store = foundation.store
        service.app = app
        try:
            yield service
        finally:
            await service.stop()


def mini():
    return replace(robot((OTHER,)), id=MINI, name="mini-1", system_id=SystemId(1))


async def kept(store, robot_id, count):
    async with asyncio.timeout(60):
        while True:
            found = await store.query(lambda session: list_ranges(session, robot_id))
            if len(found) >= count:
                return found
            await asyncio.sleep(0.005)


async def shown(reports, robot_id, state):
    async with asyncio.timeout(60):
        while True:
            newest = [one for one in reports if one.robot == robot_id][-1:]
            if newest and newest[0].state is state:
                return newest[0]
            await asyncio.sleep(0.005)


async def test_each_robot_is_asked_and_its_answer_is_kept(tmp_path):
    reports = []
    fake = FakeModem({"CCMPC": lambda fields: replying(*fields[1:3])(fields)})
    async with ranging(tmp_path, fake, reports) as service:
        await service.set_robots([robot((LINK,)), mini()])
        assert service.opened == [{GRACE: LINK, MINI: OTHER}]
        for robot_id, peer in ((GRACE, 2), (MINI, 3)):
            (found, *_) = await kept(service.store, robot_id, 1)
            assert (found.peer, found.is_valid, found.range_m) == (peer, True, pytest.approx(0.6))
            report = await shown(reports, robot_id, LinkState.LIVE)
            assert (report.carrier, report.frames_received >= 1) == ("micromodem", True)
        assert report.uri == OTHER
        await kept(service.store, GRACE, 2)
        async with signed_in(service.app) as client:
            answer = (await client.get(f"/api/robots/{GRACE}/ranges?limit=1")).json()
            assert (await client.get("/api/robots/nobody/ranges")).status_code == 404
    assert len(answer["ranges"]) == 1
    assert answer["ranges"][0]["range_m"] == pytest.approx(0.6)


async def test_silence_is_kept_as_a_range_that_is_not_valid(tmp_path):
    reports = []
    async with ranging(tmp_path, FakeModem(), reports, SOON_SILENT) as service:
        await service.set_robots([robot((LINK,))])
        await shown(reports, GRACE, LinkState.NEVER_HEARD)
        (found, *_) = await kept(service.store, GRACE, 1)
    assert (found.is_valid, found.range_m) == (False, None)
    assert "no answer" in found.reason


async def test_the_speed_of_sound_that_the_operator_sets_holds_from_the_next_range_on(tmp_path):
    fake = FakeModem({"CCMPC": replying("1", "2", travel="0.0010")})
    async with ranging(tmp_path, fake, []) as service:
        await service.set_robots([robot((LINK,))])
        await kept(service.store, GRACE, 1)
        configurations = service.app.state.foundation.configurations
        await configurations.patch("acoustic", GRACE, {"sound_speed_m_s": 1400.0}, by="test")
        under_way = 1
        before = len(await kept(service.store, GRACE, 1))
        (newest, *_) = await kept(service.store, GRACE, before + under_way + 1)
        assert newest.range_m == pytest.approx(1.4)


async def test_a_pulled_plug_stops_the_asking_and_is_shown(tmp_path):
    reports, fake = [], FakeModem({"CCMPC": replying("1", "2")})
    async with ranging(tmp_path, fake, reports) as service:
        service.set_enabled(LINK, is_enabled=False)
        await service.set_robots([robot((LINK,))])
        report = await shown(reports, GRACE, LinkState.DISABLED)
        assert not report.is_enabled
        assert await kept(service.store, GRACE, 0) == []
        assert fake.commands == []
        service.set_enabled(LINK, is_enabled=True)
        await shown(reports, GRACE, LinkState.LIVE)


async def test_links_that_stay_keep_their_modem_and_links_that_go_lose_it(tmp_path):
    reports, fake = [], FakeModem({"CCMPC": replying("1", "2")})
    async with ranging(tmp_path, fake, reports) as service:
        for _ in range(2):
            await service.set_robots([robot((LINK, "xbee:///dev/ttyUSB0"))])
        assert service.opened == [{GRACE: LINK}]
        await service.set_robots([robot(("xbee:///dev/ttyUSB0",))])
        await service.set_robots([robot((LINK,)), mini()])
        assert service.opened == [{GRACE: LINK}, {GRACE: LINK, MINI: OTHER}]


async def test_robots_that_change_twice_at_once_open_a_modem_once(tmp_path):
    reports, fake = [], FakeModem({"CCMPC": replying("1", "2")})
    async with ranging(tmp_path, fake, reports) as service:
        await service.set_robots([robot((LINK,))])
        both = [robot((LINK,)), mini()]
        await asyncio.gather(service.set_robots(both), service.set_robots(both))
        assert service.opened == [{GRACE: LINK}, {GRACE: LINK, MINI: OTHER}]


async def test_links_that_name_one_modem_twice_are_left_alone(tmp_path):
    reports = []
    async with ranging(tmp_path, FakeModem(), reports) as service:
        strange = replace(mini(), links=(LINK, "micromodem://broken"))

        def refuse(links, clock):
            raise ValueError(f"{len(links)} links of one modem, by {clock}")

        service._open = refuse
        await service.set_robots([robot((LINK,)), strange])
    assert reports == []


async def test_the_whole_station_asks_a_robot_whose_modem_is_at_a_line(tmp_path, monkeypatch):
    async def stay_cold(*_):
        pass

    monkeypatch.setattr(plan, "warm_up", stay_cold)
    line = tmp_path / "modem"
    under_water = {2: AcousticNode(lambda: (30.0, 40.0, 0.0))}
    clock = scaled_clock(20.0)
    modem = AcousticModem(
        lambda: (0.0, 0.0, 0.0), under_water, Random(4), AcousticConditions(), clock
    )
    settings = Settings(data_dir=tmp_path, worker_processes=1)
    store = Store.open(settings.resolved_database_url)
    links = (f"micromodem://{line}?us=1&peer=2",)
    store.change(lambda session: add_robot(session, robot(links))).result()
    store.close()
    world = World()
    app = create_app(settings, lambda foundation: Station(foundation, world.make_link))

    async def valid():
        found = await app.state.foundation.store.query(lambda session: list_ranges(session, GRACE))
        return next((one for one in found if one.is_valid), None)

    async with modem.pty(line), app.router.lifespan_context(app), signed_in(app) as client:
        found = await until(valid)  # a busy machine may be late with the first, a minute before
        (link,) = (await client.get("/api/robots/grace-1/links")).json()
        shown_robot = (await client.get("/api/robots/grace-1/state")).json()
    assert found.range_m == pytest.approx(50.0, abs=6.0)
    assert (link["kind"], link["state"], link["carries"]) == ("acoustic", "live", ["range"])
    assert shown_robot["link"]["state"] == "never_heard"


@pytest.mark.parametrize("is_deaf_at_first", [True, False])
async def test_a_modem_that_does_not_answer_is_mute_and_no_port_to_plug_in(
    tmp_path, is_deaf_at_first
):
    reports, fake = [], FakeModem({"CCMPC": replying("1", "2")})
    fake.is_deaf = is_deaf_at_first
    async with ranging(tmp_path, fake, reports, HASTE) as service:
        await service.set_robots([robot((LINK,))])
        if not is_deaf_at_first:
            await shown(reports, GRACE, LinkState.LIVE)
            fake.is_deaf = True
        await shown(reports, GRACE, LinkState.MUTE)
        fake.is_deaf = False
        await shown(reports, GRACE, LinkState.LIVE)
