"""A station that is killed while it smooths and learns goes on where it was, and loses nothing."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from db.query.measured.samples import sample_columns
from db.query.station.configurations import configuration_history
from db.store import Store
from server.base.settings import Settings
from server.map.site_map import SiteMap
from tests.server.conftest import MINI, open_station, until

pytestmark = pytest.mark.process

CHILD = """
import asyncio
import sys
from datetime import timedelta
from pathlib import Path

from server.map import field_maps, learning, smoothing
from server.plan import install as plan
from tests.server.conftest import MINI, open_station, until
from tests.server.dive import begin_of, dive
from tests.server.fake_link import World

look, look_from, looks = smoothing.Smoothing.look, smoothing.Smoothing._look_from, []
is_told = asyncio.Event()


async def look_once_all_is_told(self, robot):
    return await look(self, robot) if is_told.is_set() else 0  # it is asked again


async def stop_at_the_second(self, robot, begin, fix):
    looks.append(begin)
    if len(looks) > 1:
        await asyncio.sleep(600.0)
    return await look_from(self, robot, begin, fix)


async def stay_cold(*_):
    pass


async def keep_nothing(*_):
    await asyncio.sleep(600.0)  # it learns until it is killed, however fast it is


async def main():
    world, begin = World(), begin_of(4)
    async with open_station(Path(sys.argv[1]), world) as station:
        await until(lambda: station.maps.group(MINI))
        for number in range(4):
            for one in dive(MINI, begin + timedelta(seconds=100 * number), first=20 * number):
                world.tell(one)
        await until(lambda: station.maps.group(MINI).live.total == 80)
        is_told.set()  # from the second look on nothing is fed any more
        job = await station.learning.start(MINI, "blue_light", by="test")
        await until(lambda: len(looks) > 1)
        (worker,) = await until(station.study_workers.process_ids)
        print(job, worker, flush=True)
        await asyncio.sleep(600.0)


plan.warm_up = stay_cold
field_maps.QUIET_S, smoothing.ROWS_PER_LOOK = 0.1, 40
smoothing.Smoothing.look = look_once_all_is_told
smoothing.Smoothing._look_from = stop_at_the_second
learning.MapLearning._keep = keep_nothing
asyncio.run(main())
"""


def columns(store):
    with store.read() as session:
        return sample_columns(session, MINI, "blue_light")


def is_running(process_id):
    try:
        state = Path(f"/proc/{process_id}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def kill_in_the_middle(folder):
    """Run a station until it smooths and learns, kill it; return the job and its process."""
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(folder)], stdout=subprocess.PIPE, text=True
    )
    try:
        job, worker = child.stdout.readline().split()
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()
        child.stdout.close()
    return job, int(worker)


async def test_station_killed_while_it_smooths_and_learns_goes_on_where_it_was(tmp_path, world):
    job, worker = kill_in_the_middle(tmp_path)
    await until(lambda: not is_running(worker))
    store = Store.open(Settings(data_dir=tmp_path).resolved_database_url)
    found = columns(store)
    store.close()
    assert len(found) == 80
    assert 0 < np.count_nonzero(found.is_smoothed) < 80
    async with open_station(tmp_path, world) as station:
        kept = station.foundation.store

        def made_of_all():
            group = station.maps.group(MINI)
            return group is not None and group.live.smoothed == 80 and group.live

        live = await until(made_of_all)
        anew = SiteMap.from_columns(
            live.config, live.channel, live.grid, live.robots, columns(kept)
        )
        np.testing.assert_allclose(live.view.mean, anew.view.mean, atol=1e-9)
        ended = await station.foundation.jobs.get(job)
        assert (ended.state, "start it again" in ended.message) == ("failed", True)
        assert await kept.query(lambda session: configuration_history(session, "field", MINI)) == []
