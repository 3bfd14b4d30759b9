"""Heard tags between the dialect's messages and the project's values."""

import math
from datetime import datetime

from robot_link.mavlink.telemetry import microseconds, moment, sample_message
from robot_link.mavlink.wire import grace
from robot_link.messages import LogId, RobotId
from robot_link.report import Detection, ReceiverReport
from robot_link.sample_log import HeardTag, LogEntry
from robot_link.tag.check import checked_detection, receiver_fault

RECEIVER_FRAME_BYTES = 12 + grace.MAVLink_grace_receiver_message.unpacker.size
"""Bytes of one receiver report's frame, at most."""
_NO_SENSOR = 2**16 - 1
_COUNT_MAX = 2**32 - 1


def entry_message(
    log: LogId, sequence: int, entry: LogEntry
) -> grace.MAVLink_grace_sample_message | grace.MAVLink_grace_detection_message:
    """Encode what a robot keeps until it is ashore.

    Raises:
        ValueError: If it says what cannot be: the far side could only drop it, again and again.
        KeyError: If no such variable is declared.
    """
    if isinstance(entry, HeardTag):
        return _detection_message(log, sequence, entry)
    return sample_message(log, sequence, entry)


def _detection_message(
    log: LogId, sequence: int, heard: HeardTag
) -> grace.MAVLink_grace_detection_message:
    north, east, down = heard.position_ned
    message = grace.MAVLink_grace_detection_message(
        time_utc_us=microseconds(heard.measured_at),
        log=log,
        sequence=sequence,
        receiver=heard.receiver,
        x=north,
        y=east,
        z=down,
        position_std=heard.position_std_m,
        sensor=_NO_SENSOR if heard.sensor is None else heard.sensor,
        tag=heard.tag.encode("ascii"),
    )
    checked_detection(detection_of(heard, RobotId(""), log, sequence))
    return message


def detection_of(heard: HeardTag, robot: RobotId, log: LogId, sequence: int) -> Detection:
    """Return what a robot tells of a tag that it heard; ``received_at`` is the receiver's."""
    return Detection(
        robot=robot,
        log=log,
        sequence=sequence,
        receiver=heard.receiver,
        tag=heard.tag,
        sensor=heard.sensor,
        position_ned=heard.position_ned,
        position_std_m=heard.position_std_m,
        measured_at=heard.measured_at,
        received_at=heard.measured_at,
    )


def detection(
    message: grace.MAVLink_grace_detection_message, robot: RobotId, received_at: datetime
) -> Detection:
    """Decode a detection.

    Raises:
        ValueError: If it says what cannot be, or its time is impossible.
    """
    return checked_detection(
        Detection(
            robot=robot,
            log=LogId(message.log),
            sequence=message.sequence,
            receiver=message.receiver,
            tag=message.tag,
            sensor=None if message.sensor == _NO_SENSOR else message.sensor,
            position_ned=(message.x, message.y, message.z),
            position_std_m=message.position_std,
            measured_at=moment(message.time_utc_us),
            received_at=received_at,
        )
    )


def receiver_message(report: ReceiverReport) -> grace.MAVLink_grace_receiver_message:
    """Encode how a receiver fares; counts stop at their field's end."""
    offset = report.clock_offset_s
    return grace.MAVLink_grace_receiver_message(
        time_utc_us=microseconds(report.measured_at),
        receiver=report.receiver,
        heard=min(report.heard, _COUNT_MAX),
        refused_sum=min(report.refused_sum, _COUNT_MAX),
        refused_date=min(report.refused_date, _COUNT_MAX),
        refused_code=min(report.refused_code, _COUNT_MAX),
        clock_offset=math.nan if offset is None else offset,
    )


def receiver_report(
    message: grace.MAVLink_grace_receiver_message, robot: RobotId, received_at: datetime
) -> ReceiverReport:
    """Decode how a receiver fares.

    Raises:
        ValueError: If it says what cannot be, or its time is impossible.
    """
    offset = message.clock_offset
    report = ReceiverReport(
        robot=robot,
        measured_at=moment(message.time_utc_us),
        received_at=received_at,
        receiver=message.receiver,
        heard=message.heard,
        refused_sum=message.refused_sum,
        refused_date=message.refused_date,
        refused_code=message.refused_code,
        clock_offset_s=None if math.isnan(offset) else offset,
    )
    if fault := receiver_fault(report):
        raise ValueError(f"a receiver report has {fault}")
    return report
