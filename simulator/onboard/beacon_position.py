"""Where a robot without a fix is by its ranges to one beacon of known place."""

from dataclasses import replace

from autonomy.tracking.beacon import BeaconFix, BeaconNavigator
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.inner_loop import Swimming
from autonomy.tracking.reading import RangeHeard
from simulator.onboard.navigation import Estimate


class BeaconPosition:
    """Begins with the last fix of each dive, and is given up for the next fix.

    Args:
        config: The mission; its target is the beacon.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._navigator: BeaconNavigator | None = None
        self._newest: BeaconFix | None = None

    def step(
        self, estimate: Estimate, now: Swimming, ranges: tuple[RangeHeard, ...], dt_s: float
    ) -> None:
        """Take in ranges to the beacon, horizontal ones."""
        if estimate.has_fix:
            self._navigator = self._newest = None
            return
        if self._navigator is None:
            self._navigator = BeaconNavigator(
                self._config,
                estimate.position_ned[:2],
                estimate.position_std_m,
                now.course_rad,
                now.speed_m_s,
            )
        self._newest = self._navigator.step(
            now.course_rad,
            now.speed_m_s,
            dt_s,
            turn_rate_rad_s=now.turn_rate_rad_s,
            acceleration_m_s2=now.acceleration_m_s2,
            ranges=ranges,
        )

    def located(self, estimate: Estimate) -> Estimate:
        """Return the estimate at the beacon's position, if that is sure and the better one."""
        fix = self._newest
        if fix is None or estimate.has_fix or not fix.is_sure:
            return estimate
        if fix.position_std_m >= estimate.position_std_m:
            return estimate
        north, east = fix.position_ne_m
        return replace(
            estimate,
            position_ned=(north, east, estimate.depth_m),
            position_std_m=fix.position_std_m,
        )
