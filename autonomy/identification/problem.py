"""The fit as arrays: segments, measurements and their weights, and what a candidate predicts."""

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.campaign import Cluster
from autonomy.identification import kernel
from autonomy.identification.config import IdentificationConfig, NoiseLevels
from autonomy.identification.initial import initial_guess, initial_precision
from autonomy.identification.progress import IdentificationError
from autonomy.identification.recording import Recording, SegmentReport, segments
from autonomy.identification.unknown import Unknown, packed_candidates, unknowns
from autonomy.vehicle.config import Vehicle

CHANNELS = ("north_m", "east_m", "depth_m", "roll_rad", "pitch_rad", "heading_rad")
"""Columns of what is measured and predicted."""
_MOST_ROWS = 4000
_LOST = 1e9
"""A prediction this far off is one of a motion that left all bounds; its square may overflow."""


class NothingToIdentifyError(IdentificationError):
    """The recording holds too little, or nothing may change; the message says which."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Arrays of a fit, as ``autonomy.identification.kernel`` takes them."""

    segment_node: IntArray
    """First node of the integration of each segment, and one past the last, ``(segments + 1,)``."""
    node_inputs: FloatArray
    """Net mass kg, sliding mass m and tail rad at each node, shape ``(nodes, 3)``."""
    node_step_s: FloatArray
    """Time from each node to the next, 0 at the end of a segment, shape ``(nodes,)``."""
    node_row: IntArray
    """Row that each node belongs to, -1 in between, shape ``(nodes,)``."""
    segment_row: IntArray
    """First row of each segment, and one past the last, shape ``(segments + 1,)``."""
    time_s: FloatArray
    """Of each used row, shape ``(rows,)``."""
    measured: FloatArray
    """Shape ``(rows, 6)``, columns as ``CHANNELS``."""
    weight: FloatArray
    """One over the standard deviation, 0 where nothing was measured, ``(rows, 6)``."""

    @property
    def segments(self) -> int:
        """Number of segments."""
        return self.segment_node.size - 1

    @property
    def nodes(self) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
        """The arrays of the integration, in the order in which the kernels take them."""
        return self.segment_node, self.node_inputs, self.node_step_s, self.node_row


