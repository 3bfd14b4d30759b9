"""A process that raises alarms without end; it says each that is kept, and is killed."""

import asyncio
import sys
from contextlib import AsyncExitStack
from pathlib import Path

from server.base.foundation import open_foundation
from server.base.settings import Settings

AT_ONCE = 40


async def _raise(folder: Path, first: int) -> None:
    async with AsyncExitStack() as stack:
        foundation = await open_foundation(Settings(data_dir=folder), stack)
        for number in range(first, 10_000_000, AT_ONCE):
            causes = [f"cause {one % 10_000}" for one in range(number, number + AT_ONCE)]
            raised = (
                foundation.alarms.raise_(cause, f"{cause}.", level="severe") for cause in causes
            )
            alarms = await asyncio.gather(*raised)
            await foundation.alarms.save_waiting()
            for alarm in alarms:
                sys.stdout.write(f"{alarm.cause}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    asyncio.run(_raise(Path(sys.argv[1]), int(sys.argv[2])))
