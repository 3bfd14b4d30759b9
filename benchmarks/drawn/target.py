"""Fish drawn at run time: targets at a share of the robot's cap, told wrongly in many ways.

All settings are the product's (``TrackingConfig()``, and in the lake its preset); what is drawn:

- how it swims: straight on; a heading that wanders by 40 deg over 60-300 s; bouts of 60 s with
  rests of 40 s on the ground (exponential) and a new heading after each; legs of 20-60 s that turn
  by 40-120 deg;
- start 2-6 m away (lake 10-40 m) in any direction, the robot at 10-50 % of its cap in any heading;
- a steady current of 0-15 % of the cap that nobody tells, which carries robot and swimming fish;
- the first guess 0.5-2 times as far off as it is told, ranges with 0.5-2 times the variance, up to
  20 % of them lost and 5 % too long by up to ten standard deviations;
- compass 3 deg and log 5 % off (standard deviations), the own position reckoned with them;
- ranges that are up to 3 s late: never, as told, or untold.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TRACKING_PRESETS, TrackingConfig
from autonomy.tracking.phase import TargetPhase
from autonomy.tracking.tracker import RangeHeard, Tracker, TrackerReading, TrackerStart
from reproduction.tracking import unicycle

Delay = Literal["none", "told", "untold", "mixed"]
"""``mixed``: none for half of the draws, told and untold for a quarter each."""
HELD_95 = 5.991
"""Squared distance over covariance within which an ellipse of 95 % holds."""


@dataclass(frozen=True, slots=True)
class Water:
    """Where fish are drawn."""

    config: TrackingConfig
    start_m: tuple[float, float]
    lost_m: float
    """A target that ends farther away than this was lost."""
    duration_s: float
    step_s: float


OPEN_WATER = Water(TrackingConfig(), (2.0, 6.0), 10.0, 300.0, 0.2)
LAKE = Water(TRACKING_PRESETS["grace3"], (10.0, 40.0), 30.0, 1200.0, 0.5)


@dataclass(frozen=True, slots=True)
class Fish:
    """One draw, to be followed."""

    water: Water
    seed: tuple[int, ...]
    ratio: float
    """Speed while it swims, against the robot's cap."""
    delay: Delay = "mixed"
    other_share: float = 0.0
    """Share of the ranges that are another animal's, which swims 5-20 m off."""


@dataclass(frozen=True, slots=True)
class Pursuit:
    """What became of one."""

    is_lost: bool
    """At the end lost by its own account, too far away, or estimated farther off than it is: of a
    mirror image the error is twice the distance."""
    held: int
    """Steps at which the ellipse held the target while it was said to be held."""
    shown: int
    """Steps at which it was said to be held."""
    called_s: float
    """When it was called too fast to follow; infinity for never."""
    worst_m: float
    """Greatest error that lasted for 10 s outside of the ellipse."""


def followed(fish: Fish) -> Pursuit:
    """Draw a fish and follow it."""
    rng, water = np.random.default_rng(fish.seed), fish.water
    track = _track(fish, rng)
    step_s, steps = water.step_s, len(track)
    config, start = _told(fish, rng)
    ranges, told_s, delay_steps = _ranges(fish, rng, config, steps)
    other = np.array([rng.uniform(5.0, 20.0), 0.0]) @ _rotation(rng.uniform(-math.pi, math.pi))
    bias, factor = rng.normal(0.0, math.radians(3.0)), 1.0 + rng.normal(0.0, 0.05)
    noise = rng.standard_normal((steps, 2)) * np.sqrt(
        [config.filter.heading_variance_rad2, config.filter.speed_variance_m2_s2]
    )
    pose, own = start, np.array(start[:2])
    tracker = Tracker(config, TrackerStart((own[0], own[1]), pose[2], pose[3]))
    away: list[FloatArray] = []
    rows = np.full((steps, 5), np.nan)
    for n in range(steps):
        away.append(np.array(pose[:2]) - track[n])
        heard: tuple[RangeHeard, ...] = ()
        if n >= delay_steps and ranges[n, 0]:
            then = away[n - delay_steps] - (other if ranges[n, 2] else 0.0)
            heard = (RangeHeard(abs(float(np.hypot(*then)) + ranges[n, 1]), told_s),)
        measured = (pose[2] + bias + noise[n, 0], pose[3] * factor + noise[n, 1])
        step = tracker.step(
            TrackerReading((float(own[0]), float(own[1])), *measured, heard), step_s if n else 0.0
        )
        rows[n, 0], rows[n, 1] = np.hypot(*away[n]), step.phase
        rows[n, 4] = step.is_too_fast or "faster than the robot" in step.reason
        if step.hypotheses:
            best = step.hypotheses[0]
            nn, ne, ee = best.covariance_m2
            off = own - best.position_ne_m - away[n]
            rows[n, 2] = np.hypot(*off)
            rows[n, 3] = off @ np.linalg.solve([[nn, ne], [ne, ee]], off)
        if step.phase is TargetPhase.ENDED:
            rows[n:] = rows[n]
            break
        before, pose = pose, unicycle.advance(pose, *step.command, step_s)
        own = own + factor * (np.subtract(pose[:2], before[:2]) @ _rotation(bias))
    return _judged(water, rows)


