from datetime import UTC, datetime

import pytest

from robot_link.messages import CommandKind, LinkState, RobotMode
from server.fleet.words import activity, camera_fix_text, command_text, surface_forecast
from tests.server.fake_link import state_report

DOWN, UP, LEVEL = (0.1, 0.0, 0.05), (0.1, 0.0, -0.05), (0.1, 0.0, 0.0)


@pytest.mark.parametrize(
    ("mode", "velocity", "words"),
    [
        (RobotMode.IDLE, LEVEL, "Idle at the surface"),
        (RobotMode.DIVING, DOWN, "Diving, round 2 of 4"),
        (RobotMode.DIVING, UP, "Rising, round 2 of 4"),
        (RobotMode.GLIDING, DOWN, "Gliding down, round 2 of 4"),
        (RobotMode.GLIDING, UP, "Gliding up, round 2 of 4"),
        (RobotMode.SPIRALLING, DOWN, "Spiralling down, round 2 of 4"),
        (RobotMode.SWIMMING, LEVEL, "Swimming, round 2 of 4"),
        (RobotMode.TURNING, LEVEL, "Turning to the next leg, round 2 of 4"),
        (RobotMode.SURFACED, LEVEL, "At the surface between legs, round 2 of 4"),
        (RobotMode.ABORTING, UP, "Coming up"),
        (RobotMode.HOLDING, LEVEL, "Holding at the surface, round 2 of 4"),
    ],
)
def test_every_mode_has_its_words(mode, velocity, words):
    state = state_report("mini-1", mode=mode, velocity_ned=velocity)
    assert activity(state, "round 2 of 4", is_old=False) == words


def test_old_word_is_never_told_as_if_it_were_new():
    state = state_report("mini-1", mode=RobotMode.GLIDING, velocity_ned=DOWN)
    assert activity(state, "", is_old=True) == "Last heard: gliding down"
    assert activity(None, "", is_old=True) == "Not heard yet"


@pytest.mark.parametrize("mode", RobotMode)
def test_following_without_the_barrier_is_marked_and_nothing_else_is(mode):
    state = state_report("mini-1", mode=mode, velocity_ned=LEVEL)
    plain, marked = (activity(state, "", is_old=False, is_teaching=one) for one in (False, True))
    follows = mode in {RobotMode.TRACKING, RobotMode.SEARCHING}
    assert marked == (f"{plain}, teaching: barrier off" if follows else plain)


def test_forecast_names_the_moment_where_it_is_known():
    at = datetime(2026, 11, 21, 14, 32, tzinfo=UTC)
    told = surface_forecast("grace-1", LinkState.SUBMERGED, "xbee", at)
    assert told == "Reaches grace-1 at its next surfacing, about 14:32Z"
    unknown = surface_forecast("grace-1", LinkState.SUBMERGED, "xbee", None)
    assert unknown == "Reaches grace-1 at its next surfacing"


@pytest.mark.parametrize("kind", CommandKind)
@pytest.mark.parametrize("level", ["created", "queued", "radio", "applied", "refused", "expired"])
def test_every_level_of_every_command_is_one_sentence(kind, level):
    text = command_text("mini-1", kind, level, "")
    assert "mini-1" in text
    assert text.endswith(".")
    assert ("obeys" in text) == (level == "applied")


def test_fix_by_cameras_says_how_many_where_the_station_knows_it():
    assert camera_fix_text(3) == "fixed by 3 cameras"
    assert camera_fix_text(1) == "fixed by 1 camera"
    assert camera_fix_text(None) == "fixed by cameras"
