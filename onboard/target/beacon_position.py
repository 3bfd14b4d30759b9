"""Where a robot without a fix is by its ranges to one beacon of known place."""

from dataclasses import replace

import numpy as np

from autonomy.tracking.beacon import BeaconFix, BeaconNavigator
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.reading import RangeHeard
from onboard.flight.navigation import Estimate

_SEED = 5
"""Of the navigator's random numbers: the same dive is always located alike."""


class BeaconPosition:
    """Begins with the last fix of each dive, and is given up for the next fix.

    Args:
        config: The mission; its target is the beacon.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._navigator: BeaconNavigator | None = None
        self._newest: BeaconFix | None = None
        self._reckoned: Estimate | None = None

    def step(self, ranges: tuple[RangeHeard, ...], dt_s: float) -> None:
        """Let time pass since the estimate that was located, and take in horizontal ranges."""
        reckoned = self._reckoned
        if reckoned is None or reckoned.has_fix:
            self._navigator = self._newest = None
            return
        own, std_m = reckoned.position_ned[:2], reckoned.position_std_m
        if self._navigator is None:
            chance = np.random.default_rng(_SEED)
            self._navigator = BeaconNavigator(self._config, own, std_m, chance)
        self._newest = self._navigator.step(own, std_m, dt_s, ranges)

    def located(self, reckoned: Estimate) -> Estimate:
        """Return an estimate at the beacon's position, if that is the better one.

        Args:
            reckoned: By dead reckoning alone.
        """
        self._reckoned, fix = reckoned, self._newest
        if fix is None or reckoned.has_fix or fix.position_std_m >= reckoned.position_std_m:
            return reckoned
        north, east = fix.position_ne_m
        return replace(
            reckoned,
            position_ned=(north, east, reckoned.depth_m),
            position_std_m=fix.position_std_m,
        )
