"""The map of a current against what gliders do today, on flows drawn at run time.

In a closed loop each dive is aimed off by what the map predicts, and predicted by every method from
what was known before it; the first eight dives of a water are not scored. Errors are those of the
surfacing. Intervals are of 2000 resamplings of the drawn waters.
"""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.config import CURRENT_PRESETS, CurrentMapConfig
from autonomy.current.learning import learn
from autonomy.current.model import CurrentMap, Observation, tabulate
from autonomy.current.reference.flow import displacement_along
from autonomy.current.table import table_of
from autonomy.site import Box
from benchmarks.field.field import at_most, row
from simulator.flow import Flow, Gyre, Shear, Sum, Tide, Uniform

T = TypeVar("T")
AREA = "currents"
DRAWS = int(os.environ.get("CURRENT_DRAWS", "3"))
"""Waters drawn of each kind; a bench takes few, a judgement of a bar takes many."""
UNSCORED = 8
ROUND = 7
STEPS = 60
"""Integration steps of a dive."""
METHODS = ("zero", "last", "mean", "map")
FIRST_OF_SECOND = 10
"""Dives of a second robot that are scored."""
KNOWN_OF_FIRST = 40
_RESAMPLINGS = 2000


@dataclass(frozen=True)
class Water:
    """A water, and the robot that dives in it."""

    box: Box
    config: CurrentMapConfig
    speed_m_s: float
    dive_s: tuple[float, float]
    drift_m_sqrt_s: float
    fix_std_m: float
    dives: int
    stay_s: float


LAKE = Water(
    Box(x_min_m=0.0, x_max_m=420.0, y_min_m=0.0, y_max_m=420.0, depth_max_m=16.0),
    CURRENT_PRESETS["lake"],
    speed_m_s=0.09,
    dive_s=(300.0, 540.0),
    drift_m_sqrt_s=0.3,
    fix_std_m=1.5,
    dives=49,
    stay_s=120.0,
)
COAST = Water(
    Box(x_min_m=0.0, x_max_m=20_000.0, y_min_m=0.0, y_max_m=20_000.0, depth_max_m=200.0),
    CURRENT_PRESETS["sea"],
    speed_m_s=0.35,
    dive_s=(2160.0, 3600.0),
    drift_m_sqrt_s=1.0,
    fix_std_m=5.0,
    dives=56,
    stay_s=600.0,
)


def a_third_to_two(water: Water, rng: np.random.Generator) -> float:
    return water.speed_m_s * float(rng.uniform(1.0, 2.0)) / 3.0


def uniform(water: Water, rng: np.random.Generator) -> Flow:
    speed, towards = a_third_to_two(water, rng), rng.uniform(0.0, 2.0 * np.pi)
    return Uniform(speed * float(np.cos(towards)), speed * float(np.sin(towards)))


def shear(water: Water, rng: np.random.Generator) -> Flow:
    """Wind over return flow: as fast at the surface as a third to two thirds of the robot."""
    speed, towards = a_third_to_two(water, rng), rng.uniform(0.0, 2.0 * np.pi)
    north, east = speed * float(np.cos(towards)), speed * float(np.sin(towards))
    mean = Uniform(0.3 * north, 0.3 * east)
    return Sum((Shear(north, east, 1.25 * water.box.depth_max_m), mean))


def gyre(water: Water, rng: np.random.Generator) -> Flow:
    """A double gyre that lies along either axis, larger than the domain by up to a fifth."""
    box, room = water.box, rng.uniform(0.0, 0.1, 4)
    wide = box.x_max_m
    bounds = Box(
        x_min_m=-wide * room[0],
        x_max_m=wide * (1.0 + room[1]),
        y_min_m=-wide * room[2],
        y_max_m=wide * (1.0 + room[3]),
        depth_max_m=box.depth_max_m,
    )
    cells = (1, 2) if rng.random() < 0.5 else (2, 1)
    return Gyre(a_third_to_two(water, rng) * float(rng.choice((-1, 1))), bounds, *cells)


