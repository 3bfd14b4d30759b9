"""A clock of the station that tests turn."""

from datetime import UTC, datetime, timedelta

import pytest

from robot_link.clock import SystemClock
from server.base import wakeups


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[timedelta]:
    """By how much the station's clock is ahead, as the only item; tests change it."""
    monkeypatch.setattr(wakeups, "LONGEST_S", 0.05)
    moved = [timedelta()]

    def now(_: SystemClock) -> datetime:
        return datetime.now(UTC) + moved[0]

    monkeypatch.setattr(SystemClock, "now", now)
    return moved
