"""The map of one variable in one water by the configured model, growing with each sample."""

import dataclasses
import hashlib
import logging
import math
from collections import defaultdict
from collections.abc import Sequence
from datetime import datetime
from functools import reduce

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.channel import Channel
from autonomy.field.carriage import WARNED_SHARE, Carrier, Drifted, drifted
from autonomy.field.config import FieldConfig
from autonomy.field.grid import Grid
from autonomy.field.live.live_map import LiveMap, Prediction
from autonomy.field.samples import FieldSamples, joined
from autonomy.site import Box
from db.column import moment
from db.query.measured.samples import SampleColumns
from robot_link.messages import Sample
from server.fleet.current_words import metres
from server.map.field_model import MODEL_TITLES
from server.map.samples import field_samples, first_dive, in_moving_water, usable
from webui.scene.source import MapView, SampleView

log = logging.getLogger(__name__)

_REMEMBERED = 100
"""Samples at either end of a dive that its later ones are compared with."""

_NOT_CARRIED = "The samples are not carried: the map of the current tells too little."


class Seen:
    """Sequence numbers of several logs; numbers without a gap from 0 on cost nothing."""

    def __init__(self) -> None:
        self._next: dict[int, int] = {}
        """All numbers below this were seen, by log."""
        self._beyond: dict[int, set[int]] = {}

    def add(self, log: int, sequence: int) -> bool:
        """Note a number; tell whether it is new."""
        begin = self._next.get(log, 0)
        beyond = self._beyond.setdefault(log, set())
        if sequence < begin or sequence in beyond:
            return False
        beyond.add(sequence)
        while begin in beyond:
            beyond.remove(begin)
            begin += 1
        self._next[log] = begin
        return True