def tidal(water: Water, rng: np.random.Generator) -> Flow:
    major = a_third_to_two(water, rng)
    towards, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    ellipse = float(rng.uniform(-0.5, 0.5))
    tide = Tide(major, ellipse * major, float(towards), 3600.0 * 12.4206, float(phase))
    return Sum((gyre(water, rng), tide))


def everything(water: Water, rng: np.random.Generator) -> Flow:
    return Sum((tidal(water, rng), shear(water, rng)))


FLOWS: dict[str, tuple[Water, Callable[[Water, np.random.Generator], Flow], bool]] = {
    "lake uniform": (LAKE, uniform, False),
    "lake shear": (LAKE, shear, True),
    "lake gyre": (LAKE, gyre, False),
    "coast gyre": (COAST, gyre, False),
    "coast M2": (COAST, tidal, False),
    "coast all": (COAST, everything, True),
}
"""Water, how its flow is drawn, and whether the drift at the surface is observed."""


@dataclass
class Score:
    """What the dives of one water came to."""

    next_m2: dict[str, list[float]] = field(default_factory=lambda: {m: [] for m in METHODS})
    """Squared error of the next surfacing."""
    round_m2: dict[str, list[float]] = field(default_factory=lambda: {m: [] for m in METHODS})
    """Squared error of the surfacings of a round, from what was known before it."""
    nees: list[float] = field(default_factory=list)
    inside: list[float] = field(default_factory=list)
    """Whether the 90 % ellipse held the surfacing."""
    flow_m2_s2: list[float] = field(default_factory=list)
    """Squared error of the flow along the tracks."""


class Robot:
    """A robot that dives in a flow, and what it tells of it."""

    def __init__(self, water: Water, flow: Flow, rng: np.random.Generator, name: str) -> None:
        self.water, self.flow, self.rng, self.name = water, flow, rng, name
        box = water.box
        self.place = rng.uniform(0.1, 0.9, 2) * (box.x_max_m, box.y_max_m)
        self._far = self.place
        self.time_s = float(rng.uniform(0.0, 1e5))

    def dive(self, known: CurrentMap) -> tuple[Observation, FloatArray]:
        """Fly a dive that the map aims off; return it, and where it truly ended."""
        water, rng = self.water, self.rng
        duration = float(rng.uniform(*water.dive_s))
        fixed = self.place + rng.normal(0.0, water.fix_std_m, 2)
        share = np.linspace(0.0, 1.0, STEPS + 1)
        believed = np.empty((STEPS + 1, 3))
        depth = rng.uniform(0.6, 1.0) * water.box.depth_max_m
        believed[:, 2] = depth * (1.0 - np.abs(2.0 * share - 1.0))
        times = self.time_s + duration * share
        goal = self._goal(fixed, duration)
        carried = np.zeros(2)
        for _ in range(2):
            way = goal - fixed - carried
            way *= water.speed_m_s * duration / max(float(np.linalg.norm(way)), 1e-9)
            believed[:, :2] = fixed + share[:, None] * way
            carried = known.displacement(times, believed).mean_ne_m
        through = np.diff(believed[:, :2], axis=0)
        dt = duration / STEPS
        for i in range(STEPS):
            depth_m = 0.5 * (believed[i, 2] + believed[i + 1, 2])
            u = self._flow_here(depth_m, times[i] + 0.5 * dt)
            walk = water.drift_m_sqrt_s * np.sqrt(dt) * rng.standard_normal(2)
            self.place = self.place + through[i] + u * dt + walk
        self.time_s = float(times[-1])
        drift = self.place + rng.normal(0.0, water.fix_std_m, 2) - believed[-1, :2]
        walked = np.hypot(water.fix_std_m, water.drift_m_sqrt_s * np.sqrt(duration))
        rows = np.linspace(0, STEPS, 31).round().astype(int)
        told = (float(drift[0]), float(drift[1]))
        seen = Observation(
            self.name, times[rows], believed[rows], told, float(walked), water.fix_std_m
        )
        return seen, self.place.copy()

    def _flow_here(self, depth_m: float, time_s: float) -> FloatArray:
        return self.flow.velocity_ne_m_s(np.array([[*self.place, depth_m, time_s]]))[0]

    def stay(self) -> Observation:
        """Drift at the surface; return what its two fixes tell."""
        water = self.water
        first = self.place + self.rng.normal(0.0, water.fix_std_m, 2)
        dt = water.stay_s / 4
        for i in range(4):
            at_s = self.time_s + (i + 0.5) * dt
            self.place = self.place + dt * self._flow_here(0.0, at_s)
        times = self.time_s + np.array([0.0, water.stay_s])
        self.time_s = float(times[1])
        last = self.place + self.rng.normal(0.0, water.fix_std_m, 2)
        track = np.tile([*first, 0.0], (2, 1))
        told = (float((last - first)[0]), float((last - first)[1]))
        return Observation(self.name, times, track, told, 0.0, water.fix_std_m, is_surface=True)

    def _goal(self, fixed: FloatArray, duration: float) -> FloatArray:
        """Return a place within reach on the way to a far one, which is another once reached."""
        box, reach = self.water.box, self.water.speed_m_s * duration
        while True:
            way = self._far - fixed
            distance = float(np.linalg.norm(way))
            if distance > reach:
                return fixed + reach / distance * way
            self._far = self.rng.uniform(0.05, 0.95, 2) * (box.x_max_m, box.y_max_m)


