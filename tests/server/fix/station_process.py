"""A station that follows a robot by three camera processes, and says of each fix that it is kept.

``python -m tests.server.fix.station_process FOLDER`` runs until it is killed. Each line is what a
client may count upon: the moment of a fix that the live stream told to be there, from the first on
that all cameras made together. It waits for cameras and takes their pictures however late they are.
"""

import asyncio
import sys
from datetime import timedelta
from pathlib import Path

from db.query.camera.fixes import list_fixes
from server.access.role import Role
from server.camera import child, moment
from server.fix import fusion, gathering
from server.fix.event import FixesStored
from tests.server.conftest import MINI, api_client, open_station
from tests.server.fake_link import World, state_report
from tests.server.fix.sighted import CAMERAS, calibrate, give_link


async def main(folder: Path) -> None:
    child.COMMAND = (sys.executable, "-m", "tests.server.fix.camera_stand_in")
    gathering.HOLD = gathering.LATELY = timedelta(minutes=1)
    gathering.OLDEST = fusion.OLDEST = timedelta(minutes=1)
    moment.OLDEST_S = 60.0
    world = World()
    async with open_station(folder, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        async with api_client(station, Role.ADMIN) as client:
            await calibrate(station.foundation, client)
            await give_link(client)
        news: asyncio.Queue[FixesStored] = asyncio.Queue()
        station.foundation.bus.subscribe(FixesStored, news.put_nowait)
        told = None
        while True:
            await news.get()
            for one in await station.foundation.store.query(lambda s: list_fixes(s, MINI)):
                if told is None and len(one.fix.cameras) < len(CAMERAS):
                    continue
                if told is None or one.fix.measured_at > told:
                    told = one.fix.measured_at
                    sys.stdout.write(f"{told.isoformat()}\n")
                    sys.stdout.flush()


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1])))
