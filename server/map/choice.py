"""Which channel the map of a robot is of, and what its settings then are."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.channel import Channel
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.seawater import DERIVED, can_derive
from db.query.fleet.deployments import joint_spans
from db.query.measured.samples import kept_counts
from db.query.station.configurations import configuration_history
from server.base.foundation import Foundation
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.fleet.water import site_robots
from server.map.samples import map_columns
from server.map.view import MapChoiceView

_KIND = "field"
_LEAST_SAMPLES = 10
_LEAST_SHARE = 1e-3
"""Smallest standard deviation that is believed, as a share of the mean."""


class MapChoices:
    """Offers the channels of a water, and lets a robot's map be of another one."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._fleet = fleet

    async def offered(self, robot: str) -> list[MapChoiceView]:
        """Return what robots of the water have told or announced, as far as it can be mapped.

        Raises:
            Problem: 404 if there is no such robot.
        """
        self._fleet.status(robot)
        now = (await self._foundation.configurations.current(_KIND, robot)).value_as(FieldConfig)
        entries = self._foundation.channels.entries
        here = await self._foundation.store.query(lambda session: site_robots(session, robot))
        counts = await self._foundation.store.query(lambda session: _counts(session, here))
        announced = self._announced(here)
        return [
            MapChoiceView(
                variable=one.channel.key,
                title=one.channel.title,
                unit=one.channel.unit,
                samples=counts.get(one.channel.key, 0),
                is_derived=_is_derived(one.channel.key, counts),
                is_chosen=one.channel.key == now.variable,
            )
            for one in entries
            if one.channel.key == now.variable
            or (
                one.channel.can_map
                and not one.is_retired
                and (_is_told(one.channel.key, counts) or one.channel.wire_number in announced)
            )
        ]

    def _announced(self, robots: Iterable[str]) -> set[int]:
        """Return the wire numbers that robots announced and that mean what the catalogue says."""
        found = set[int]()
        here = set(robots)
        for status in self._fleet.statuses:
            if status.record.id in here and status.announced is not None:
                numbers = {row.number for row in status.announced.table.rows}
                found |= numbers - set(status.channel_faults)
        return found

    async def choose(self, robot: str, variable: str, by: str) -> None:
        """Let the map of a robot be of another channel.

        The newest settings that the robot had for it hold again. Without such, they are those of
        the present map with mean and variance of what was measured, until they are learned.

        Raises:
            Problem: 404 if there is no such robot, 409 for a recording, 422 for what is no map.
        """
        refuse_recording(self._fleet.status(robot), "has the maps of its import")
        channels, book = self._foundation.channels, self._foundation.configurations
        channels.check_mapped(variable)
        now = (await book.current(_KIND, robot)).value_as(FieldConfig)
        if now.variable == variable:
            return
        preset = (await book.current(_KIND, robot)).preset
        channel = channels.catalogue[variable]

        def settings(session: Session) -> Mapping[str, Any]:
            for version in configuration_history(session, _KIND, robot, 1000):
                if version.value.get("variable") == variable:
                    return version.value
            if isinstance(preset, FieldConfig) and preset.variable == variable:
                return preset.model_dump(mode="json")
            robots = site_robots(session, robot)
            taken = map_columns(session, robots, channel, joint_spans(session, robots))
            return settings_for(channel, now, taken.value).model_dump(mode="json")

        found = await self._foundation.store.query(settings)
        await book.patch(_KIND, robot, found, by=by)


def settings_for(channel: Channel, now: FieldConfig, values: FloatArray) -> FieldConfig:
    """Return settings of a channel's map from those of another and what was measured.

    How far the field stays alike is taken over; mean and variances are those of the values.

    Args:
        channel: What is to be mapped.
        now: Settings of the map of another channel of the same water.
        values: What was measured, in the channel's unit, shape ``(n,)``.
    """
    blank = now.model_copy(
        update={
            "variable": channel.key,
            "scale": "variable",
            "log_floor": None,
            "threshold": None,
            "slope_north_per_m": 0.0,
            "slope_east_per_m": 0.0,
            "slope_depth_per_m": 0.0,
        }
    )
    if len(values) < _LEAST_SAMPLES:
        return blank
    seen = blank.for_channel(channel).in_model_scale(values)
    mean = float(np.mean(seen))
    std = max(float(np.std(seen)), _LEAST_SHARE * abs(mean), 1e-9)
    factor = std**2 / now.single.signal_variance

    def scaled(kernel: KernelParameters) -> KernelParameters:
        return kernel.model_copy(
            update={
                "signal_variance": float(np.clip(kernel.signal_variance * factor, 1e-12, 1e6)),
                "noise_variance": float(np.clip(kernel.noise_variance * factor, 1e-12, 1e6)),
            }
        )

    return blank.model_copy(
        update={
            "prior_mean": float(np.clip(mean, -1e6, 1e6)),
            "single": scaled(now.single),
            "levels": tuple(map(scaled, now.levels)),
            "joint_levels": tuple(map(scaled, now.joint_levels)),
        }
    )


def _counts(session: Session, robots: Iterable[str]) -> dict[str, int]:
    found: dict[str, int] = {}
    for one in robots:
        for key, count in kept_counts(session, one).items():
            found[key] = found.get(key, 0) + count
    return found


def _is_derived(key: str, counts: Mapping[str, int]) -> bool:
    return key in DERIVED and can_derive(key, set(counts))


def _is_told(key: str, counts: Mapping[str, int]) -> bool:
    return key in counts or _is_derived(key, counts)
