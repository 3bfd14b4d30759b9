"""A pass is killed at random moments, a real process: it ends the same, and nothing is lost."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest
from sqlalchemy import select

from db.sample_tables import SampleRollup, SampleRow
from db.storage_tables import ArchiveFileRow, PrunedDayRow
from db.store import Store
from db.tables import RawFrameRow, StateRow
from server.storage.restoring import restore_file
from tests.server.storage.conftest import NOW, day_of_robot
from tests.server.storage.test_pruning import config, prune, rows

pytestmark = pytest.mark.process

RULES = {
    "raw": ("move", {}),
    "samples": ("move", {}),
    "states": ("thin", {"period_s": 60}),
    "readings": ("delete", {}),
}
CHILD = """
import sys
from pathlib import Path
from db.store import Store
from server.storage.pace import Pace
from tests.server.storage.test_kill import RULES
from tests.server.storage.test_pruning import config, prune

def rest_and_say(pace, took_s, rows, rest=Pace.rest_after):
    print("transaction", flush=True)
    sys.stdin.readline()  # it goes no further than it may
    rest(pace, took_s, rows)


Pace.rest_after = rest_and_say
store = Store.open(sys.argv[1])
prune(store, Path(sys.argv[2]), config(**RULES))
print("ends", flush=True)
"""
MOVED = (RawFrameRow, SampleRow)
KILLS_MAX = 6


def killed_pass(url, folder, transactions, more_s):
    """Run a pass in a process and kill it after so many transactions and so long after them.

    Returns:
        Whether it had ended before.
    """
    with subprocess.Popen(
        [sys.executable, "-c", CHILD, url, str(folder)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as child:  # fmt: skip
        child.stdin.write("\n" * (transactions + 2))
        child.stdin.flush()
        for _ in range(transactions):
            line = child.stdout.readline()
            assert line in {"transaction\n", "ends\n"}
            if line == "ends\n":
                break
        time.sleep(more_s)
        os.kill(child.pid, signal.SIGKILL)
        return line == "ends\n" or "ends" in child.stdout.read()


def kept_in(store):
    return {model: rows(store, model) for model in (StateRow, *MOVED, SampleRollup)}


@pytest.mark.timeout(900)
def test_a_pass_killed_at_random_moments_ends_the_same(store, url, ended, tmp_path):
    for number in range(3):
        store.append(day_of_robot(number)).result(120)
    before = kept_in(store)
    store.close()
    draw = random.Random(19)
    kills = 0
    while kills < KILLS_MAX and not killed_pass(
        url, tmp_path, draw.randint(1, 6), draw.uniform(0.0, 0.05)
    ):
        kills += 1
    store = Store.open(url)
    try:
        prune(store, tmp_path, config(**RULES))
        after = kept_in(store)
        assert kills > 0
        assert after[RawFrameRow] == after[SampleRow] == after[SampleRollup] == []
        with store.read() as session:
            files = session.scalars(select(ArchiveFileRow)).all()
            gone = session.scalars(select(PrunedDayRow)).all()
        assert {file.state for file in files} == {"moved"}
        told = {kind: sum(day.rows for day in gone if day.kind == kind) for kind in RULES}
        assert told["raw"] == len(before[RawFrameRow])
        assert told["samples"] == len(before[SampleRow])
        assert told["states"] == len(before[StateRow]) - len(after[StateRow])
        for file in sorted((tmp_path / "archive").rglob("*.gz")):
            restore_file(store, tmp_path, file, NOW)
        back = kept_in(store)
        assert [back[model] for model in (*MOVED, SampleRollup)] == [
            before[model] for model in (*MOVED, SampleRollup)
        ]
    finally:
        store.close()
