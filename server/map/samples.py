"""The samples behind a map: those of all robots of one water, where they most probably were.

Which robots share a water, ``server.fleet.water`` says.
"""

import logging
from collections.abc import Mapping, Sequence

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, IntArray
from autonomy.channel import Channel
from autonomy.field.carriage import Carrier, carried
from autonomy.field.config import FieldConfig
from autonomy.field.samples import FieldSamples
from autonomy.seawater import DERIVED
from autonomy.site import Box
from db.column import microseconds
from db.deployment_span import LiveSpan
from db.query.fleet.deployments import joint_spans
from db.query.measured.derived import derived_columns
from db.query.measured.samples import SampleColumns, sample_columns
from server.fleet.water import site_robots

log = logging.getLogger(__name__)

_NEVER_US = np.iinfo(np.int64).max
_DIVES_PER_ROBOT = 1 << 32
"""Numbers of dives of different robots lie this far apart."""


def site_samples(session: Session, robot: str, channel: Channel) -> FieldSamples:
    """Return every believable sample of a channel for the map of a robot, in order of time.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    robots = site_robots(session, robot)
    within = joint_spans(session, robots)
    return field_samples(map_columns(session, robots, channel, within))


def map_columns(
    session: Session, robots: Sequence[str], channel: Channel, within: Mapping[str, LiveSpan]
) -> SampleColumns:
    """Return what robots measured of a channel in deployments, without values it cannot have.

    What none of them measured is derived, where that can be. Of very many an even part is taken:
    a map keeps no more, and none would be made of months in the memory of a station.
    """
    columns = sample_columns(session, robots, channel.key, within=within, thins=True)
    if not len(columns) and channel.key in DERIVED:
        derived = derived_columns(session, robots, channel.key)
        columns = derived.chosen(_taken_in(derived, robots, within))
    can_be = (columns.value >= channel.low) & (columns.value <= channel.high)
    return columns if can_be.all() else columns.chosen(can_be)


def _taken_in(
    columns: SampleColumns, robots: Sequence[str], within: Mapping[str, LiveSpan]
) -> BoolArray:
    """Return which measurements were taken in these deployments, shape ``(n,)``."""
    taken = np.zeros(len(columns), dtype=np.bool_)
    for place, robot in enumerate(robots):
        span = within.get(robot)
        if span is not None:
            begun = columns.measured_at_us >= microseconds(span.started_at)
            end_us = _NEVER_US if span.ended_at is None else microseconds(span.ended_at)
            taken |= (columns.robot == place) & begun & (columns.measured_at_us < end_us)
    return taken


def field_samples(columns: SampleColumns) -> FieldSamples:
    """Return stored samples as the field models take them; those that are no numbers left out.

    Dives are numbered for each robot by itself, so that no two robots share one.
    """
    columns = usable(columns)
    return FieldSamples.of(
        columns.smoothed_ned,
        columns.value,
        columns.smoothed_std_m,
        filtered_std_m=columns.position_std_m,
        dive=_dives(columns),
        time_s=columns.measured_at_us * 1e-6,
        believed=columns.position_ned,
    )


def in_moving_water(
    samples: FieldSamples, config: FieldConfig, carrier: Carrier | None, domain: Box
) -> FieldSamples:
    """Return samples where a map with these settings has them: with ``carriage`` carried along.

    Args:
        samples: Where they were taken.
        config: Of the map.
        carrier: Map of the current, where there is one that may be relied upon.
        domain: What is mapped.
    """
    if config.carriage == "still" or carrier is None or not len(samples):
        return samples
    return carried(samples, carrier, float(np.max(samples.time_s)), domain)


def usable(columns: SampleColumns) -> SampleColumns:
    """Return the samples of which every number is one, and log how many are not."""
    numbers = np.column_stack(
        [
            columns.position_ned,
            columns.position_std_m,
            columns.smoothed_ned,
            columns.smoothed_std_m,
            columns.value,
        ]
    )
    good = np.isfinite(numbers).all(axis=1) & (columns.smoothed_std_m >= 0.0)
    if good.all():
        return columns
    log.warning("%d stored samples are no numbers and are left out of the map", (~good).sum())
    return columns.chosen(good)


def first_dive(robot: int) -> int:
    """Return the number from which the dives of the robot of this number in a map are counted."""
    return robot * _DIVES_PER_ROBOT


def _dives(columns: SampleColumns) -> IntArray:
    dives = np.zeros(len(columns), dtype=np.int64)
    for robot in np.unique(columns.robot).tolist():
        mine = columns.robot == robot
        alone = FieldSamples.of(
            columns.position_ned[mine], columns.value[mine], columns.position_std_m[mine]
        )
        dives[mine] = first_dive(robot) + alone.dive
    return dives