@dataclass(frozen=True, slots=True)
class Problem:
    """Everything that a method needs to know: the data, the model and what is sought.

    The initial state of each segment is unknown too: twelve nuisance numbers with a broad prior
    (``autonomy.identification.initial``), which the methods remove by projection. So noise in the
    first row, and velocities that nobody measures, do not spoil the parameters.
    """

    vehicle: Vehicle
    config: IdentificationConfig
    sought: tuple[Unknown, ...]
    recording: Recording
    report: SegmentReport
    layout: Layout
    guess: FloatArray
    """Mean of the initial states' prior, shape ``(segments, 12)``."""
    precision: FloatArray
    """One over the prior's variances, shape ``(12,)``."""

    @property
    def low(self) -> FloatArray:
        """Lower border of the box in units of the scales, shape ``(n,)``."""
        return np.array([unknown.low for unknown in self.sought])

    @property
    def high(self) -> FloatArray:
        """Upper border of the box in units of the scales, shape ``(n,)``."""
        return np.array([unknown.high for unknown in self.sought])

    @property
    def degrees(self) -> int:
        """Number of residuals less the initial states that they must tell as well."""
        rows = self.layout.segment_row
        seen = sum(
            12 if self.layout.weight[rows[s] : rows[s + 1], 0].any() else 10
            for s in range(self.layout.segments)
        )
        return max(int(np.count_nonzero(self.layout.weight)) - seen, 1)

    def piece(self, first: int, stop: int) -> "Problem":
        """Return the same fit to some segments in a row; the arrays are shared."""
        layout = self.layout
        node, row = layout.segment_node[first], layout.segment_row[first]
        nodes = slice(node, layout.segment_node[stop])
        rows = slice(row, layout.segment_row[stop])
        marks = layout.node_row[nodes]
        part = Layout(
            layout.segment_node[first : stop + 1] - node,
            layout.node_inputs[nodes],
            layout.node_step_s[nodes],
            np.where(marks >= 0, marks - row, -1),
            layout.segment_row[first : stop + 1] - row,
            layout.time_s[rows],
            layout.measured[rows],
            layout.weight[rows],
        )
        report = replace(self.report, segments=self.report.segments[first:stop])
        return replace(self, layout=part, report=report, guess=self.guess[first:stop])

    def pieces(self) -> Iterator[tuple[slice, "Problem"]]:
        """Yield places of segments and the fit to them, each of them small enough for memory.

        Sensitivities hold hundreds of numbers a row, which a long recording cannot afford at once.
        """
        rows = self.layout.segment_row
        first = 0
        while first < self.layout.segments:
            reach = int(np.searchsorted(rows, rows[first] + _MOST_ROWS, side="right")) - 1
            stop = min(max(reach, first + 1), self.layout.segments)
            yield slice(first, stop), self.piece(first, stop)
            first = stop

    def simulate(
        self, u: FloatArray, initial: FloatArray, workers: "Workers"
    ) -> tuple[FloatArray, BoolArray]:
        """Predict all rows for several candidates.

        Args:
            u: Unknowns in units of their scales, shape ``(m, n)``.
            initial: Initial states, shape ``(m, segments, 12)``.
            workers: Threads.

        Returns:
            Positions and attitudes, shape ``(m, rows, 6)``, and whether each candidate stayed
            within all bounds, ``(m,)``; what follows a divergence is NaN.
        """
        packed, offsets = packed_candidates(self.vehicle, self.sought, u)
        m = u.shape[0]
        predicted = np.full((m, *self.layout.measured.shape), np.nan)
        sound = np.zeros(m, dtype=np.bool_)
        extended = self.config.model == "extended"

        def run(first: int, stop: int) -> None:
            part = slice(first, stop)
            kernel.predict(
                packed[part],
                offsets[part],
                initial[part],
                extended,
                *self.layout.nodes,
                predicted[part],
                sound[part],
            )

        workers.share(run, m)
        return predicted, sound

    def residual(self, predicted: FloatArray) -> FloatArray:
        """Return weighted residuals, shape ``(..., rows, 6)``; angles are compared as angles."""
        error = predicted - self.layout.measured
        error[~(np.abs(error) < _LOST)] = np.nan
        angle = error[..., 3:]
        angle -= 2.0 * math.pi * np.floor(angle / (2.0 * math.pi) + 0.5)
        return np.where(self.layout.weight > 0.0, error * self.layout.weight, 0.0)


class Workers:
    """A few threads that share out candidates; who computes what does not change any number.

    Args:
        threads: How many.
        cluster: Where whole swarms are worked out instead.
    """

    def __init__(self, threads: int, cluster: Cluster | None = None) -> None:
        self.cluster = cluster
        self._threads = max(threads, 1)
        self._pool = ThreadPoolExecutor(self._threads, "identify") if threads > 1 else None

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown()

    def share(self, run: Callable[[int, int], None], count: int) -> None:
        """Call ``run(first, stop)`` until all of ``range(count)`` is done."""
        if self._pool is None:
            run(0, count)
            return
        borders = np.linspace(0, count, min(count, 4 * self._threads) + 1).astype(int).tolist()
        list(self._pool.map(run, borders[:-1], borders[1:]))


