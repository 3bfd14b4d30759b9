"""The plant of the tracking chapter: a unicycle whose inputs are held for a step."""

import math

from autonomy.compiled import inlined_entry


def advance(
    pose: tuple[float, float, float, float],
    turn_rate_rad_s: float,
    acceleration: float,
    dt_s: float,
) -> tuple[float, float, float, float]:
    """Move a unicycle by one classical Runge-Kutta step.

    Args:
        pose: North and east (m), heading (rad), speed (m/s); the speed may be negative.
        turn_rate_rad_s: First input, rad/s, held over the step.
        acceleration: Second input, m/s2, held over the step.
        dt_s: Length of the step, s.

    Returns:
        The pose after the step; the heading is not wrapped.

    Source:
        Coleman, thesis, Eq. (4.14).
    """

    def rates(heading: float, speed: float) -> tuple[float, float]:
        return speed * math.cos(heading), speed * math.sin(heading)

    north, east, psi, v = pose
    half_psi, half_v = psi + 0.5 * dt_s * turn_rate_rad_s, v + 0.5 * dt_s * acceleration
    end_psi, end_v = psi + dt_s * turn_rate_rad_s, v + dt_s * acceleration
    # Neither rate depends on the position, so the two inner stages are the same.
    k1, k23, k4 = rates(psi, v), rates(half_psi, half_v), rates(end_psi, end_v)
    return (
        north + dt_s / 6.0 * (k1[0] + 4.0 * k23[0] + k4[0]),
        east + dt_s / 6.0 * (k1[1] + 4.0 * k23[1] + k4[1]),
        end_psi,
        end_v,
    )


@inlined_entry
def advance_kernel(
    north: float, east: float, psi: float, v: float, u1: float, u2: float, dt_s: float
) -> tuple[float, float, float, float]:
    """Do the work of ``advance`` inside another kernel."""
    half_psi, half_v = psi + 0.5 * dt_s * u1, v + 0.5 * dt_s * u2
    end_psi, end_v = psi + dt_s * u1, v + dt_s * u2
    step = dt_s / 6.0
    return (
        north
        + step
        * (v * math.cos(psi) + 4.0 * (half_v * math.cos(half_psi)) + end_v * math.cos(end_psi)),
        east
        + step
        * (v * math.sin(psi) + 4.0 * (half_v * math.sin(half_psi)) + end_v * math.sin(end_psi)),
        end_psi,
        end_v,
    )


def warm_up() -> None:
    """Compile the kernel."""
    advance_kernel(0.0, 0.0, 0.0, 0.1, 0.1, 0.0, 0.1)
