"""Worlds in which a robot of a lake is not heard for an hour, with hidden currents drawn.

The worlds know nothing of the prediction: they step a current, eddies, a robot that reckons its
position with what it believes of the current and learns more with each fix, and its plan.

Drawn: the current that stays, normal with 5 cm/s per axis and a memory of ten hours; eddies that
add up to a walk of 0.3 m/s^0.5; what the robot learned of it in 1 to 8 dives before; in one world
of twelve that is told of another water and wrong; a pace 5 % off, stays at the surface of 35 to 85
s, a flight 1.5 m beside its track.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from autonomy.estimation.prediction import (
    FlownTrack,
    LastWord,
    Prediction,
    WaterBelief,
    predict_afloat,
    predict_flown,
)

UNKNOWN_M_S, MEMORY_S, WALK_M_SQRT_S, FIX_STD_M = 0.05, 36000.0, 0.3, 1.5
PACE_STD, FOLLOWING_STD_M = 0.05, 1.5
STAY_S = (35.0, 85.0)
WRONG_SHARE = 1.0 / 12.0
LOST_S = 3600.0
STEP_S = 5.0


@dataclass(frozen=True)
class Lost:
    """A word, what was believed, and where the robot was seen next."""

    word: LastWord
    water: WaterBelief
    track: FlownTrack | None
    age_s: float
    """How long after the word it was seen."""
    fix_ne_m: np.ndarray
    is_wrong: bool

    def predicted(self) -> Prediction:
        age = np.array([self.age_s])
        if self.track is None:
            return predict_afloat(self.word, self.water, age)
        return predict_flown(self.word, self.track, self.water, age)


class _Water:
    """The current as it is."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.current = UNKNOWN_M_S * rng.standard_normal(2)

    def carry(self, dt_s: float) -> np.ndarray:
        kept = math.exp(-dt_s / MEMORY_S)
        fresh = UNKNOWN_M_S * math.sqrt(1.0 - kept**2) * self.rng.standard_normal(2)
        self.current = kept * self.current + fresh
        eddies = WALK_M_SQRT_S * math.sqrt(dt_s) * self.rng.standard_normal(2)
        return self.current * dt_s + eddies


@dataclass
class _Belief:
    """What the robot believes of the current: a Kalman filter fed with the drift of its dives."""

    mean: np.ndarray
    variance: float

    def age(self, dt_s: float) -> None:
        kept = math.exp(-dt_s / MEMORY_S)
        self.mean = kept * self.mean
        self.variance = kept**2 * self.variance + (1.0 - kept**2) * UNKNOWN_M_S**2

    def learn(self, off_ne_m: np.ndarray, dive_s: float) -> None:
        """Learn from how far a dive came up from where it was reckoned to."""
        noise = (WALK_M_SQRT_S**2 * dive_s + 2.0 * FIX_STD_M**2) / dive_s**2
        gain = self.variance / (self.variance + noise)
        self.mean = self.mean + gain * off_ne_m / dive_s
        self.variance *= 1.0 - gain


def lost_hour(rng: np.random.Generator) -> Lost:
    """Draw an hour: one robot in two lies afloat, the other flies its dives."""
    water = _Water(rng)
    belief = _Belief(np.zeros(2), UNKNOWN_M_S**2)
    for _ in range(rng.integers(1, 9)):
        dive_s = rng.uniform(300.0, 700.0)
        moved = np.sum([water.carry(STEP_S) for _ in range(int(dive_s / STEP_S))], axis=0)
        noise = FIX_STD_M * (rng.standard_normal(2) - rng.standard_normal(2))
        belief.learn(moved - belief.mean * dive_s + noise, dive_s)
        belief.age(dive_s)
    is_wrong = bool(rng.random() < WRONG_SHARE)
    if is_wrong:
        belief.mean = UNKNOWN_M_S * rng.standard_normal(2)
    flies = rng.random() < 0.5
    found = _flown(rng, water, belief) if flies else _afloat(rng, water, belief)
    return replace(found, is_wrong=is_wrong)


def _believed(belief: _Belief) -> WaterBelief:
    north, east = belief.mean.tolist()
    std = math.sqrt(belief.variance)
    return WaterBelief((north, east), std, UNKNOWN_M_S, MEMORY_S, WALK_M_SQRT_S)


def _afloat(rng: np.random.Generator, water: _Water, belief: _Belief) -> Lost:
    place = rng.uniform(-200.0, 200.0, 2)
    fix = place + FIX_STD_M * rng.standard_normal(2)
    word = LastWord((float(fix[0]), float(fix[1]), 0.0), FIX_STD_M, 0.0, FIX_STD_M)
    believed, age_s = _believed(belief), LOST_S + rng.uniform(0.0, 600.0)
    for _ in range(int(age_s / STEP_S)):
        place = place + water.carry(STEP_S)
    seen = place + FIX_STD_M * rng.standard_normal(2)
    return Lost(word, believed, None, int(age_s / STEP_S) * STEP_S, seen, is_wrong=False)