class SiteMap:
    """A map that grows; one thread at a time may change it, any may read its views.

    At rest it is what it shows and its samples, some 100 kB; awake it also has the factors that
    the next samples are taken in with, some 60 MB of a full map. Whatever needs these wakes it,
    which takes as long as to condition the map anew.

    Args:
        config: The model, with the fidelity thresholds that hold.
        channel: What it maps.
        grid: Where it is kept up to date.
        robots: Whose samples it takes, in the order in which they were added to the station.
        version: Count of the changes of the map that it takes the place of.
    """

    def __init__(
        self,
        config: FieldConfig,
        channel: Channel,
        grid: Grid,
        robots: tuple[str, ...],
        version: int = 0,
    ) -> None:
        self.config = config
        self.channel = channel
        self.grid = grid
        self.robots = robots
        self.version = version
        self.total = 0
        """Samples that were taken in, also those that a full map dropped."""
        self.smoothed = 0
        """How many of them smoothing located better."""
        self._live: LiveMap | None = None
        """``None`` at rest."""
        self._kept = FieldSamples.none()
        """What the map is of, while it is at rest."""
        self._seen: dict[str, Seen] = defaultdict(Seen)
        self.drifted: Drifted | None = None
        """How far the water of the oldest samples had moved when the map was made, if known."""
        self._is_current_known = True
        """Whether there was a map of the current when the map was made."""
        self._last: dict[str, FieldSamples] = {}
        """Samples of the newest dive by robot, which may go on."""
        self._refresh(self._awake(), None)

    @classmethod
    def from_columns(
        cls,
        config: FieldConfig,
        channel: Channel,
        grid: Grid,
        robots: tuple[str, ...],
        columns: SampleColumns,
        version: int = 0,
        carrier: Carrier | None = None,
        domain: Box | None = None,
    ) -> "SiteMap":
        """Condition a map on stored samples of its robots.

        Args:
            config: As for a map without samples.
            channel: As for a map without samples.
            grid: As for a map without samples.
            robots: As for a map without samples.
            columns: The samples.
            version: Count of the changes of the map that it takes the place of.
            carrier: Map of the current, where there is one; with ``config.carriage`` the samples
                are carried by it.
            domain: What is mapped; needed with a carrier.
        """
        site_map = cls(config, channel, grid, robots, version)
        for robot, log, sequence in zip(
            columns.robot.tolist(), columns.log.tolist(), columns.sequence.tolist(), strict=True
        ):
            site_map._seen[robots[robot]].add(log, sequence)
        site_map._is_current_known = carrier is not None
        columns = usable(columns)
        if not len(columns):
            return site_map
        samples = field_samples(columns)
        for number in np.unique(columns.robot).tolist():
            site_map._last[robots[number]] = _last_dive(samples[columns.robot == number])
        now_s = float(np.max(samples.time_s))
        if carrier is not None and domain is not None:
            site_map.drifted = drifted(samples, carrier, now_s)
            samples = in_moving_water(samples, config, carrier, domain)
        live = site_map._awake()
        live.replace(samples)
        site_map._note(samples)
        site_map._refresh(live, moment(int(columns.measured_at_us[-1])))
        return site_map

    def is_of(self, config: FieldConfig, grid: Grid, robots: tuple[str, ...]) -> bool:
        """Tell whether the map was made with these settings over this grid of these robots."""
        return (
            self.config == config
            and self.robots == robots
            and np.array_equal(self.grid.points, grid.points)
            and np.array_equal(self.grid.mask, grid.mask)
        )

    @property
    def is_at_rest(self) -> bool:
        """Whether the next samples cost as much as to make the map anew."""
        return self._live is None

    @property
    def memory_bytes(self) -> int:
        """What is kept to take in the next samples; 0 at rest."""
        live = self._live
        return 0 if live is None else live.memory_bytes

    def rest(self) -> None:
        """Give up what the next samples would be taken in with."""
        if self._live is not None:
            self._kept, self._live = self._live.samples, None

    @property
    def water_moved(self) -> str:
        """A sentence on how far the water moved while the map was made; empty if not far.

        Samples that are to be carried and cannot be are told of in any case.
        """
        moved, kernel = self.drifted, self.config.single
        if moved is None:
            is_missed = self.config.carriage == "water" and not self._is_current_known
            return _NOT_CARRIED if is_missed and self.total else ""
        told = f"the water moved about {metres(moved.way_m)} (give or take {metres(moved.std_m)})"
        if self.config.carriage == "water":
            return f"While this map was made {told}; its samples were carried along."
        if moved.way_m <= WARNED_SHARE * min(kernel.length_x_m, kernel.length_y_m):
            return ""
        return (
            f"While this map was made {told}; features that drift with it are misplaced by as much."
        )

    def append(self, samples: Sequence[Sample]) -> None:
        """Take in samples of the map's variable and robots that are not in it yet."""
        by_robot: dict[str, list[Sample]] = defaultdict(list)
        for sample in samples:
            if (
                sample.variable == self.config.variable
                and sample.robot in self.robots
                and self._seen[sample.robot].add(sample.log, sample.sequence)
                and _is_number(sample)
            ):
                by_robot[sample.robot].append(sample)
        if not by_robot:
            return
        fresh = reduce(joined, [self._of_robot(robot, new) for robot, new in by_robot.items()])
        fresh = fresh[np.argsort(fresh.time_s, kind="stable")]
        live = self._awake()
        live.append(fresh)
        self._note(fresh)
        self._refresh(live, max(sample.measured_at for new in by_robot.values() for sample in new))

    def predict(self, points: FloatArray) -> Prediction:
        """Return the map at any points, shape ``(q, 3)``, in ``O(n^3)``."""
        return self._awake().predict(points)

    def _awake(self) -> LiveMap:
        """Return the map with its factors: at rest these are made of the kept samples."""
        live = self._live
        if live is None:
            live = LiveMap(self.config, self.grid)
            if len(self._kept):
                live.replace(self._kept)
            self._live, self._kept = live, FieldSamples.none()
        return live

    def _of_robot(self, robot: str, samples: Sequence[Sample]) -> FieldSamples:
        before = self._last.get(robot)
        fresh = FieldSamples.of(
            np.array([sample.position_ned for sample in samples]),
            np.array([sample.value for sample in samples]),
            np.array([sample.position_std_m for sample in samples]),
            time_s=np.array([sample.measured_at.timestamp() for sample in samples]),
            after=before,
        )
        if before is None:
            first = first_dive(self.robots.index(robot))
            fresh = dataclasses.replace(fresh, dive=fresh.dive + first)
        self._last[robot] = _last_dive(fresh if before is None else joined(before, fresh))
        return fresh

    def _note(self, samples: FieldSamples) -> None:
        self.total += len(samples)
        self.smoothed += int(np.count_nonzero(samples.position_std_m < samples.filtered_std_m))

    def _refresh(self, live: LiveMap, at: datetime | None) -> None:
        self.version += 1
        kept = live.samples
        self.view = view_on_grid(
            self.config,
            self.channel,
            self.grid,
            live.mean,
            live.std,
            samples_per_level=live.samples_per_level,
            version=self.version,
            updated_at=at,
        )
        self.samples = SampleView(
            position_ned=kept.points,
            fidelity=live.sample_levels,
            is_smoothed=kept.position_std_m < kept.filtered_std_m,
        )


