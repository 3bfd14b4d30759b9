"""What the station says of the current that a robot believes."""

from dataclasses import replace
from datetime import UTC, datetime

from robot_link.messages import RobotId
from robot_link.report import CurrentReport
from server.fleet.current_words import current_text, current_view, metres

NOW = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
REPORT = CurrentReport(RobotId("mini-1"), NOW, NOW, (0.0, 0.021), 0.004, 1.0, 3, 0)


def test_a_current_is_told_with_its_direction_and_its_doubt():
    assert current_text(REPORT) == "2.1 cm/s to 090°, give or take 0.4."


def test_a_current_within_its_own_doubt_is_none_that_could_be_told():
    unknown = replace(REPORT, current_ne_m_s=(0.001, 0.0))
    assert current_text(unknown) == "None that it could tell; give or take 0.4 cm/s."


def test_a_robot_that_learned_no_current_says_what_it_allows_for():
    """The position filter learns none, the model filter none before a fix told it."""
    none = replace(REPORT, current_ne_m_s=(0.0, 0.0), current_std_m_s=0.01)
    assert current_text(none) == "It has learned no current; it allows for 1.0 cm/s."


def test_station_alone_says_which_doubt_is_worth_a_word():
    assert [current_view(replace(REPORT, doubt=d), 0.0).is_doubted for d in (1.2, 1.3)] == [
        False,
        True,
    ]


def test_doubt_and_refused_fixes_are_said():
    assert current_text(replace(REPORT, doubt=1.82, fixes_refused=2)).endswith(
        " Its last fixes lay farther off than it states: the water moves more than was believed, or"
        " its compass is off. Position errors may be 1.8 times larger than stated. Let it "
        "surface more often, or plan with the current from dives."
        " 2 fixes lay too far off and were not believed."
    )
    assert current_text(replace(REPORT, fixes_refused=1)).endswith(
        "1 fix lay too far off and was not believed."
    )


def test_distances_have_two_digits_and_no_exponent():
    said = [metres(one) for one in (0.0, 0.0404, 3.14159, 47.1, 138.7, 372.0, 1234.0)]
    assert said == ["0 m", "0.04 m", "3.1 m", "47 m", "140 m", "370 m", "1200 m"]
