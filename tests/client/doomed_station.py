"""A station in a process of its own, which may kill itself between a commit and its answer.

    python -m tests.client.doomed_station DATA_DIR PORT [lives|dies]

One that dies does so by SIGKILL after a plan was committed, when its answer is about to be kept.
It prints a line when it takes requests.
"""

import asyncio
import os
import signal
import sys
from pathlib import Path
from typing import Any

import uvicorn

from db.query.station import idempotency
from server.app import create_app
from server.base.settings import Settings
from server.station import Station
from tests.server.conftest import MINI
from tests.server.fake_link import World, current_report, state_report


def die(*_: Any) -> None:
    """Keep no answer."""
    os.kill(os.getpid(), signal.SIGKILL)


async def main(folder: Path, port: int) -> None:
    """Serve until somebody ends the process."""
    world = World()
    settings = Settings(data_dir=folder, simulation=True, worker_processes=1)
    app = create_app(settings, lambda foundation: Station(foundation, world.make_link))
    server = uvicorn.Server(uvicorn.Config(app, "127.0.0.1", port, log_level="warning"))
    serving = asyncio.create_task(server.serve())
    while not server.started:  # noqa: ASYNC110 - uvicorn sets a flag
        await asyncio.sleep(0.01)
    world.hear(MINI)
    world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
    world.tell(current_report(MINI))
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    await serving


if __name__ == "__main__":
    if sys.argv[3] == "dies":
        idempotency.settle = die
    asyncio.run(main(Path(sys.argv[1]), int(sys.argv[2])))
