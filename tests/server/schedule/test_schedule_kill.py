"""A real station that is killed between rows and bytes sends what it began, and once."""

import asyncio
import signal
import sys
from pathlib import Path

from db.query.mission.scheduled_sends import newest_scheduled_sends
from db.query.mission.transfers import open_transfers
from db.store import Store
from server.access.role import Role
from server.base.settings import Settings
from tests.server.conftest import MINI, api_client, open_station
from tests.server.fake_link import state_report
from tests.server.schedule.test_schedule import send_in
from tests.server.transfer.test_upload import plan_in

ROOT = Path(__file__).parents[3]


async def test_station_that_is_killed_as_it_sends_goes_on_and_sends_once(tmp_path, world):
    doomed = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "tests.server.schedule.doomed_station",
        str(tmp_path),
        cwd=ROOT,
        stdout=asyncio.subprocess.PIPE,
    )
    said, _ = await asyncio.wait_for(doomed.communicate(), 200)
    assert doomed.returncode == -signal.SIGKILL
    plan, send = said.decode().split()
    store = Store.open(Settings(data_dir=tmp_path).resolved_database_url)
    rows = store.change(lambda s: newest_scheduled_sends(s, MINI)).result(60)
    transfers = store.change(open_transfers).result(60)
    store.close()
    assert [row.state for row in rows] == ["sent"]
    assert [one.plan for one in transfers] == [plan], "both rows were there, and no byte"
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        await plan_in(client, plan, "on_board", "running", "done")
        await send_in(client, send, "done")
        assert len(world.uploads) == 1
