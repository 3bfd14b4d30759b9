"""What a robot says of the current: by radio, in a satellite record, and what is refused of it."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.current_check import current_fault
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.current import can_travel, current_message
from robot_link.mavlink.decode import decoded
from robot_link.messages import SystemId
from robot_link.report import CurrentReport
from robot_link.satellite.record import (
    MobileOriginatedContent,
    compose,
    read_mobile_originated,
    sample_room,
)
from tests.robot_link import satellite_case
from tests.robot_link.rig import MINI
from tests.robot_link.target_case import NOW

ROBOT = Codec(SystemId(1), ROBOT_COMPONENT)
REPORT = CurrentReport(MINI, NOW, NOW, (0.015625, -0.03125), 0.001953125, 1.75, 5, 2)


def over_the_air(report: CurrentReport) -> CurrentReport:
    (message,), bad = ROBOT.unpack(ROBOT.pack(current_message(report)))
    assert bad == 0
    told = decoded(message, report.robot, report.received_at)
    assert isinstance(told, CurrentReport)
    return told


def test_report_arrives_by_radio_as_it_was():
    assert over_the_air(REPORT) == REPORT


@given(st.integers(0, 255), st.integers(0, 2**31))
def test_counts_arrive_or_stop_at_their_field(dives, refused):
    told = over_the_air(replace(REPORT, dives=dives, fixes_refused=refused))
    assert (told.dives, told.fixes_refused) == (dives, min(refused, 2**16 - 1))


@pytest.mark.parametrize(
    "change",
    [
        {"current_ne_m_s": (math.nan, 0.0)},
        {"current_ne_m_s": (0.0, 11.0)},
        {"current_std_m_s": -1.0},
        {"current_std_m_s": math.inf},
        {"doubt": 0.5},
        {"doubt": 11.0},
        {"dives": 256},
    ],
)
def test_what_cannot_be_is_neither_sent_nor_taken(change):
    report = replace(REPORT, **change)
    assert current_fault(report)
    assert not can_travel(report)
    if "dives" not in change:
        with pytest.raises(ValueError, match="current report"):
            over_the_air(report)


def content(**others) -> MobileOriginatedContent:
    state = satellite_case.state(robot=MINI)
    return MobileOriginatedContent(7, state=state, current=REPORT, **others)


def through_the_sky(told: MobileOriginatedContent, size: int) -> MobileOriginatedContent:
    data = compose(told, satellite_case.KEY, SystemId(1), size)
    return read_mobile_originated(data, satellite_case.KEY, SystemId(1), MINI, NOW)


def test_record_carries_the_current_with_the_state_where_there_is_room():
    told = through_the_sky(content(), 340).current
    assert told is not None
    assert told.current_ne_m_s == pytest.approx(REPORT.current_ne_m_s, abs=6e-5)
    assert told.current_std_m_s == pytest.approx(REPORT.current_std_m_s, abs=6e-5)
    assert (told.doubt, told.dives, told.fixes_refused) == (1.75, 5, 2)
    assert told.measured_at == satellite_case.state().measured_at
    assert sample_room(content(), 340) == sample_room(replace(content(), current=None), 340) - 9


def test_record_without_a_state_tells_no_current():
    assert through_the_sky(replace(content(), state=None), 340).current is None
