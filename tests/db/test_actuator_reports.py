"""What robots say of their actuators, as rows."""

from dataclasses import replace
from datetime import timedelta

from db.query.measured.actuator_reports import iterate_actuator_reports, newest_actuator_report
from robot_link.messages import RobotId
from tests.db.conftest import START
from tests.robot_link.test_actuator_report import REPORT

FIRST = replace(REPORT, robot=RobotId("mini-1"), received_at=START)


def at(second, **change):
    return replace(FIRST, measured_at=START + timedelta(seconds=second), **change)


def test_reports_come_back_as_they_were(store):
    told = [at(0), at(10, stuck=("sliding mass", "tail")), at(20, is_swinging=True)]
    store.append([*told, told[1]]).result(60)
    with store.read() as session:
        assert newest_actuator_report(session, "mini-1") == told[2]
        assert list(iterate_actuator_reports(session, "mini-1", START, None)) == told
        until = START + timedelta(seconds=10)
        assert list(iterate_actuator_reports(session, "mini-1", until, until)) == told[1:2]


def test_a_robot_that_never_told_has_none(store):
    with store.read() as session:
        assert newest_actuator_report(session, "mini-1") is None
        assert list(iterate_actuator_reports(session, "mini-1", START, None)) == []