def _judged(water: Water, rows: FloatArray) -> Pursuit:
    end = rows[-len(rows) // 10 :]
    distance, error = float(end[:, 0].mean()), float(np.nan_to_num(end[:, 2], nan=1e9).mean())
    is_unheld = float((end[:, 1] >= TargetPhase.LOST).mean()) > 0.5
    is_misplaced = error > max(distance, 3.0 * math.sqrt(water.config.ranging.variance_m2))
    shown = rows[:, 1] == TargetPhase.TRACKING
    called = np.flatnonzero(rows[:, 4] > 0.0)
    span = round(10.0 / water.step_s)
    errors = np.where(rows[:, 3] < HELD_95, 0.0, np.nan_to_num(rows[:, 2]))
    lasting = np.lib.stride_tricks.sliding_window_view(errors, span).min(axis=1)
    return Pursuit(
        is_lost=is_unheld or is_misplaced or distance > water.lost_m,
        held=int((rows[shown, 3] < HELD_95).sum()),
        shown=int(shown.sum()),
        called_s=float(called[0]) * water.step_s if len(called) else math.inf,
        worst_m=float(lasting.max()),
    )


def _track(fish: Fish, rng: np.random.Generator) -> FloatArray:
    """Return where the fish is at each step, in the frame of the moving water, m."""
    water = fish.water
    cap, dt_s = water.config.motion.speed_max_m_s, water.step_s
    steps = round(water.duration_s / dt_s)
    speed = np.full(steps, fish.ratio * cap)
    heading = np.full(steps, rng.uniform(-math.pi, math.pi))
    times = dt_s * np.arange(steps)
    kind = rng.choice(["straight", "wanders", "bouts", "legs"])
    if kind == "wanders":
        root_s = 0.7 * math.sqrt(2.0 * dt_s / rng.uniform(60.0, 300.0))
        heading += np.cumsum(root_s * rng.standard_normal(steps))
    elif kind == "legs":
        swing = math.radians(rng.uniform(20.0, 60.0))
        heading += swing * (1 - 2 * ((times / rng.uniform(20.0, 60.0)).astype(int) % 2))
    elif kind == "bouts":
        begin_s, swims = 0.0, True
        while begin_s < water.duration_s:
            end_s = begin_s + rng.exponential(60.0 if swims else 40.0)
            if swims:
                heading[times >= begin_s] += rng.normal(0.0, 1.0)
            else:
                speed[(times >= begin_s) & (times < end_s)] = 0.0
            begin_s, swims = end_s, not swims
    velocity = speed[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    carried = rng.uniform(0.0, 0.15) * cap * np.array([1.0, 0.0])
    carried = carried @ _rotation(rng.uniform(-math.pi, math.pi))
    if kind == "bouts":  # what rests on the ground is left behind by the water
        velocity[speed == 0.0] = -carried
    return np.vstack([np.zeros(2), dt_s * np.cumsum(velocity, axis=0)[:-1]])


def _told(
    fish: Fish, rng: np.random.Generator
) -> tuple[TrackingConfig, tuple[float, float, float, float]]:
    """Return the settings with a first guess, and where the robot starts."""
    config = fish.water.config
    distance, angle = rng.uniform(*fish.water.start_m), rng.uniform(-math.pi, math.pi)
    speed = rng.uniform(0.1, 0.5) * config.motion.speed_max_m_s
    start = (
        distance * math.cos(angle),
        distance * math.sin(angle),
        rng.uniform(-math.pi, math.pi),
        speed,
    )
    guess = config.target.guess_std_m * rng.uniform(0.5, 2.0) * rng.standard_normal(2)
    told = {"kind": "tag", "north_m": float(guess[0]), "east_m": float(guess[1])}
    target = config.target.model_copy(update=told)
    return config.model_copy(update={"target": target}), start


def _ranges(
    fish: Fish, rng: np.random.Generator, config: TrackingConfig, steps: int
) -> tuple[FloatArray, float, int]:
    """Return whether each range comes, its error, and whether it is another animal's.

    Beside them the age that is told, s, and the delay, steps.
    """
    kind = fish.delay
    if kind == "mixed":
        kind = rng.choice(["none", "none", "told", "untold"])
    delay_s = 0.0 if kind == "none" else rng.uniform(0.0, 3.0)
    std = math.sqrt(config.ranging.variance_m2 * rng.uniform(0.5, 2.0))
    every = max(1, round(config.ranging.period_s / fish.water.step_s))
    comes = (np.arange(steps) % every == 0) & (rng.random(steps) > rng.uniform(0.0, 0.2))
    is_wrong = rng.random(steps) < rng.uniform(0.0, 0.05)
    error = std * rng.standard_normal(steps)
    error += np.where(is_wrong, rng.uniform(0.0, 10.0 * std, steps), 0.0)
    is_other = rng.random(steps) < fish.other_share
    told_s = delay_s if kind == "told" else 0.0
    return np.column_stack([comes, error, is_other]), told_s, round(delay_s / fish.water.step_s)


def _rotation(angle: float) -> FloatArray:
    """Return what turns a row vector by an angle."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])
