"""Processes of the product's own that are ended at once."""

from asyncio.subprocess import Process
from contextlib import suppress


async def kill_child(process: Process) -> None:
    """Kill a process, unless it has ended, and wait until it is gone and its pipes are closed.

    A pipe that stays open would be closed by whatever collects it later, as an error there.
    """
    with suppress(ProcessLookupError):
        process.kill()
    if process.stdin is not None:
        process.stdin.close()
    await process.communicate()
