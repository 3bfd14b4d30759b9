"""Tells of telemetry that the station acknowledged to robots and cannot bring into the database."""

import asyncio
from pathlib import Path
from typing import Final

from db.bridge import REFUSED_NAME, TORN_NAME
from server.base.alarm_board import AlarmBoard

CAUSE: Final = "rows_aside"
LOOK_PERIOD_S: Final = 60.0
_NAMES: Final = (REFUSED_NAME, TORN_NAME)
_ACTION: Final = "See Help, Troubleshooting, The database does not answer."


async def watch_rows_aside(folder: Path, alarms: AlarmBoard) -> None:
    """Raise an alarm while such rows lie in the data folder, until cancelled."""
    while True:
        found = await asyncio.to_thread(_found, folder)
        if found:
            text = f"Rows that robots need not send again are in {found}, not in the database."
            await alarms.raise_(CAUSE, text, action=_ACTION)
        else:
            await alarms.clear(CAUSE)
        await asyncio.sleep(LOOK_PERIOD_S)


def _found(folder: Path) -> str:
    return " and ".join(name for name in _NAMES if (folder / name).exists())
