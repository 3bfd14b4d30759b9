"""What was acknowledged survives SIGKILL: a real process is killed in the middle of its work."""

import os
import signal
import subprocess
import sys
import time

import pytest

from db.query.fleet.robots import add_robot
from db.query.measured.samples import sample_columns
from db.store import Store
from tests.db.conftest import robot_record

pytestmark = pytest.mark.process

CHILD = """
import sys
from db.store import Store
from tests.db.conftest import sample

store = Store.open(sys.argv[1])
first = int(sys.argv[2])
waiting = []
for number in range(first, first + 1_000_000):
    waiting.append((number, store.append([sample(number)])))
    if len(waiting) > 50:
        done, future = waiting.pop(0)
        future.result()
        print(done, flush=True)
"""


LEAST = 40
"""Rows that are acknowledged before a kill, however slow the disk is."""


def acknowledged_before_kill(url, first, seconds):
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, url, str(first)], stdout=subprocess.PIPE, text=True
    )
    numbers = [int(child.stdout.readline()) for _ in range(LEAST)]
    time.sleep(seconds)
    os.kill(child.pid, signal.SIGKILL)
    numbers += [int(line) for line in child.stdout.read().splitlines() if line]
    child.stdout.close()
    assert child.wait() == -signal.SIGKILL
    return numbers


def test_every_acknowledged_sample_survives_sigkill(url):
    store = Store.open(url)
    store.change(lambda session: add_robot(session, robot_record())).result(60)
    store.close()
    acknowledged = set()
    for round_number, seconds in enumerate((0.05, 0.17, 0.31)):
        acknowledged.update(acknowledged_before_kill(url, round_number * 1_000_000, seconds))
        store = Store.open(url)
        with store.read() as session:
            kept = set(sample_columns(session, "mini-1", "blue_light").sequence.tolist())
        store.close()
        assert acknowledged <= kept
    assert len(acknowledged) > 100
