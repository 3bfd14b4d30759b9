"""How the robot moves over ground, where fixes show what the water does to it."""

from onboard.flight.navigation import Estimate


class GroundMotion:
    """Adds to the velocity through the water what fixes show of the current.

    A target and its ranges know nothing of the water, and an eddy of a tank is as fast as a fifth
    of the robot. Without fixes the last current is kept.

    Args:
        current_time_s: Time over which the current is averaged; as short as the fixes are good.
        period_s: Time between two steps.
    """

    def __init__(self, current_time_s: float, period_s: float) -> None:
        self._share = min(period_s / current_time_s, 1.0)
        self._period_s = period_s
        self._before_ne_m: tuple[float, float] | None = None
        self._current_ne_m_s = (0.0, 0.0)

    def step(self, estimate: Estimate) -> tuple[float, float]:
        """Return the velocity over ground, north and east, m/s."""
        position, through_water = estimate.position_ned[:2], estimate.velocity_ned[:2]
        before = self._before_ne_m
        # what the first fix after a dive corrects is no motion
        self._before_ne_m = position if estimate.has_fix else None
        if before is not None and estimate.has_fix:
            north, east = (
                current + self._share * ((now - then) / self._period_s - water - current)
                for current, now, then, water in zip(
                    self._current_ne_m_s, position, before, through_water, strict=True
                )
            )
            self._current_ne_m_s = (north, east)
        return (
            through_water[0] + self._current_ne_m_s[0],
            through_water[1] + self._current_ne_m_s[1],
        )
