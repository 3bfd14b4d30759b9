"""A flood of causes through three SIGKILLs: nothing that was kept is lost, no cause has two."""

import os
import signal
import subprocess
import sys
from collections import Counter

import pytest

from db.query.station.alarms import open_alarms
from db.store import Store
from tests.server.alarm import flood_process

pytestmark = pytest.mark.process
KEPT_EACH = 200


@pytest.fixture(autouse=True)
def _known_fleet():
    """Begin with an empty database."""


def kept_before_kill(folder, first):
    """Return the causes that a process said were kept, before it was killed at work."""
    child = subprocess.Popen(
        [sys.executable, "-m", flood_process.__name__, str(folder), str(first)],
        stdout=subprocess.PIPE,
        text=True,
    )
    causes = [child.stdout.readline().strip() for _ in range(KEPT_EACH)]
    os.kill(child.pid, signal.SIGKILL)
    causes += [line.strip() for line in child.stdout.read().splitlines(keepends=True)
               if line.endswith("\n")]  # fmt: skip
    child.stdout.close()
    assert child.wait() == -signal.SIGKILL
    return causes


def test_a_flood_of_causes_survives_three_kills_with_one_alarm_each(tmp_path):
    kept: set[str] = set()
    for first in (0, 100, 300):
        kept.update(kept_before_kill(tmp_path, first))
        store = Store.open(f"sqlite:///{tmp_path / 'station.sqlite3'}")
        with store.read() as session:
            found = Counter(alarm.cause for alarm in open_alarms(session))
        store.close()
        assert kept <= set(found)
        assert set(found.values()) == {1}
    assert len(kept) > 2 * KEPT_EACH
