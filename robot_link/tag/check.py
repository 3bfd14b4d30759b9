"""What a detection, and a report of a tag receiver, can say, whichever wire brought it."""

import math
import re

from robot_link.report import Detection, ReceiverReport

_TAG = re.compile(r"[A-Z]\d{2,3}-\d{4}-\d{1,7}")
_SERIAL_MAX = 2**32 - 1
SENSOR_MAX = 2**16 - 2
"""Raw value of a tag's sensor."""


def checked_detection(detection: Detection) -> Detection:
    """Return a detection that is possible.

    Raises:
        ValueError: If it is not; see ``detection_fault``.
    """
    if fault := detection_fault(detection):
        raise ValueError(f"a detection has {fault}")
    return detection


def detection_fault(detection: Detection) -> str:
    """Return what is impossible about a detection, "" if nothing is."""
    if not all(map(math.isfinite, (*detection.position_ned, detection.position_std_m))):
        return "a number that is not finite"
    if detection.position_std_m < 0.0:
        return "a negative deviation"
    if not is_tag(detection.tag):
        return f"the tag {detection.tag[:20]!r}"
    if not 0 <= detection.receiver <= _SERIAL_MAX:
        return f"the receiver {detection.receiver}"
    if detection.sensor is not None and not 0 <= detection.sensor <= SENSOR_MAX:
        return f"a sensor value of {detection.sensor}"
    return ""


def is_tag(name: str) -> bool:
    """Tell whether this is a transmitter's name, such as ``A69-1601-179``."""
    return _TAG.fullmatch(name) is not None


def receiver_fault(report: ReceiverReport) -> str:
    """Return what is impossible about a report of a receiver, "" if nothing is."""
    counts = (report.heard, report.refused_sum, report.refused_date, report.refused_code)
    if min(counts) < 0 or not 0 <= report.receiver <= _SERIAL_MAX:
        return "an impossible count"
    offset = report.clock_offset_s
    return "" if offset is None or math.isfinite(offset) else "a clock offset that is no number"