class Learner:
    """A map that learns as the station does."""

    def __init__(self, config: CurrentMapConfig) -> None:
        self.known = CurrentMap(config)
        self._since = 0
        self._first = config.learn_first

    def take(self, seen: Observation) -> None:
        self.known.append(seen)
        self._since += 1
        if self._since >= self._first:
            config = self.known.config
            self.known.relearned(learn(config, self.known.observations))
            self._since, self._first = 0, config.learn_every


def predictions(known: CurrentMap, dives: list[Observation], seen: Observation) -> dict:
    """Return what each method says of a dive's displacement, m."""
    rates = np.array([one.current_ne_m_s for one in dives]).reshape(-1, 2)
    none = np.zeros(2)
    return {
        "zero": none,
        "last": rates[-1] * seen.duration_s if len(rates) else none,
        "mean": rates.mean(axis=0) * seen.duration_s if len(rates) else none,
        "map": known.displacement(seen.time_s, seen.position_ned).mean_ne_m,
    }


def fly(kind: str, rng: np.random.Generator) -> Score:
    """Fly all dives of a water of a kind."""
    water, draw, sees_surface = FLOWS[kind]
    flow = draw(water, rng)
    robot, learner, score = Robot(water, flow, rng, "one"), Learner(water.config), Score()
    dives: list[Observation] = []
    pending: list[tuple[Observation, FloatArray]] = []
    before, dives_before = learner.known.copy(), 0
    for number in range(water.dives):
        if number % ROUND == 0:
            before, dives_before, pending = learner.known.copy(), number, []
        known = learner.known
        seen, end = robot.dive(known)
        actual = end - seen.position_ned[-1, :2]
        if number >= UNSCORED:
            for method, said in predictions(known, dives, seen).items():
                score.next_m2[method].append(float(np.sum((actual - said) ** 2)))
            _calibrate(score, known, water, seen, actual)
        pending.append((seen, actual))
        if len(pending) == ROUND and dives_before >= UNSCORED:
            for one, carried in pending:
                for method, said in predictions(before, dives[:dives_before], one).items():
                    score.round_m2[method].append(float(np.sum((carried - said) ** 2)))
        learner.take(seen)
        dives.append(seen)
        if number >= UNSCORED:
            _flow_error(score, learner.known, flow, seen)
        stay = robot.stay()
        if sees_surface:
            learner.take(stay)
    return score


def _calibrate(
    score: Score, known: CurrentMap, water: Water, seen: Observation, actual: FloatArray
) -> None:
    """Note how the error of a surfacing compares with what was said of it."""
    noise = known.walk_variance_m2(water.drift_m_sqrt_s, seen.duration_s) + water.fix_std_m**2
    said = known.displacement(seen.time_s, seen.position_ned, noise)
    error = actual - said.mean_ne_m
    squared = float(error @ np.linalg.solve(said.cov_m2, error))
    score.nees.append(squared)
    score.inside.append(float(squared <= 4.605))


