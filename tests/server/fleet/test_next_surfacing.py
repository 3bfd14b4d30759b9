"""When a robot is expected to be heard: the way to where its plan begins counts."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from autonomy.estimation.config import estimator_preset
from autonomy.planner.leg import primitive
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.site import LAKE
from db.query.fleet.robots import RobotRecord
from db.query.mission.plans import PlanRecord
from onboard.profile import FLIGHT_PROFILES
from robot_link.messages import OnboardPlanState, PlanReport, RobotMode
from server.fleet.status import PlanInHand, RobotStatus
from server.fleet.trail import Track
from server.prediction.basis import Basis, Told, predicted
from server.satellite.contact import Heard, next_session_at
from tests.server.conftest import GRACE
from tests.server.fake_link import state_report

NOW = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
CONFIG = PLANNER_PRESETS["grace3"]
SWIM_M_S = CONFIG.primitives.swim_speed_m_s
AT = (200.0, 200.0, 0.0)
WAY_M = 240.0
BEGINS = (AT[0] + WAY_M, AT[1], 0.0)
DEEP = (BEGINS[0] + 15.0, AT[1], 10.0)
UP = (BEGINS[0] + 30.0, AT[1], 0.0)
DIVE = (primitive.glide(CONFIG, BEGINS, DEEP), primitive.glide(CONFIG, DEEP, UP))
DIVE_S = sum(leg.duration_s for leg in DIVE)
SWIM_S = WAY_M / SWIM_M_S


def said(status: RobotStatus, mode: RobotMode, leg: int, position=AT, at: datetime = NOW) -> None:
    """Let a robot say what it does."""
    told = state_report(GRACE, position, mode=mode)
    status.state = replace(told, measured_at=at)
    status.plan_report = PlanReport(
        GRACE, "a" * 64, OnboardPlanState.RUNNING, leg, leg, 1.0, "", at, at
    )


@pytest.fixture
def status():
    """A robot that flies a dive of two glides."""
    robot = RobotRecord(GRACE, "grace-1", "grace3", "real", None, (), LAKE, NOW)
    record = PlanRecord(
        "plan-1", GRACE, "primitives", None, 1, "running", "a" * 64, {}, {}, NOW, "me",
        NOW, NOW, NOW, NOW, None,
    )  # fmt: skip
    found = RobotStatus(robot, Track(0.01, (0.05, 0.12)))
    found.plan = PlanInHand(record, DIVE, np.zeros((0, 5)), "", swim_speed_m_s=SWIM_M_S)
    return found


@pytest.mark.parametrize("mode", [RobotMode.SWIMMING, RobotMode.IDLE, RobotMode.SURFACED])
def test_a_robot_that_is_not_yet_where_its_plan_begins_has_that_way_before_it(status, mode):
    said(status, mode, 0)
    due = NOW + timedelta(seconds=SWIM_S + DIVE_S)
    assert abs(status.next_surfacing() - due) < timedelta(seconds=1.0)


def test_the_way_counts_from_its_newest_word(status):
    said(status, RobotMode.SWIMMING, 0)
    later, nearer = NOW + timedelta(minutes=5), (AT[0] + 100.0, *AT[1:])
    status.state = replace(state_report(GRACE, nearer, mode=RobotMode.SWIMMING), measured_at=later)
    due = later + timedelta(seconds=(WAY_M - 100.0) / SWIM_M_S + DIVE_S)
    assert abs(status.next_surfacing() - due) < timedelta(seconds=1.0)


def test_a_robot_that_dives_already_has_no_way_before_it(status):
    said(status, RobotMode.GLIDING, 0, position=(BEGINS[0], AT[1], 0.5))
    assert status.next_surfacing() == NOW + timedelta(seconds=DIVE_S)
    said(status, RobotMode.GLIDING, 1, position=DEEP)
    assert status.next_surfacing() == NOW + timedelta(seconds=DIVE[1].duration_s)


def test_by_satellite_it_calls_next_when_it_is_up_at_its_time(status):
    """Not at a session that it would have under water, about which nobody need worry."""
    heard = Heard(NOW, 1, 0)
    said(status, RobotMode.SWIMMING, 0)
    assert status.dives_at() is not None
    soon_s, late_s = 0.5 * SWIM_S, 2.0 * SWIM_S
    assert next_session_at(status, heard, soon_s) == NOW + timedelta(seconds=soon_s)
    assert next_session_at(status, heard, late_s) == status.next_surfacing()
    status.plan_report = None
    assert status.dives_at() is None
    assert next_session_at(status, heard, late_s) == NOW + timedelta(seconds=late_s)


def test_it_is_predicted_on_its_way_and_then_in_its_dive(status):
    said(status, RobotMode.SWIMMING, 0)
    basis = Basis(status.state, status.plan_report, None, status.plan, NOW)
    estimator = estimator_preset("grace3", "lake")
    told = Told(estimator, FLIGHT_PROFILES["grace3"], 0.0)
    half_s, glide_s = 0.5 * SWIM_S, DIVE[0].duration_s
    ages_s = np.array([0.0, half_s, SWIM_S, SWIM_S + glide_s])
    found = predicted("flying", basis, told, ages_s)
    assert found.position_ned[0] == pytest.approx(AT, abs=0.5)
    assert found.position_ned[1] == pytest.approx((AT[0] + WAY_M / 2, AT[1], 0.0), abs=1.0)
    assert found.position_ned[1, 2] == pytest.approx(0.0, abs=1e-6)
    assert found.position_ned[2, 0] == pytest.approx(BEGINS[0], abs=10.0)
    assert found.position_ned[3, 2] > 3.0
