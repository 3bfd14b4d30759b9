"""What no robot can have measured: kept out of gauges, maps and plans.

The raw bytes are journaled whatever they say; this is about what is done with them.
"""

import math
from collections.abc import Sequence
from datetime import UTC, datetime

from autonomy.site import Site
from robot_link.actuator_check import actuator_fault
from robot_link.current_check import current_fault
from robot_link.messages import STATE, Sample, StateReport
from robot_link.report import (
    ActuatorReport,
    CurrentReport,
    Detection,
    Reading,
    ReceiverReport,
    TargetReport,
)
from robot_link.tag.check import detection_fault, receiver_fault
from robot_link.target_check import target_fault
from server.fleet.clock_fault import AHEAD_MAX

_EARLIEST = datetime(2000, 1, 1, tzinfo=UTC)
_SURFACE_NOISE_M = 0.5


def fault_of_state(report: StateReport, site: Site, now: datetime, speed: float) -> str | None:
    """Return why a state report cannot be true, or ``None``."""
    numbers = STATE.numbers(report)
    if not all(map(math.isfinite, numbers)):
        return "a value that is not a number"
    for channel, number in zip(STATE.channels, numbers, strict=True):
        if fault := channel.fault(number):
            return fault
    return _fault_of_time(report.measured_at, now, speed) or _fault_of_position(
        report.position_ned, report.position_std_m, site
    )


def fault_of_gappy_state(report: StateReport, site: Site) -> str | None:
    """Return why a state of a vehicle of another maker cannot be true, or ``None``.

    It is dated by its arrival, and NaN stands for what the vehicle does not tell.
    """
    for channel, number in zip(STATE.channels, STATE.numbers(report), strict=True):
        if not math.isnan(number) and (fault := channel.fault(number)):
            return fault
    place = tuple(0.0 if math.isnan(one) else one for one in report.position_ned)
    std_m = report.position_std_m if math.isfinite(report.position_std_m) else 0.0
    return _fault_of_position(place, std_m, site)


def fault_of_sample(sample: Sample, site: Site, now: datetime, speed: float) -> str | None:
    """Return why a sample cannot be true whatever its value, or ``None``.

    What its channel believes of the value, ``Channel.fault`` says: that is kept, not used.
    """
    if not all(map(math.isfinite, (*sample.position_ned, sample.position_std_m, sample.value))):
        return "a value that is not a number"
    return _fault_of_time(sample.measured_at, now, speed) or _fault_of_position(
        sample.position_ned, sample.position_std_m, site
    )


def fault_of_reading(reading: Reading, now: datetime, speed: float) -> str | None:
    """Return why a reading cannot be true whatever its channel believes of the value."""
    if not math.isfinite(reading.value):
        return "a value that is not a number"
    return _fault_of_time(reading.measured_at, now, speed)


def fault_of_target(report: TargetReport, site: Site, now: datetime, speed: float) -> str | None:
    """Return why a report on a target cannot be true, or ``None``.

    An estimate that diverged may be anywhere; that is for people to see.
    """
    if fault := target_fault(report):
        return fault
    return _fault_of_time(report.measured_at, now, speed) or _fault_of_position(
        (*report.position_ne_m, 0.0), 0.0, site
    )


def fault_of_current(report: CurrentReport, now: datetime, speed: float) -> str | None:
    """Return why a report on the current cannot be true, or ``None``."""
    return current_fault(report) or _fault_of_time(report.measured_at, now, speed)


def fault_of_actuators(report: ActuatorReport, now: datetime, speed: float) -> str | None:
    """Return why a report on actuators cannot be true, or ``None``."""
    return actuator_fault(report) or _fault_of_time(report.measured_at, now, speed)


def fault_of_detection(detection: Detection, site: Site, now: datetime, speed: float) -> str | None:
    """Return why a heard tag cannot be true, or ``None``."""
    if fault := detection_fault(detection):
        return fault
    return _fault_of_time(detection.measured_at, now, speed) or _fault_of_position(
        detection.position_ned, detection.position_std_m, site
    )


def fault_of_receiver(report: ReceiverReport, now: datetime, speed: float) -> str | None:
    """Return why a report on a tag receiver cannot be true, or ``None``."""
    return receiver_fault(report) or _fault_of_time(report.measured_at, now, speed)


def _fault_of_time(measured_at: datetime, now: datetime, speed: float) -> str | None:
    if measured_at < _EARLIEST or measured_at - now > AHEAD_MAX * max(1.0, speed):
        return f"the time {measured_at:%Y-%m-%d %H:%MZ}"
    return None


def _fault_of_position(position: Sequence[float], std_m: float, site: Site) -> str | None:
    """Positions may err by their own uncertainty and leave the water a little; not more."""
    north_m, east_m, depth_m = position
    water = site.water
    if fault := STATE["position_std_m"].fault(std_m):
        return fault
    if not -_SURFACE_NOISE_M <= depth_m <= 1.2 * water.depth_max_m + _SURFACE_NOISE_M:
        return f"a depth of {depth_m:.2f} m in {water.depth_max_m:g} m of water"
    side_m = max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m)
    if not water.contains(north_m, east_m, 0.0, 0.5 * side_m + 5.0 * std_m):
        return f"a position {north_m:.1f} m north, {east_m:.1f} m east, far outside {site.name}"
    return None
