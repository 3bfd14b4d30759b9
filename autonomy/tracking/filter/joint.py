"""Joint filter of a target's place and velocity and of the delay of its ranges: real fish.

A fish rests, cruises and bolts, and a range may be older than anybody says. What one range and the
robot's way allow is an arc, of a target that turns with the robot it is two places or a whole ring;
no ellipse holds that. So the joint distribution of place, velocity, range delay and *speed class*
is carried by particles, each of which changes its class at random as the models of an interacting
multiple model filter do, and the ranges choose among them.

Readable form of its steps: ``reference.joint``.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter import joint_kernel as k
from autonomy.tracking.filter.cloud_kernel import resample_into
from autonomy.tracking.filter.late_range import LONGEST_AGE_S
from autonomy.tracking.phase import SpeedClass
from autonomy.tracking.reading import Pair, RangeHeard

PARTICLES = 3000
BATCH_S = 0.5
"""Ranges that come more often are taken in together, this often."""
SILENT_STEP_S = 2.0
"""While no range comes, time passes in steps of this."""
REST_SHARE, FAST_SHARE = 0.2, 0.5
"""Speed of a target that rests, against what is expected of it; of one that bolts, against the
robot's cap; standard deviations per axis."""
STEADY_S = (60.0, 200.0, 60.0)
"""Time over which a target that rests, cruises or bolts forgets its velocity."""
DWELL_S = (120.0, 120.0, 60.0)
"""Mean time until it jumps."""
PRIOR = (0.3, 0.5, 0.2)
CIRCLES_SHARE, CIRCLES_RAD_S = 0.5, 0.05
"""Standard deviation of the rate at which a target circles: against the robot's most turn rate, and
at most so much."""
LONGEST_DELAY_S = 3.0
DELAYED_SHARE, PROMPT_S = 0.5, 0.05
"""At first ranges are late by anything up to ``LONGEST_DELAY_S`` with this probability, and else by
next to nothing."""
DELAY_WALK_S = 0.02
"""How a delay strays within a second."""
WALK_M_SQRT_S = 0.02
PERSISTENCE = 1.5
"""The variance of a range counts so many times: it may be told too small, and an error of the
robot's own position lasts over many ranges."""
GUESS_SHARE = 1.5
"""The first guess may be so much worse than it is told."""
OUTLIER_STDS = 3.0
UNEXPLAINED = -0.5 * OUTLIER_STDS * OUTLIER_STDS
"""Log likelihood of a range that no particle expected. It is that of a mixture in which every
hundredth to third range is another animal's, anywhere within the reach of its tag."""
GRID_S = 0.1
NEAR_STDS = 4.0
"""What lies within so many standard deviations of a range is one place."""
MOST_CELLS = 200
"""So many cells along each axis at most in which the densest place is looked for."""
SURE = 0.95
"""Share of the particles in one place from which on that is the estimate; below, their mean is."""
JITTER_STDS, JITTER_SPEED, TURNED = 0.1, 0.03, 0.1
"""What keeps chosen particles apart: standard deviations of a range, of the speed of their class,
and of their bearing."""
LATE_AGAIN = 0.02
"""Share of the particles whose delay is drawn anew, as nothing else would bring back one that early
ranges seemed to refute."""
STRANGERS = 0.01
"""Share of the particles that begin anew at the newest distance, in any direction: where the truth
is that all others have missed, they grow."""
DOUBT_SHARE = 0.15
"""Weight of the newest range in their mean log likelihood."""
CONTRADICTED, REFUTED, ELSEWHERE = 0.5 * UNEXPLAINED, 0.65 * UNEXPLAINED, 0.875 * UNEXPLAINED
"""Mean log likelihood below which ranges contradict what is believed, which every second one must;
below which nothing of it is left; and the same of the very first ranges."""
TOO_FAST = 0.6
"""A target is too fast to follow if it has been faster than the robot's cap with this probability
over the time of a full circle."""
FOLLOWABLE = 0.3
LEAST_CIRCLE_S = 15.0
JUMP_M = 3.0
"""Own positions that jump by more than what the robot can have gone, and so many standard
deviations of a range, were corrected; the target stays where it is beside the robot."""


@dataclass(frozen=True, slots=True)
class Belief:
    """What the joint filter believes at one time."""

    place_ne_m: Pair
    velocity_ne_m_s: Pair
    covariance_m2: tuple[float, float, float]
    """Of the place: north-north, north-east, east-east."""
    share: float
    """Probability that the target is where the particles are densest."""
    is_sure: bool
    """Whether that is the estimate; it is the mean of all particles otherwise."""
    speed_m_s: float
    """Mean speed over all particles."""
    faster_than_cap: float
    """Probability that the target is faster than the robot may be."""
    is_too_fast: bool
    delay_s: float
    speed_class: SpeedClass
    range_m: float
    """Newest range; 0 before the first."""

    @property
    def worst_std_m(self) -> float:
        """Standard deviation of the place along its worst direction."""
        nn, ne, ee = self.covariance_m2
        return math.sqrt(max(0.5 * (nn + ee) + math.hypot(0.5 * (nn - ee), ne), 0.0))