def _flow_error(score: Score, known: CurrentMap, flow: Flow, seen: Observation) -> None:
    points = seen.functional().points[0]
    truth = flow.velocity_ne_m_s(points)
    error = known.mean_flow(points) - truth
    score.flow_m2_s2 += np.sum(error**2, axis=1).tolist()


def measure() -> list[dict[str, object]]:
    """Fly every kind of water; one line for each bar."""
    seeds = np.random.SeedSequence()
    print(f"currents: {DRAWS} waters of each kind, seed {seeds.entropy}", flush=True)
    children = iter(seeds.spawn(len(FLOWS) * DRAWS + DRAWS))
    scores = {
        kind: [fly(kind, np.random.default_rng(next(children))) for _ in range(DRAWS)]
        for kind in FLOWS
    }
    if os.environ.get("CURRENT_DETAIL"):
        _print_detail(scores)
    joined = [second_robot(np.random.default_rng(next(children))) for _ in range(DRAWS)]
    return [*accuracy(scores), *_second(joined), *_calibration(scores), *speed()]


def accuracy(scores: dict[str, list[Score]]) -> list[dict[str, object]]:
    """Ratios of errors of predicted surfacings."""
    rows = [
        _ratio(name, scores[kind], "next_m2", over, bar)
        for name, kind, over, bar in (
            ("next dive, lake gyre, over the last current", "lake gyre", ("last",), 0.88),
            (
                "next dive, lake uniform, over the mean of all dives",
                "lake uniform",
                ("mean",),
                1.12,
            ),
            ("next dive, coast all, over the last current", "coast all", ("last",), 0.68),
        )
    ]
    others = ("zero", "last", "mean")
    best = "round of 7, coast M2, over the best of zero, last, mean"
    rows.append(_ratio(best, scores["coast M2"], "round_m2", others, 0.40))
    last = "round of 7, coast gyre, over the last current"
    rows.append(_ratio(last, scores["coast gyre"], "round_m2", ("last",), 0.88))
    return rows


def _ratio(
    name: str, scores: list[Score], what: str, over: tuple[str, ...], bar: float
) -> dict[str, object]:
    sums = np.array(
        [[np.sum(getattr(one, what)[method]) for method in ("map", *over)] for one in scores]
    )  # (draws, methods)

    def ratio(rows: FloatArray) -> float:
        total = rows.sum(axis=0)
        return float(np.sqrt(total[0] / total[1:].min()))

    low, high = interval(sums, ratio)
    unit = f"95 % {low:.2f}..{high:.2f}, {len(scores)} waters"
    return at_most(AREA, name, ratio(sums), unit, bar)


def interval(rows: FloatArray, figure: Callable[[FloatArray], float]) -> tuple[float, float]:
    """Return the 95 % interval of a figure over resampled rows."""
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(rows), (_RESAMPLINGS, len(rows)))
    low, high = np.quantile([figure(rows[pick]) for pick in picks], (0.025, 0.975))
    return float(low), float(high)


def second_robot(rng: np.random.Generator) -> tuple[float, float]:
    """Return squared errors of a second robot's first dives: with the first one's, and alone."""
    water = COAST
    flow = everything(water, rng)
    shared = Learner(water.config)
    first = Robot(water, flow, rng, "one")
    for _ in range(KNOWN_OF_FIRST):
        seen, _ = first.dive(shared.known)
        shared.take(seen)
        shared.take(first.stay())
    second = Robot(water, flow, rng, "two")
    second.time_s = first.time_s
    alone = Learner(water.config)
    errors = np.zeros(2)
    for _ in range(FIRST_OF_SECOND):
        seen, end = second.dive(shared.known)
        actual = end - seen.position_ned[-1, :2]
        for i, learner in enumerate((shared, alone)):
            said = learner.known.displacement(seen.time_s, seen.position_ned).mean_ne_m
            errors[i] += np.sum((actual - said) ** 2)
            learner.take(seen)
        stay = second.stay()
        shared.take(stay)
        alone.take(stay)
    return float(errors[0]), float(errors[1])


