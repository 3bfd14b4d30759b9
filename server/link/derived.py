"""The newest values of derived channels, computed beside the event loop."""

import asyncio
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from autonomy.channel import ChannelCatalogue
from autonomy.seawater import DERIVED, MEASURED, can_derive, derived
from autonomy.site import Site
from robot_link.clock import Clock
from robot_link.messages import Sample
from server.base.channels import Channels
from server.base.wakeups import Wakeups
from server.fleet.fleet import Fleet

_REST_S = 1.0
"""Wall time between two looks."""
_APART_S = 10.0
"""Measurements that lie farther apart in time than this are not of one water."""


class DerivedValues:
    """Keeps what follows of each robot's newest measurements. Belongs to one event loop."""

    def __init__(self, fleet: Fleet, clock: Clock, channels: Channels) -> None:
        self._fleet = fleet
        self._channels = channels
        self._looks = Wakeups(clock, _REST_S)
        self._made_of: dict[str, dict[str, Sample]] = {}

    def look_at(self, robot: str) -> None:
        """Compute anew soon, if a robot has measured anything that matters."""
        if self._fresh(robot):
            self._looks.wake(robot)

    async def run(self) -> None:
        """Compute until cancelled."""
        while True:
            for robot in await self._looks.next():
                fresh, known = self._fresh(robot), self._channels.catalogue
                if fresh:
                    self._made_of[robot] = fresh
                    site = self._fleet.status(robot).record.site
                    values = await asyncio.to_thread(derived_values, fresh, site, known)
                    self._fleet.set_derived(robot, values)

    def _fresh(self, robot: str) -> dict[str, Sample]:
        """Return a robot's newest measurements of the water, empty where they are known."""
        samples = self._fleet.status(robot).samples
        told = {key: samples[key] for key in MEASURED if key in samples}
        is_known = told == self._made_of.get(robot, {})
        return {} if is_known or not any(can_derive(key, told) for key in DERIVED) else told


def derived_values(
    told: Mapping[str, Sample], site: Site, channels: ChannelCatalogue
) -> dict[str, Sample]:
    """Return what follows of measurements that belong together, each with the age of the oldest."""
    base = told["temperature"]
    together = {
        key: sample
        for key, sample in told.items()
        if abs((sample.measured_at - base.measured_at).total_seconds()) <= _APART_S
    }
    columns = {key: np.array([sample.value]) for key, sample in together.items()}
    found: dict[str, Sample] = {}
    for key in DERIVED:
        if not can_derive(key, columns):
            continue
        (value,) = derived(
            key,
            columns,
            np.array([base.position_ned[2]]),
            site.origin_latitude_deg,
            site.origin_longitude_deg,
        ).tolist()
        if math.isfinite(value) and channels[key].fault(value) is None:
            oldest = min(together.values(), key=lambda sample: sample.measured_at)
            found[key] = replace(oldest, variable=key, value=value)
    return found
