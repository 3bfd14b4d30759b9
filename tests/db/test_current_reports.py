"""What robots believe of currents, as rows."""

from dataclasses import replace
from datetime import timedelta

from db.query.measured.current_reports import current_reports, newest_current_report
from robot_link.messages import RobotId
from robot_link.report import CurrentReport
from tests.db.conftest import START

FIRST = CurrentReport(RobotId("mini-1"), START, START, (0.01, -0.02), 0.003, 1.5, 4, 1)


def at(second: float) -> CurrentReport:
    return replace(FIRST, measured_at=START + timedelta(seconds=second))


def test_reports_come_back_as_they_were_with_the_one_that_a_span_begins_under(store):
    store.append([at(0), at(10), at(20), at(20), at(30)]).result(60)
    span = START + timedelta(seconds=15), START + timedelta(seconds=25)
    with store.read() as session:
        assert newest_current_report(session, "mini-1") == at(30)
        assert newest_current_report(session, "mini-1", span[1]) == at(20)
        assert current_reports(session, "mini-1", *span) == [at(10), at(20)]
        assert current_reports(session, "mini-1", None, span[0]) == [at(0), at(10)]


def test_a_robot_that_never_told_has_none(store):
    with store.read() as session:
        assert newest_current_report(session, "mini-1") is None
        assert current_reports(session, "mini-1", START, START) == []