def _last_dive(samples: FieldSamples) -> FieldSamples:
    """Return what tells of the newest dive: its samples, of very many the first and the last."""
    mine = np.flatnonzero(samples.dive == samples.dive[-1])
    return samples[np.unique(np.concatenate([mine[:_REMEMBERED], mine[-_REMEMBERED:]]))]


def view_on_grid(
    config: FieldConfig,
    channel: Channel,
    grid: Grid,
    mean: FloatArray,
    std: FloatArray,
    *,
    samples_per_level: tuple[int, ...],
    version: int,
    updated_at: datetime | None,
) -> MapView:
    """Return a map as it is shown: no numbers where there is no water.

    Args:
        config: Names model and scale.
        channel: What it is of.
        grid: The points.
        mean: Shape ``(q,)``, in the model's scale.
        std: Shape ``(q,)``.
        samples_per_level: Samples behind the map by fidelity level.
        version: Changes whenever the arrays do.
        updated_at: When the newest of its samples was taken.
    """
    variable = dataclasses.replace(channel, scale=config.resolved_scale())
    return MapView(
        variable=variable,
        model=config.model,
        title=MODEL_TITLES[config.model],
        x_m=grid.x_m,
        y_m=grid.y_m,
        z_m=grid.z_m,
        mean=np.where(grid.mask, mean, np.nan).reshape(grid.shape),
        std=np.where(grid.mask, std, np.nan).reshape(grid.shape),
        samples_per_level=samples_per_level,
        version=version,
        updated_at=updated_at,
    )


def basis_of(config: FieldConfig, domain: Box, total: int, smoothed: int) -> str:
    """Return a name for what a map was made of: settings, domain and samples.

    Args:
        config: Settings; the model and how it learns do not count.
        domain: Where.
        total: Number of samples.
        smoothed: How many of them are smoothed.
    """
    made_of = config.model_dump_json(exclude={"model", "learning"})
    text = f"{made_of} {domain.model_dump_json()} {total} {smoothed}"
    return hashlib.sha256(text.encode()).hexdigest()


def _is_number(sample: Sample) -> bool:
    """Tell whether every number of a sample is one; whatever let it in, a map cannot take it."""
    numbers = (*sample.position_ned, sample.position_std_m, sample.value)
    if all(map(math.isfinite, numbers)) and sample.position_std_m >= 0.0:
        return True
    log.warning(
        "sample %d of %s is left out of the map: %s", sample.sequence, sample.robot, numbers
    )
    return False
