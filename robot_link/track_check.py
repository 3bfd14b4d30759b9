"""What a track report can say, whichever wire brought it."""

import math

from autonomy.tracking.phase import TrackPhase
from robot_link.messages import TargetEstimate, TrackReport

MOST_HYPOTHESES = 2
_ROUNDING = 1e-2
"""What the roundings of a wire may add to a probability, a condition number or a correlation."""


def track_phase(number: int) -> TrackPhase:
    """Return the phase of a wire's number.

    Raises:
        ValueError: If there is none.
    """
    try:
        return TrackPhase(number)
    except ValueError as error:
        raise ValueError(f"phase {number} of a track is unknown") from error


def checked_track(track: TrackReport) -> TrackReport:
    """Return a track that is possible.

    Raises:
        ValueError: If it is not; see ``track_fault``.
    """
    if fault := track_fault(track):
        raise ValueError(f"a track has {fault}")
    return track


def track_fault(track: TrackReport) -> str:
    """Return what is impossible about a track, "" if nothing is.

    A number that is not finite, negative where it cannot be, or more than 1 where it is a
    probability or an inverse condition number; or a covariance that is none.
    """
    if not all(math.isfinite(number) for number in _numbers(track)):
        return "a number that is not finite"
    if track.range_m is not None and track.range_m < 0.0:
        return f"a range of {track.range_m:.3g} m"
    if track.range_m is not None and track.range_age_s < 0.0:
        return f"a range that is {track.range_age_s:.3g} s old"
    if not 0 <= track.ranges_rejected <= track.ranges_heard:
        return "more ranges that were not believed than were heard"
    if not -_ROUNDING <= track.inverse_condition <= 1.0 + _ROUNDING:
        return f"an inverse condition number of {track.inverse_condition:.3g}"
    faults = map(_hypothesis_fault, track.hypotheses)
    return next((fault for fault in faults if fault), "")


def _hypothesis_fault(one: TargetEstimate) -> str:
    if not 0.0 <= one.weight <= 1.0 + _ROUNDING:
        return f"a hypothesis with a probability of {one.weight:.3g}"
    north, both, east = one.covariance_m2
    if min(north, east) < 0.0 or abs(both) > math.sqrt(north) * math.sqrt(east) * (1.0 + _ROUNDING):
        return "a covariance that is none"
    return ""


def _numbers(track: TrackReport) -> tuple[float, ...]:
    numbers = (
        *track.position_ne_m,
        *(() if track.range_m is None else (track.range_m, track.range_age_s)),
        track.determinant_m2_s,
        track.barrier,
        track.inverse_condition,
        *track.nominal,
        *track.command,
        *(track.true_ne_m or ()),
    )
    estimates = (
        number
        for one in track.hypotheses
        for number in (*one.position_ne_m, *one.velocity_ne_m_s, *one.covariance_m2, one.weight)
    )
    return (*numbers, *estimates)
