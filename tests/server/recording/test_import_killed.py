"""A station that is killed while it imports has the whole import afterwards, or nothing of it."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from db.query.fleet.robots import list_robots
from db.query.measured.samples import kept_counts
from tests.server.recording.doomed_import import BATCH_ROWS, ROWS
from tests.server.recording.test_foreign import ended
from tests.server.station_app import running, signed_in

ROOT = Path(__file__).parents[3]
BLOCKS = ROWS // BATCH_ROWS


def killed_after(folder, lines, wait_s, held_after):
    """Kill an importing station some time after so many lines; return its upload.

    After ``held_after`` blocks it stands still; 0 for never.
    """
    child = subprocess.Popen(
        [sys.executable, "-m", "tests.server.recording.doomed_import",
         str(folder), str(held_after)],
        cwd=ROOT, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        upload = child.stdout.readline().strip()
        for _ in range(lines):
            assert child.stdout.readline()
        time.sleep(wait_s)
    finally:
        child.send_signal(signal.SIGKILL)
        assert child.wait() == -signal.SIGKILL
        child.stdout.close()
    return upload


@pytest.mark.parametrize("moment", ["among the rows", "at the commit", "among the maps"])
async def test_an_import_whose_station_is_killed_is_whole_or_absent(tmp_path, moment):
    random = np.random.default_rng()
    lines, wait_s, whole = {
        "among the rows": (int(random.integers(1, BLOCKS)), 0.0, {0}),
        "at the commit": (BLOCKS, float(random.uniform(0.0, 0.3)), {0, ROWS}),
        "among the maps": (BLOCKS + 1, float(random.uniform(0.0, 0.5)), {ROWS}),
    }[moment]
    held_after = lines if moment == "among the rows" else 0
    sys.stdout.write(f"killed after {lines} lines and {wait_s} s\n")
    upload = killed_after(tmp_path, lines, wait_s, held_after)
    async with running(tmp_path) as app, signed_in(app) as client:
        store = app.state.foundation.store
        with store.read() as session:
            robots = [one.id for one in list_robots(session)]
            rows = sum(sum(kept_counts(session, one).values()) for one in robots)
        deployments = (await client.get("/api/deployments")).json()["deployments"]
        assert rows in whole
        assert robots == (["eva"] if rows else [])
        assert [one["samples"] for one in deployments] == ([ROWS] if rows else [])
        jobs = (await client.get("/api/jobs")).json()["jobs"]
        assert all(one["state"] not in {"queued", "running"} for one in jobs)
        path = f"/api/imports/uploads/{upload}"
        proposal = next(one["result"] for one in jobs if one["kind"] == "import reading")
        answer = await client.post(path, json={"robot": "eva", "mapping": proposal["mapping"]})
        if rows:
            assert answer.status_code == 409
        else:
            job = await ended(client, answer)
            assert (job["state"], job["result"]["new"]) == ("done", ROWS)
