"""What a robot says of itself, out of the dialect's messages: one place for link and journal."""

from collections.abc import Iterable
from datetime import datetime

from robot_link.channel_table import ChannelPage
from robot_link.mavlink import (
    actuator,
    channel_page,
    current,
    detection,
    several,
    target,
    telemetry,
)
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId, RobotMode, Sample
from robot_link.report import Reading, RobotReport

Value = RobotMode | RobotReport | tuple[Sample, ...] | tuple[Reading, ...] | ChannelPage | None
"""What one message means; None for what the station does not keep."""


def decoded(message: WireMessage, robot: RobotId, received_at: datetime) -> Value:
    """Decode what a robot says of itself; None for what does not matter.

    Args:
        message: A valid frame's content.
        robot: Who sent it.
        received_at: The station's clock when it came.

    Raises:
        ValueError: If the content is impossible.
    """
    match message:
        case grace.MAVLink_heartbeat_message(
            type=grace.MAV_TYPE_SUBMARINE, autopilot=grace.MAV_AUTOPILOT_GENERIC
        ):
            return RobotMode(message.custom_mode)
        case grace.MAVLink_grace_state_message():
            return telemetry.state_report(message, robot, received_at)
        case grace.MAVLink_grace_sample_message():
            return telemetry.sample(message, robot, received_at)
        case grace.MAVLink_grace_samples_message():
            return several.samples(message, robot, received_at)
        case grace.MAVLink_grace_health_message():
            return several.readings(message, robot, received_at)
        case grace.MAVLink_grace_channels_message():
            return channel_page.channel_page(message, robot, received_at)
        case grace.MAVLink_grace_plan_report_message():
            return telemetry.plan_report(message, robot, received_at)
        case grace.MAVLink_grace_plan_queue_message():
            return telemetry.plan_queue(message, robot, received_at)
        case grace.MAVLink_grace_track_message():
            return target.target_report(message, robot, received_at)
        case grace.MAVLink_grace_current_message():
            return current.current_report(message, robot, received_at)
        case grace.MAVLink_grace_detection_message():
            return detection.detection(message, robot, received_at)
        case grace.MAVLink_grace_receiver_message():
            return detection.receiver_report(message, robot, received_at)
        case grace.MAVLink_grace_actuators_message():
            return actuator.actuator_report(message, robot, received_at)
        case _:
            return None


def robot_time(messages: Iterable[WireMessage]) -> datetime | None:
    """Return the newest time that the robot itself wrote into these messages, if it did."""
    newest_us = max((getattr(message, "time_utc_us", 0) for message in messages), default=0)
    try:
        return telemetry.moment(newest_us) if newest_us else None
    except ValueError:
        return None
