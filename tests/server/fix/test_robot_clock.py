"""A robot whose clock is ahead: what it says is held against what cameras saw at that moment."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from robot_link.messages import LinkReport, LinkState
from server.fix.comparison import compared
from server.fix.fusion import _said
from tests.robot_link.fix_case import FIX
from tests.server.conftest import MINI
from tests.server.fake_link import state_report

AT = datetime(2026, 11, 22, 15, 4, 5, tzinfo=UTC)
AHEAD_S = 0.4


@pytest.fixture
def status(station):
    """What is known of a robot whose clock is 0.4 s ahead of the station's."""
    clock = {"clock_offset_s": AHEAD_S}
    station.fleet.take_link(LinkReport(MINI, "xbee", LinkState.LIVE, AT, -50.0, 10, 0, **clock))
    return station.fleet.status(MINI)


def said_at(status, at):
    """Let the robot sink by 0.2 m/s, and say so at a moment of the station."""
    robots_at = at + timedelta(seconds=AHEAD_S)
    sinking = {"velocity_ned": (0.0, 0.0, 0.2)}
    status.state = state_report(MINI, (1.0, 0.5, 0.3), at=robots_at, **sinking)
    return status.state


def test_what_a_robot_said_a_moment_ago_helps_to_find_it(status):
    said_at(status, AT)
    age_s, *_, depth_m = _said({"mini-1": status}, AT + timedelta(seconds=0.1))["mini-1"]
    assert age_s == pytest.approx(0.1)
    assert depth_m == 0.3
    assert _said({"mini-1": status}, AT - timedelta(seconds=0.1)) == {}


def test_a_robot_that_is_where_cameras_see_it_is_not_apart_by_its_clock(status):
    state = said_at(status, AT)
    fix = replace(FIX, measured_at=AT + timedelta(seconds=0.2), ned_m=(1.0, 0.5, 0.34))
    apart = compared(state, status.at_station(state.measured_at), fix)
    assert apart.distance_m == pytest.approx(0.0, abs=1e-9)
    assert apart.at == fix.measured_at
