"""A station in a process of its own that is killed the moment a tick was answered.

python -m tests.server.checklist.doomed_station DATA_DIR
"""

import asyncio
import os
import signal
import sys
from pathlib import Path

from server.access.role import Role
from tests.server.checklist.begun import begin, tick
from tests.server.conftest import api_client, open_station
from tests.server.fake_link import World


async def main(folder: Path) -> None:
    """Live until the answer is there."""
    async with (
        open_station(folder, World()) as station,
        api_client(station, Role.ADMIN) as client,
    ):
        run = (await begin(client))["id"]
        answer = await tick(client, run, "hull", note="ring 3")
        if answer.status_code == 201:
            os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1])))
