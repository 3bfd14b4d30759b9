"""A whole station with camera processes, which is killed in the middle of a dive."""

import asyncio
import signal
import sys
from datetime import datetime

import numpy as np
import pytest

from db.query.camera.fixes import list_fixes
from db.store import Store
from server.base.settings import Settings
from tests.server.conftest import MINI
from tests.server.fix.camera_stand_in import pose_at

TOLD = 15


@pytest.mark.timeout(600)
async def test_a_killed_station_loses_no_fix_that_it_told(tmp_path):
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tests.server.fix.station_process", str(tmp_path),
        stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        async with asyncio.timeout(400):
            lines = [await process.stdout.readline() for _ in range(TOLD)]
    finally:
        process.send_signal(signal.SIGKILL)
        await process.communicate()
    told = {datetime.fromisoformat(line.decode().strip()) for line in lines}
    store = Store.open(Settings(data_dir=tmp_path).resolved_database_url)
    try:
        with store.read() as session:
            kept = {one.fix.measured_at: one for one in list_fixes(session, MINI)}
    finally:
        store.close()
    assert told <= kept.keys()
    sys.stdout.write(f"{len(kept)} fixes, {len(told)} told\n")
    together = {at: one for at, one in kept.items() if at >= min(told)}
    off = [
        np.linalg.norm(np.subtract(one.fix.ned_m, pose_at(at).position_m))
        for at, one in together.items()
        if one.fix.quality != "refused"
    ]
    assert len(off) >= 0.8 * len(together)
    assert np.median(off) < 0.005
    several = sum(len(one.fix.cameras) > 1 for one in together.values())
    assert several >= 0.7 * len(together)
