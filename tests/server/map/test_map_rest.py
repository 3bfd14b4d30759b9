"""Maps that nobody looks at give up their factors, and are whole when somebody does look."""

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from autonomy.channel import CHANNELS
from autonomy.field.config import FIELD_PRESETS, GridShape
from autonomy.field.grid import Grid
from autonomy.site import TANK
from robot_link.messages import LogId, Sample
from server.map import rest
from server.map.rest import MapRest
from server.map.site_map import SiteMap
from tests.server.conftest import MINI, until
from tests.server.watch.test_metrics import figures_of

PATH = f"/api/robots/{MINI}/maps/blue_light"
PLACES = [(0.2 + 0.1 * i, 0.3 + 0.04 * i, 0.02 * i) for i in range(20)]
BEGIN = datetime(2026, 7, 1, tzinfo=UTC)
MB = 1_000_000


def tank_map(model="single"):
    config = FIELD_PRESETS["blue_light"].model_copy(
        update={"model": model, "grid": GridShape(x=5, y=4, z=3)}
    )
    grid = Grid.over(TANK.domain, config.grid)
    return SiteMap(config, CHANNELS["blue_light"], grid, (MINI,))


def sample(number, place):
    at = BEGIN + timedelta(seconds=number)
    return Sample(MINI, LogId(1), number, "blue_light", 50.0 + number, place, 0.02, at, at)


def samples(places, begin=0):
    return [sample(begin + i, place) for i, place in enumerate(places)]


class Live:
    """A map of which only its size matters."""

    def __init__(self, size_mb):
        self.memory_bytes = size_mb * MB
        self.is_at_rest = False

    def rest(self):
        self.memory_bytes, self.is_at_rest = 0, True


def group(size_mb, looked_s=-np.inf, **changes):
    fields = {"live": Live(size_mb), "looked_s": looked_s, "due_s": 0.0, "is_stale": False}
    return SimpleNamespace(**fields | changes)


@pytest.fixture
def now(monkeypatch):
    clock = SimpleNamespace(s=1000.0)
    monkeypatch.setattr(rest.time, "monotonic", lambda: clock.s)
    return clock


def test_map_that_rested_is_the_map_of_all_its_samples():
    rested, steady = tank_map(), tank_map()
    for begin in (0, 10):
        for one in (rested, steady):
            one.append(samples(PLACES[begin : begin + 10], begin))
        rested.rest()
        assert rested.is_at_rest
        assert rested.memory_bytes == 0
    assert rested.total == steady.total == 20
    assert rested.view.mean == pytest.approx(steady.view.mean, abs=1e-9)
    assert rested.view.std == pytest.approx(steady.view.std, abs=1e-9)
    points = np.array(PLACES) + 0.05
    assert rested.predict(points).mean == pytest.approx(steady.predict(points).mean, abs=1e-9)
    assert not rested.is_at_rest


def test_map_that_rests_knows_samples_that_it_has_already():
    one = tank_map()
    one.append(samples(PLACES))
    before = one.view
    one.rest()
    one.append(samples(PLACES[:5]))
    assert one.view is before
    assert one.is_at_rest


def test_maps_keep_no_more_than_there_is_room_for(now):
    seen = [group(50, looked_s=now.s) for _ in range(5)]
    unseen = [group(6) for _ in range(5)]
    MapRest().let([*unseen, *seen])
    assert [one.live.is_at_rest for one in seen] == [False, False, True, True, True]
    assert [one.live.is_at_rest for one in unseen] == [False, False, True, True, True]


def test_map_that_is_looked_at_alone_has_room_whatever_its_settings(now):
    large, small = group(900, looked_s=now.s), group(1, looked_s=now.s)
    MapRest().let([large, small])
    assert not large.live.is_at_rest
    assert small.live.is_at_rest
    now.s += rest.LOOKED_AT_S
    MapRest().let([large])
    assert large.live.is_at_rest


def test_map_is_due_at_once_when_somebody_looks_and_else_in_its_turn(now):
    maps = MapRest()
    first, second = group(1, is_stale=True), group(1, is_stale=True)
    assert maps.due([first, second]) == [first]
    first.is_stale = False
    now.s += 2.0
    maps.made(first, began_s=now.s - 2.0)
    first.is_stale = True
    assert maps.due([first, second]) == []
    maps.look(first)
    assert maps.due([first, second]) == [first]
    now.s += 2.0 * rest.UNSEEN_FACTOR
    maps.look(first)
    assert maps.due([first, second]) == [first, second]


async def test_map_that_nobody_looked_at_is_whole_soon_after_somebody_does(
    client, station, world, monkeypatch
):
    monkeypatch.setattr(rest, "UNSEEN_BYTES", 0)
    monkeypatch.setattr(rest, "UNSEEN_FACTOR", 1e9)
    map_group = await until(lambda: station.maps.group(MINI))
    for count in (1, 2):  # the second is in a map made anew, the last that nobody asked for
        world.robots[MINI].sample(PLACES[count - 1])
        await until(
            lambda count=count: map_group.live is not None and map_group.live.total == count
        )
    for place in PLACES[2:]:
        world.robots[MINI].sample(place)
    await until(lambda: map_group.is_stale)
    assert map_group.live.is_at_rest
    assert map_group.live.total == 2

    async def is_whole():
        answer = await client.get(PATH)
        return answer.status_code == 200 and answer.json()["samples"]["total"] == len(PLACES)

    await until(is_whole)
    assert not map_group.live.is_at_rest
    scraped = figures_of((await client.get("/metrics")).text)
    assert scraped["grace_map_memory_bytes", ()] == map_group.live.memory_bytes > 0
    assert scraped["grace_maps", (("state", "awake"),)] >= 1


async def test_map_that_nobody_looks_at_follows_its_samples_by_itself(
    client, station, world, monkeypatch
):
    monkeypatch.setattr(rest, "UNSEEN_BYTES", 0)
    monkeypatch.setattr(rest, "UNSEEN_FACTOR", 1.0)
    map_group = await until(lambda: station.maps.group(MINI))
    for place in PLACES:
        world.robots[MINI].sample(place)
    await until(lambda: map_group.live is not None and map_group.live.total == len(PLACES))
    await until(lambda: map_group.live.is_at_rest)