def _plan(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return times and places of a plan, its legs' ends, and its surfacings: vees, 30 m deep."""
    place, heading = np.array([0.0, 0.0, 0.0]), rng.uniform(-math.pi, math.pi)
    times, places, leg_ends, surfacings = [0.0], [place], [], []
    now = float(np.mean(STAY_S))
    while now < LOST_S + 3000.0:
        heading += rng.uniform(-1.2, 1.2)
        leg_s = rng.uniform(200.0, 350.0)
        along = 0.15 * leg_s * np.array([math.cos(heading), math.sin(heading), 0.0])
        times.append(now)
        places.append(place)
        for depth_m in (30.0, 0.0):
            place = np.array([*(place + along)[:2], depth_m])
            now += leg_s
            times.append(now)
            places.append(place)
            leg_ends.append(now)
        surfacings.append(now)
        now += float(np.mean(STAY_S))
    return np.array(times), np.array(places), np.array(leg_ends), np.array(surfacings)


def _flown(rng: np.random.Generator, water: _Water, belief: _Belief) -> Lost:
    """Fly a plan dive by dive; the word is that of some moment of the first dive."""
    times, places, leg_ends, surfacings = _plan(rng)
    track_now, fix = 0.0, np.zeros(2)
    start_s = float(np.mean(STAY_S))
    spoken_s = start_s + rng.uniform(0.0, float(leg_ends[0]) - start_s)
    word: LastWord | None = None
    believed = _believed(belief)
    clock, said_s = 0.0, 0.0
    reckoned = truth = np.zeros(2)
    walked = np.zeros(2)
    pace = 1.0 + PACE_STD * rng.standard_normal()  # drag or ballast are off in every dive
    for dive, surfaced_s in enumerate(surfacings.tolist()):
        dive_start_s = start_s if dive == 0 else surfacings[dive - 1] + float(np.mean(STAY_S))
        beside = reckoned - _at(times, places, dive_start_s)
        along, believed_now = dive_start_s, belief.mean.copy()
        walked = np.zeros(2)
        ends = leg_ends[leg_ends > dive_start_s]
        while along < surfaced_s:
            if word is None and along >= spoken_s:
                std = math.sqrt(
                    FIX_STD_M**2
                    + WALK_M_SQRT_S**2 * (along - dive_start_s)
                    + belief.variance * (along - dive_start_s) ** 2
                )
                depth = float(np.interp(along, times, places[:, 2]))
                said = (float(reckoned[0]), float(reckoned[1]), depth)
                word, said_s = LastWord(said, std, along - dive_start_s, FIX_STD_M), clock
                track_now = along
            step = water.carry(STEP_S) - believed_now * STEP_S
            walked = walked + step
            along = min(along + STEP_S * pace, surfaced_s)
            clock += STEP_S
            share = max(0.0, 1.0 - (along - dive_start_s) / (ends[0] - dive_start_s))
            wobble = FOLLOWING_STD_M * (1.0 - share) * _wobble(rng)
            reckoned = _at(times, places, along) + share * beside + wobble
        dive_s = surfaced_s - dive_start_s
        truth = reckoned + walked
        fix = truth + FIX_STD_M * rng.standard_normal(2)
        belief.learn(fix - reckoned, dive_s)
        belief.age(dive_s)
        if word is not None and clock - said_s >= LOST_S:
            break
        stay_s = rng.uniform(*STAY_S)
        for _ in range(int(stay_s / STEP_S)):
            truth = truth + water.carry(STEP_S)
        clock += stay_s
        reckoned = truth + FIX_STD_M * rng.standard_normal(2)
    assert word is not None
    stays = np.column_stack([surfacings, surfacings + float(np.mean(STAY_S))])
    half = (STAY_S[1] - STAY_S[0]) / 2.0
    track = FlownTrack(
        times, places, leg_ends, stays, track_now, FOLLOWING_STD_M, PACE_STD,
        half / math.sqrt(3.0),
    )  # fmt: skip
    return Lost(word, believed, track, clock - said_s, fix, is_wrong=False)


def _at(times: np.ndarray, places: np.ndarray, at_s: float) -> np.ndarray:
    return np.array([np.interp(at_s, times, places[:, axis]) for axis in range(2)])


def _wobble(rng: np.random.Generator) -> np.ndarray:
    return rng.standard_normal(2)
