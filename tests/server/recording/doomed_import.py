"""A station in a process of its own that imports a table, and says on its output how far it is.

    python -m tests.server.recording.doomed_import DATA_DIR [BLOCKS]

It prints the upload's name, a line for each block of rows that it has written into its
transaction, and one when the transaction is committed. After so many blocks, if they are given, it
stands still. Whoever reads that kills it.
"""

import asyncio
import itertools
import sys
import threading
from pathlib import Path
from typing import Any

from db.query.measured import imported
from server.recording import foreign
from tests.server.recording.test_foreign import ended
from tests.server.station_app import running, signed_in

ROWS = 12_000
BATCH_ROWS = 1_000
BEGIN_S = 1_563_751_502


def table() -> str:
    """Return a table of a yo, a row each second."""
    lines = ["time,latitude,longitude,depth,temperature"]
    for row in range(ROWS):
        place = f"{48.9 + 1e-6 * row:.6f},-130.6,{abs(row % 200 - 100)}"
        lines.append(f"{BEGIN_S + row},{place},{10 + row / 1e4:.4f}")
    return "\n".join(lines) + "\n"


def say(line: str) -> None:
    """Tell whoever waits."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


async def main(folder: Path, blocks: int = 0) -> None:
    """Live until the import is over, or stand still once so many blocks are written."""
    insert, learn = imported.insert_samples, foreign.learn_maps
    count = itertools.count(1)

    def told(session: Any, samples: Any) -> None:
        insert(session, samples)
        say("rows")
        if next(count) == blocks:
            threading.Event().wait()

    async def committed(*args: Any, **named: Any) -> Any:
        say("committed")
        found = await learn(*args, **named)
        await asyncio.sleep(600.0)  # it is not over before it is killed, however fast it is
        return found

    imported.insert_samples, foreign.learn_maps = told, committed
    imported.BATCH_ROWS = BATCH_ROWS
    async with running(folder) as app, signed_in(app) as client:
        files = [("files", ("dive.csv", table()))]
        job = await ended(client, await client.post("/api/imports/uploads", files=files))
        proposal = job["result"]
        say(proposal["upload"])
        body = {"robot": "eva", "mapping": proposal["mapping"]}
        path = f"/api/imports/uploads/{proposal['upload']}"
        await ended(client, await client.post(path, json=body))


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), *map(int, sys.argv[2:])))
