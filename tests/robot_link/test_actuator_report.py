"""What a robot says of its actuators: by radio, and what is refused of it."""

import math
from dataclasses import replace

import pytest

from robot_link.actuator_check import actuator_fault
from robot_link.mavlink.actuator import actuator_message
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.decode import decoded
from robot_link.messages import SystemId
from robot_link.report import ActuatorFollowing, ActuatorReport
from tests.robot_link.rig import MINI
from tests.robot_link.target_case import NOW

ROBOT = Codec(SystemId(1), ROBOT_COMPONENT)
SLOW = ActuatorFollowing(0.25, 0.125, 0.5, 0.0625, 12.5)
NEVER = ActuatorFollowing(1.0, 1.5, 0.0, 0.25, None)
REPORT = ActuatorReport(
    MINI,
    NOW,
    NOW,
    mass=SLOW,
    pump=NEVER,
    speed_share=0.5,
    is_mass_off=True,
    is_swinging=False,
    stuck=(),
)


def over_the_air(report: ActuatorReport) -> ActuatorReport:
    (message,), bad = ROBOT.unpack(ROBOT.pack(actuator_message(report)))
    assert bad == 0
    told = decoded(message, report.robot, report.received_at)
    assert isinstance(told, ActuatorReport)
    return told


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"is_mass_off": False, "is_swinging": True},
        {"stuck": ("sliding mass", "tail")},
        {"stuck": ("pump",), "mass": NEVER, "pump": SLOW},
    ],
)
def test_report_arrives_by_radio_as_it_was(change):
    report = replace(REPORT, **change)
    assert over_the_air(report) == report


@pytest.mark.parametrize(
    "change",
    [
        {"mass": replace(SLOW, rate_share=math.nan)},
        {"mass": replace(SLOW, rate_share=0.0)},
        {"mass": replace(SLOW, delay_s=100.0)},
        {"pump": replace(SLOW, learned_age_s=-3.0)},
        {"pump": replace(SLOW, delay_std_s=-0.5)},
        {"speed_share": 1.5},
        {"stuck": ("rudder",)},
    ],
)
def test_what_cannot_be_is_neither_sent_nor_taken(change):
    report = replace(REPORT, **change)
    assert actuator_fault(report)
    if "stuck" not in change:
        (message,), _ = ROBOT.unpack(ROBOT.pack(actuator_message(report)))
        with pytest.raises(ValueError, match="an actuator report has"):
            decoded(message, MINI, NOW)