class JointFilter:
    """Where a target may be and how it moves, by all ranges since the beginning.

    Args:
        config: First guess, range noise, how fast target and robot are.
        own_ne_m: Where the robot is at time 0.
        generator: Source of its random numbers.
    """

    def __init__(
        self, config: TrackingConfig, own_ne_m: Pair, generator: np.random.Generator
    ) -> None:
        cap, told = config.motion.speed_max_m_s, config.filter.target_speed_std_m_s
        self._cap_m_s = cap
        is_beacon = config.target.kind == "beacon"
        self._prior = (0.0, 1.0, 0.0) if is_beacon else PRIOR
        self._dwell_s = (math.inf,) * 3 if is_beacon else DWELL_S
        self._class_std_m_s = np.array([REST_SHARE * told, told, FAST_SHARE * cap])
        most_turn = CIRCLES_SHARE * config.motion.turn_rate_max_rad_s
        self._turn_rate_std = 0.0 if is_beacon else min(most_turn, CIRCLES_RAD_S)
        self._range_std_m = math.sqrt(config.ranging.variance_m2)
        self._std_m = math.sqrt(PERSISTENCE) * self._range_std_m
        self._circle_s = max(2.0 * math.pi / config.motion.turn_rate_max_rad_s, LEAST_CIRCLE_S)
        self._generator = generator
        self._particles = np.zeros((PARTICLES, k.SIZE))
        guess = GUESS_SHARE * config.target.guess_std_m * generator.standard_normal((PARTICLES, 2))
        self._particles[:, :2] = guess + np.array([config.target.north_m, config.target.east_m])
        self._begin_motion(self._particles)
        self._spare = np.empty_like(self._particles)
        self._weights = np.full(PARTICLES, 1.0 / PARTICLES)
        self._logs = np.empty(PARTICLES)
        self._way: deque[tuple[float, float, float]] = deque([(0.0, *own_ne_m)])
        self._waiting: list[tuple[float, float]] = []
        self._now_s = self._then_s = self._step_s = 0.0
        self._agreement = 0.0
        self.has_heard = self._is_too_fast = False
        self.restarts_at_s = -math.inf
        """When ranges contradicted everything for the last time."""
        self.rejected = 0
        """Ranges that hardly any particle expected."""
        self._range_m = 0.0
        self._fast_share = 0.0
        self._summarize()

    def step(self, now_s: float, own_ne_m: Pair, pace_m_s: float, own_rate_ne_m_s: Pair) -> None:
        """Let time pass until ``now_s``; ranges that wait are taken in when their batch is due.

        Args:
            now_s: Time since the beginning.
            own_ne_m: Where the robot is.
            pace_m_s: Its greatest speed since the step before.
            own_rate_ne_m_s: How it moves.
        """
        self._keep_way(now_s, own_ne_m, pace_m_s)
        since_s = now_s - self._then_s
        if self._waiting and since_s >= BATCH_S - 1e-9:
            self._drift(since_s)
            self._hear(own_rate_ne_m_s)
        elif self.has_heard and since_s >= SILENT_STEP_S:
            self._drift(since_s)
            self._summarize()

    def note(self, ranges: tuple[RangeHeard, ...]) -> int:
        """Keep ranges that arrived now for the next batch.

        Returns:
            How many; those that are too old, or held before the beginning, are dropped.
        """
        earliest_s = max(self._now_s - LONGEST_AGE_S, 0.0)
        held = [(self._now_s - heard.age_s, float(heard.range_m)) for heard in ranges]
        held = [one for one in held if one[0] >= earliest_s - 1e-6]
        if held:
            self._range_m = held[-1][1]
        self._waiting += held
        return len(held)

    @property
    def is_contradicted(self) -> bool:
        """Whether the newest ranges contradict what was believed before them."""
        return self._agreement < CONTRADICTED

    def belief(self) -> Belief:
        """Return what is believed now."""
        since_s = self._now_s - self._then_s
        mean, C = self._mean.tolist(), self._covariance.tolist()
        north, east = mean[0] + since_s * mean[2], mean[1] + since_s * mean[3]
        nn, ne, ee = (
            C[i][j] + since_s * (C[i][j + 2] + C[i + 2][j] + since_s * C[i + 2][j + 2])
            for i, j in ((0, 0), (0, 1), (1, 1))
        )
        return Belief(
            place_ne_m=(north, east),
            velocity_ne_m_s=(mean[2], mean[3]),
            covariance_m2=(nn, ne, ee),
            share=self._share,
            is_sure=self._share >= SURE,
            speed_m_s=self._speed_m_s,
            faster_than_cap=self._faster,
            is_too_fast=self._is_too_fast,
            delay_s=mean[k.DELAY],
            speed_class=self._speed_class,
            range_m=self._range_m,
        )

    def _keep_way(self, now_s: float, own_ne_m: Pair, pace_m_s: float) -> None:
        before_s, north, east = self._way[-1]
        jump = (own_ne_m[0] - north, own_ne_m[1] - east)
        reach = 3.0 * pace_m_s * (now_s - before_s) + JUMP_M * self._range_std_m
        if math.hypot(*jump) > reach:
            self._way = deque((t, n + jump[0], e + jump[1]) for t, n, e in self._way)
            self._particles[:, :2] += jump
            self._mean[:2] += jump
        self._way.append((now_s, *own_ne_m))
        self._now_s = now_s
        while self._way[1][0] < now_s - LONGEST_AGE_S - 2.0 * LONGEST_DELAY_S:
            self._way.popleft()

    def _drift(self, dt_s: float) -> None:
        self._then_s, self._step_s = self._now_s, dt_s
        draw, std = self._generator, self._class_std_m_s
        kept = np.exp(-dt_s / np.array(STEADY_S))
        fresh = std * np.sqrt(1.0 - kept * kept)
        jumps = -np.expm1(-dt_s / np.array(self._dwell_s))
        root_s = math.sqrt(dt_s)
        k.drift(
            self._particles,
            dt_s,
            WALK_M_SQRT_S * root_s,
            DELAY_WALK_S * root_s,
            self._turn_rate_std,
            np.column_stack([kept, fresh, std, jumps]),
            draw.standard_normal((PARTICLES, 6)),
            draw.random((PARTICLES, 4)),
        )

    def _hear(self, own_rate_ne_m_s: Pair) -> None:
        held = np.array(self._waiting)
        self._waiting = []
        ages = self._now_s - held[:, 0]
        way = self._gridded(float(ages.max()))
        likelihood = k.weigh(
            self._particles,
            self._weights,
            self._logs,
            way,
            GRID_S,
            ages,
            held[:, 1].copy(),
            self._std_m,
            OUTLIER_STDS,
        )
        self._agreement += (1.0 - (1.0 - DOUBT_SHARE) ** len(held)) * (likelihood - self._agreement)
        is_elsewhere = not self.has_heard and likelihood < ELSEWHERE
        self.has_heard = True
        if is_elsewhere or self._agreement < REFUTED:
            self._ring(self._particles, float(held[-1, 1]))
            self.restarts_at_s = self._now_s
            self._weights[:] = 1.0 / PARTICLES
            self._agreement = 0.0
            self._summarize()
            return
        self._summarize()
        self._count_rejected(held[:, 1], ages, way)
        self._judge_speed(self._step_s)
        if float(self._weights @ self._weights) > 2.0 / PARTICLES:
            self._resample(float(held[-1, 1]), own_rate_ne_m_s)

    def _count_rejected(self, ranges_m: FloatArray, ages_s: FloatArray, way: FloatArray) -> None:
        """Count ranges that are far from what the mean expects and from what its spread allows."""
        back_s = ages_s + self._mean[k.DELAY]
        row = np.maximum(len(way) - 1 - np.rint(back_s / GRID_S).astype(np.int64), 0)
        then = self._mean[:2] - back_s[:, None] * self._mean[2:4] - way[row]
        worst_m = math.sqrt(float(np.linalg.eigvalsh(self._covariance[:2, :2])[1]))
        most_m = OUTLIER_STDS * math.hypot(self._std_m, worst_m)
        self.rejected += int((np.abs(ranges_m - np.hypot(*then.T)) > most_m).sum())

    def _gridded(self, oldest_s: float) -> FloatArray:
        """Return where the robot was, every ``GRID_S`` back to any time that is asked for."""
        steps = math.ceil((oldest_s + 2.0 * LONGEST_DELAY_S) / GRID_S)
        times = self._now_s - GRID_S * np.arange(steps, -1.0, -1.0)
        way = np.array(self._way)
        return np.column_stack([np.interp(times, way[:, 0], way[:, axis]) for axis in (1, 2)])

    def _resample(self, range_m: float, own_rate_ne_m_s: Pair) -> None:
        """Choose particles by their weights, keep them apart, and let some begin anew."""
        draw = self._generator
        resample_into(self._spare, self._particles, self._weights, float(draw.random()))
        self._particles, self._spare = self._spare, self._particles
        self._weights[:] = 1.0 / PARTICLES
        particles = self._particles
        normal = draw.standard_normal((PARTICLES, 4))
        std = self._class_std_m_s[particles[:, k.CLASS].astype(np.int64)]
        particles[:, :2] += JITTER_STDS * self._range_std_m * normal[:, :2]
        particles[:, 2:4] += JITTER_SPEED * std[:, None] * normal[:, 2:]
        _, north, east = self._way[-1]
        bearing = np.arctan2(particles[:, k.EAST] - east, particles[:, k.NORTH] - north)
        length = max(float(np.abs(np.exp(1j * bearing).mean())), 0.14)
        angles = TURNED * math.sqrt(max(-2.0 * math.log(length), 0.0))
        turned = angles * draw.standard_normal(PARTICLES)
        k.turn(particles, north, east, *own_rate_ne_m_s, turned)
        strangers = draw.choice(PARTICLES, int(STRANGERS * PARTICLES), replace=False)
        anew = particles[strangers]
        self._ring(anew, range_m)
        particles[strangers] = anew
        is_late = draw.random(PARTICLES) < LATE_AGAIN
        late = draw.uniform(0.0, LONGEST_DELAY_S, PARTICLES)
        particles[:, k.DELAY] = np.where(is_late, late, particles[:, k.DELAY])

    def _ring(self, particles: FloatArray, range_m: float) -> None:
        """Put particles at a distance, in any direction, with any motion."""
        count, draw = len(particles), self._generator
        angles = draw.uniform(-math.pi, math.pi, count)
        distances = range_m + self._std_m * draw.standard_normal(count)
        _, north, east = self._way[-1]
        particles[:, k.NORTH] = north + distances * np.cos(angles)
        particles[:, k.EAST] = east + distances * np.sin(angles)
        self._begin_motion(particles)

    def _begin_motion(self, particles: FloatArray) -> None:
        count, draw = len(particles), self._generator
        kind = draw.choice(3, count, p=self._prior)
        particles[:, k.CLASS] = kind
        std = self._class_std_m_s[kind]
        particles[:, 2:4] = std[:, None] * draw.standard_normal((count, 2))
        circles = self._turn_rate_std * draw.standard_normal(count)
        particles[:, k.TURN_RATE] = np.where(draw.random(count) < k.STRAIGHT, 0.0, circles)
        prompt = np.abs(PROMPT_S * draw.standard_normal(count))
        is_late = draw.random(count) < DELAYED_SHARE
        late = draw.uniform(0.0, LONGEST_DELAY_S, count)
        particles[:, k.DELAY] = np.where(is_late, late, prompt)

    def _summarize(self) -> None:
        """Work out moments: of the densest place where that has nearly all, of everything else."""
        weights, particles = self._weights, self._particles
        mean, covariance = _moments(particles, weights)
        near_m = NEAR_STDS * self._range_std_m
        self._share = 1.0
        if np.linalg.eigvalsh(covariance[:2, :2])[1] > (0.5 * near_m) ** 2:
            inside = self._densest(near_m)
            self._share = float(weights[inside].sum())
            if self._share >= SURE:
                mean, covariance = _moments(particles[inside], weights[inside] / self._share)
        self._mean, self._covariance = mean, covariance
        speeds = np.hypot(particles[:, k.NORTH_RATE], particles[:, k.EAST_RATE])
        self._speed_m_s = float(weights @ speeds)
        self._faster = float(weights[speeds > self._cap_m_s].sum())
        shares = np.bincount(particles[:, k.CLASS].astype(np.int64), weights, 3)
        self._speed_class = SpeedClass(int(shares.argmax()))

    def _densest(self, near_m: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Tell which particles are in the place where most of the weight is."""
        places, weights = self._particles[:, :2], self._weights
        least = places.min(axis=0)
        cell_m = max(0.5 * near_m, float((places.max(axis=0) - least).max()) / MOST_CELLS)
        cells = ((places - least) / cell_m).astype(np.int64)
        cell = cells[:, 0] * (MOST_CELLS + 1) + cells[:, 1]
        is_in = cell == np.bincount(cell, weights).argmax()
        north, east = (float(one) for one in places[is_in].mean(axis=0))
        for _ in range(5):
            north, east, total = k.middle(self._particles, weights, north, east, near_m)
            if total <= 0.0:
                return is_in
        return np.hypot(places[:, 0] - north, places[:, 1] - east) < near_m

    def _judge_speed(self, dt_s: float) -> None:
        kept = math.exp(-dt_s / self._circle_s)
        self._fast_share = kept * self._fast_share + (1.0 - kept) * self._faster
        limit = FOLLOWABLE if self._is_too_fast else TOO_FAST
        self._is_too_fast = self._fast_share > limit


def _moments(particles: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of all columns, and the covariance of place and velocity."""
    mean = weights @ particles
    off = particles[:, :4] - mean[:4]
    covariance = off.T @ (weights[:, None] * off)
    return mean, covariance + np.diag([WALK_M_SQRT_S**2, WALK_M_SQRT_S**2, 0.0, 0.0])
