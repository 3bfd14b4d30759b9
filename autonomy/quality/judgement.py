"""What the rules say of one series: a flag for each value, and what each test found."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.quality.flag import FAIL, GOOD, SUSPECT, UNKNOWN, FlagArray, worst
from autonomy.quality.rules import DepthRule, PositionRule, SeriesRule
from autonomy.quality.series_test import flat_line, gross_range, rate_of_change, speed, spike
from autonomy.site import Box


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """Flags of one series."""

    flags: FlagArray
    """Shape ``(n,)``."""
    by_test: Mapping[str, FlagArray]
    """Flags of each test that ran."""

    @property
    def counts(self) -> dict[str, dict[str, int]]:
        """How many values of each test, and of all together, have which flag."""
        parts = {**self.by_test, "all": self.flags}
        names = {GOOD: "good", UNKNOWN: "not_evaluated", SUSPECT: "suspect", FAIL: "fail"}
        return {
            test: {name: int(np.count_nonzero(flags == flag)) for flag, name in names.items()}
            for test, flags in parts.items()
        }


def judge_series(values: FloatArray, times_s: FloatArray, rule: SeriesRule) -> Judgement:
    """Judge the values of a channel.

    Args:
        values: Shape ``(n,)``, in the channel's unit.
        times_s: Strictly ascending, shape ``(n,)``, s.
        rule: Limits of the channel; see ``QualityRules.with_ranges`` for those of the catalogue.
    """
    suspect, fail = (rule.suspect_low, rule.suspect_high), (rule.fail_low, rule.fail_high)
    tests = {"range": gross_range(values, suspect, fail)}
    if rule.spike_suspect is not None or rule.spike_fail is not None:
        tests["spike"] = spike(values, rule.spike_suspect, rule.spike_fail)
    if rule.rate_suspect is not None:
        tests["rate"] = rate_of_change(values, times_s, rule.rate_suspect)
    if rule.flat_suspect_s is not None or rule.flat_fail_s is not None:
        tests["flat_line"] = flat_line(
            values, times_s, rule.flat_suspect_s, rule.flat_fail_s, rule.flat_tolerance
        )
    return Judgement(worst(tests.values(), values.size), tests)


def judge_position(
    north_east: FloatArray,
    times_s: FloatArray,
    has_fix: BoolArray,
    rule: PositionRule,
    bounds: Box,
) -> Judgement:
    """Judge places in the site's frame, m, shape ``(n, 2)``; ``bounds`` are the water's."""
    margin = rule.margin_m
    north = (bounds.x_min_m - margin, bounds.x_max_m + margin)
    east = (bounds.y_min_m - margin, bounds.y_max_m + margin)
    open_span = (None, None)
    inside = worst(
        (
            gross_range(north_east[:, 0], north, open_span),
            gross_range(north_east[:, 1], east, open_span),
        ),
        len(north_east),
    )
    moved = speed(
        north_east, times_s, has_fix, rule.speed_suspect_m_s, rule.speed_fail_m_s, rule.resolution_m
    )
    tests = {"bounds": inside, "speed": moved}
    return Judgement(worst(tests.values(), len(north_east)), tests)


def judge_depth(
    depth_m: FloatArray, times_s: FloatArray, rule: DepthRule, deepest_m: float
) -> Judgement:
    """Judge depths, m, positive down, against the deepest place of the water."""
    fail = (-rule.above_m, deepest_m + rule.margin_m)
    tests = {
        "range": gross_range(depth_m, (0.0, None), fail),
        "rate": rate_of_change(depth_m, times_s, rule.rate_suspect_m_s, None, rule.resolution_m),
    }
    return Judgement(worst(tests.values(), depth_m.size), tests)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Values in a row that have the same flag, which is not good, for the same reason."""

    first: int
    last: int
    flag: int
    tests: tuple[str, ...]
    """Those that gave it, in the order in which they ran; empty for one not evaluated."""


def stretches(judgement: Judgement) -> list[Stretch]:
    """Return what is not good, in order; values that are missing have no flag."""
    flags, names = judgement.flags, tuple(judgement.by_test)
    reasons = np.zeros(flags.size, dtype=np.int64)
    for bit, name in enumerate(names):
        reasons |= (judgement.by_test[name] == flags).astype(np.int64) << bit
    told = np.isin(flags, (UNKNOWN, SUSPECT, FAIL))
    key = np.where(told, flags.astype(np.int64) << len(names) | reasons, -1)
    starts = np.flatnonzero(np.diff(key, prepend=-2))
    ends = np.append(starts, key.size)[1:] - 1
    return [
        Stretch(
            int(first),
            int(last),
            int(flags[first]),
            tuple(name for bit, name in enumerate(names) if int(reasons[first]) >> bit & 1),
        )
        for first, last in zip(starts, ends, strict=True)
        if key[first] >= 0
    ]