def _second(errors: list[tuple[float, float]]) -> list[dict[str, object]]:
    rows = np.array(errors)

    def ratio(some: FloatArray) -> float:
        shared, alone = some.sum(axis=0)
        return float(np.sqrt(shared / alone))

    low, high = interval(rows, ratio)
    name = "second robot's first ten dives, shared over alone, coast all"
    unit = f"95 % {low:.2f}..{high:.2f}, {len(rows)} waters"
    return [at_most(AREA, name, ratio(rows), unit, 0.65)]


def _calibration(scores: dict[str, list[Score]]) -> list[dict[str, object]]:
    means = {kind: np.mean([np.mean(one.nees) for one in found]) for kind, found in scores.items()}
    inside = {kind: np.mean([np.mean(one.inside) for one in all]) for kind, all in scores.items()}
    name = "normalized error squared of the next dive"
    least, most = min(means, key=means.__getitem__), max(means, key=means.__getitem__)
    flow = [float(np.sum(one.flow_m2_s2)) / len(one.flow_m2_s2) for one in scores["lake gyre"]]
    flow_cm_s = 100.0 * float(np.sqrt(np.mean(flow)))
    spread, held = float(means[least]), 100.0 * min(inside.values())
    return [
        row(AREA, f"{name}, least of six flows", spread, least, 1.2, spread >= 1.2),
        at_most(AREA, f"{name}, greatest of six flows", float(means[most]), most, 2.6),
        row(AREA, "90 % ellipses that hold, least of six flows", held, "%", None, None),
        at_most(AREA, "flow near the tracks, lake gyre", flow_cm_s, "cm/s", 1.4),
    ]


def speed() -> list[dict[str, object]]:
    """Processor time of what the station does often, and how exact its table is."""
    rng = np.random.default_rng(1)
    robot, known = Robot(COAST, everything(COAST, rng), rng, "one"), CurrentMap(COAST.config)
    for _ in range(60):
        known.append(robot.dive(known)[0])
    from_s = robot.time_s
    until_s = from_s + 1.5 * ROUND * 3500.0
    took, record = _timed(lambda: tabulate(known, COAST.box, from_s, until_s))
    table = table_of(record)
    exact, rough = [], []
    for _ in range(ROUND):
        seen, _ = robot.dive(known)
        inside = known.displacement(seen.time_s, seen.position_ned).mean_ne_m
        exact.append(inside)
        rough.append(displacement_along(table, seen.time_s - from_s, seen.position_ned))
        robot.stay()
    off = np.sqrt(np.mean(np.sum((np.array(rough) - exact) ** 2, axis=1)))
    size = np.sqrt(np.mean(np.sum(np.square(exact), axis=1)))
    while len(known.observations) < 100:
        known.append(robot.dive(known)[0])
    more, _ = robot.dive(known)
    append_s, _ = _timed(lambda: known.append(more))
    return [
        at_most(AREA, "append at 100 dives", 1e3 * append_s, "ms", 80.0),
        at_most(AREA, "table of 3072 points from 60 dives", 1e3 * took, "ms", 150.0),
        at_most(AREA, "table's displacement off", 100.0 * float(off / size), "% rms", 3.5),
    ]


def _timed(action: Callable[[], T]) -> tuple[float, T]:
    began = time.process_time()
    found = action()
    return time.process_time() - began, found


def _print_detail(scores: dict[str, list[Score]]) -> None:
    for kind, found in scores.items():
        for what in ("next_m2", "round_m2"):
            rms = {
                method: float(
                    np.sqrt(np.mean(np.concatenate([getattr(o, what)[method] for o in found])))
                )
                for method in METHODS
            }
            print(kind, what, {name: round(value, 1) for name, value in rms.items()})
        print(
            kind,
            "nees",
            round(float(np.mean([np.mean(o.nees) for o in found])), 2),
            "90 %",
            round(float(np.mean([np.mean(o.inside) for o in found])), 3),
        )


if __name__ == "__main__":
    for line in measure():
        print(line)
