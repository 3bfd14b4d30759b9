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
        ValueError: If a number is not finite, negative where it cannot be, or more than 1 where it
            is a probability or an inverse condition number; or if a covariance is none.
    """
    if not all(math.isfinite(number) for number in _numbers(track)):
        raise ValueError("a number of a track is not finite")
    if track.range_m is not None and min(track.range_m, track.range_age_s) < 0.0:
        raise ValueError("the range of a track, or its age, is negative")
    if not 0 <= track.ranges_rejected <= track.ranges_heard:
        raise ValueError("a track has more ranges that were not believed than were heard")
    if not -_ROUNDING <= track.inverse_condition <= 1.0 + _ROUNDING:
        raise ValueError("the inverse condition number of a track does not lie within 0 and 1")
    for one in track.hypotheses:
        _check_hypothesis(one)
    return track


def _check_hypothesis(one: TargetEstimate) -> None:
    if not 0.0 <= one.weight <= 1.0 + _ROUNDING:
        raise ValueError("the probability of a hypothesis does not lie within 0 and 1")
    north, both, east = one.covariance_m2
    if min(north, east) < 0.0 or abs(both) > math.sqrt(north) * math.sqrt(east) * (1.0 + _ROUNDING):
        raise ValueError("the covariance of a hypothesis is none")


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