def problem_from(
    vehicle: Vehicle,
    recording: Recording,
    config: IdentificationConfig,
    *,
    sought: Sequence[Unknown] | None = None,
    report: SegmentReport | None = None,
) -> Problem:
    """Lay out the fit of a vehicle's model to a recording.

    Args:
        vehicle: Where the search starts.
        recording: What the robot reported.
        config: What may change, the noise, and what to leave out.
        sought: What is sought, if not what ``config`` frees.
        report: The segments of the recording, if they are known already.

    Raises:
        NothingToIdentifyError: If no part of the recording is sound, or nothing may change.
    """
    wanted = unknowns(vehicle, config) if sought is None else tuple(sought)
    if not wanted:
        raise NothingToIdentifyError("no parameter may change: free at least one group")
    report = report or segments(recording, config.rules)
    if not report.segments:
        why = sorted({reason.kind.replace("_", " ") for reason in report.left_out})
        raise NothingToIdentifyError(
            "no part of the recording can be held against the model"
            + (f" (left out: {', '.join(why)})" if why else "")
        )
    layout = _layout(recording, report, config)
    guess = initial_guess(
        layout.time_s, layout.measured, layout.weight, layout.segment_row, vehicle
    )
    return Problem(
        vehicle, config, wanted, recording, report, layout, guess, initial_precision(vehicle)
    )


def _layout(recording: Recording, report: SegmentReport, config: IdentificationConfig) -> Layout:
    inputs: list[FloatArray] = []
    steps: list[FloatArray] = []
    rows_of_nodes: list[IntArray] = []
    segment_node, segment_row = [0], [0]
    for segment in report.segments:
        time_s = recording.time_s[segment.rows]
        at, row = _nodes(time_s, config.step_s)
        recorded = recording.inputs[segment.rows]
        inputs.append(np.column_stack([np.interp(at, time_s, recorded[:, k]) for k in range(3)]))
        steps.append(np.append(np.diff(at), 0.0))
        rows_of_nodes.append(np.where(row >= 0, row + segment_row[-1], -1))
        segment_node.append(segment_node[-1] + at.size)
        segment_row.append(segment_row[-1] + time_s.size)
    used = recording.taken(np.concatenate([segment.rows for segment in report.segments]))
    return Layout(
        np.array(segment_node, dtype=np.int64),
        np.concatenate(inputs),
        np.concatenate(steps),
        np.concatenate(rows_of_nodes),
        np.array(segment_row, dtype=np.int64),
        used.time_s,
        np.column_stack([used.position_ned, used.attitude_rad]),
        _weights(used, config.noise),
    )


def _nodes(time_s: FloatArray, step_s: float) -> tuple[FloatArray, IntArray]:
    """Return times of the integration, and the row that each belongs to, or -1 in between."""
    at: list[float] = [float(time_s[0])]
    row = [0]
    for k in range(1, time_s.size):
        begin, end = float(time_s[k - 1]), float(time_s[k])
        parts = max(math.ceil((end - begin) / step_s - 1e-6), 1)
        for part in range(1, parts + 1):
            at.append(begin + (end - begin) * part / parts)
            row.append(k if part == parts else -1)
    return np.array(at), np.array(row, dtype=np.int64)


def _weights(used: Recording, noise: NoiseLevels) -> FloatArray:
    """Return one over the standard deviation of each measurement, 0 where there is none."""
    stated = np.where(np.isfinite(used.position_std_m), used.position_std_m, 0.0)
    horizontal = 1.0 / np.maximum(stated, noise.horizontal_m)
    known = _arrived(used, noise.fix_hold_s)
    known &= np.isfinite(used.position_ned[:, :2]).all(axis=1)
    weight = np.empty((used.time_s.size, 6))
    weight[:, :2] = np.where(known, horizontal, 0.0)[:, None]
    weight[:, 2] = 1.0 / noise.depth_m
    weight[:, 3:5] = 1.0 / noise.tilt_rad
    weight[:, 5] = 1.0 / noise.heading_rad
    return weight


def _arrived(used: Recording, hold_s: float) -> BoolArray:
    """Find the rows that stand for a fix of their own: the first of each time a fix is held for."""
    found = used.has_fix.copy()
    last_s = -math.inf
    for row in np.flatnonzero(used.has_fix).tolist():
        now_s = float(used.time_s[row])
        found[row] = not 0.0 <= now_s - last_s < hold_s - 1e-9
        if found[row]:
            last_s = now_s
    return found
