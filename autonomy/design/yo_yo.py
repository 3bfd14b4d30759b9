"""The turning depths of a glide along a line: how often a robot goes down and up on its way.

How far it must go down and up in all follows from the glide angle, which is kept as asked. What
gives way are the deep turns, which become by one factor so much shallower that the line ends where
it should, and where that is not enough the shallow turns. Only where the turns would then lie too
close together the angle gives way too: steeper, as far as the vehicle glides, else flatter.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

_SLACK_M = 1e-9
_SHALLOWER = (1.0, 0.75, 0.5, 0.25, 0.1)
"""Parts of the shallow turns' depth that are tried, the surface itself not among them."""
_ENDS = 2
"""Depths of one glide."""


@dataclass(frozen=True, slots=True)
class Line:
    """What a glide is asked to do along a line."""

    length_m: float
    travel_m: float
    """Depth to go down and up in all, for the glide angle that is asked."""
    steepest_m: float
    """The same for the steepest angle that the vehicle glides steadily; not less."""
    begin_m: float
    """Depth where the line begins."""
    shallow_m: float
    ends_up: bool
    """Whether the line ends at the surface; else it ends at whichever turn comes last."""
    depth_change_min_m: float
    """Least depth between two turns."""
    deep_at: Callable[[float], float]
    """Depth of the deep turn of a descent that begins so many metres along the line."""
    comes_up: Callable[[float], bool]
    """Whether a climb that begins after so much travel, m of depth up and down added, leads to the
    surface in the middle of the line."""


@dataclass(frozen=True, slots=True)
class Turn:
    """One turn, or an end."""

    depth_m: float
    gives_way: bool
    """Whether its depth may be less so that the line fits: a deep turn."""


def turning_depths(line: Line) -> list[float] | None:
    """Return the depths between which a robot glides straight, its first and last included.

    Each pair is one glide; all have one angle, the one that was asked for unless the turns would
    then lie too close together whatever gives way; then it is steeper, or flatter where it would be
    too steep.

    Returns:
        None if the line is too short, or the water too shallow, to glide along.
    """
    turns = _turns(line)
    if turns is None:
        return None
    for share in _SHALLOWER:
        shallow_m = share * line.shallow_m
        shallower = [_shallower(turn, line.shallow_m, shallow_m) for turn in turns]
        fitted = _fitted(shallower, shallow_m, line.travel_m)
        if _is_steady(fitted, line.depth_change_min_m):
            return fitted
    steeper = _steeper(turns, line)
    if steeper is not None:
        return steeper
    fewer = _fewer(turns, line)
    return fewer if fewer is not None and _is_steady(fewer, line.depth_change_min_m) else None


def _turns(line: Line) -> list[Turn] | None:
    """Return turns with the full depth, just as many as cover the travel or a little more."""
    turns = [Turn(line.begin_m, gives_way=False)]
    passed_m = 0.0
    is_down = True
    while passed_m < line.travel_m - _SLACK_M or (line.ends_up and turns[-1].depth_m > 0.0):
        here_m = turns[-1].depth_m
        if is_down:
            deep_m = line.deep_at(passed_m / line.travel_m * line.length_m)
            if deep_m < max(here_m, line.shallow_m) + line.depth_change_min_m:
                if here_m <= 0.0 or len(turns) > 1:
                    return None
            else:
                turns.append(Turn(deep_m, gives_way=True))
        else:
            is_last = line.ends_up and passed_m + here_m >= line.travel_m - _SLACK_M
            goes_up = is_last or line.comes_up(passed_m)
            turns.append(Turn(0.0 if goes_up else line.shallow_m, gives_way=False))
        is_down = not is_down
        passed_m += abs(turns[-1].depth_m - here_m)
    return turns


def _shallower(turn: Turn, before_m: float, after_m: float) -> Turn:
    """Return a turn with another depth if it is a shallow one."""
    is_shallow = not turn.gives_way and turn.depth_m == before_m
    return Turn(after_m, gives_way=False) if is_shallow else turn


def _fitted(turns: list[Turn], shallow_m: float, travel_m: float) -> list[float]:
    """Return depths with which the turns take just the travel; the deep ones give way."""
    full, least = _scaled(turns, shallow_m, 1.0), _scaled(turns, shallow_m, 0.0)
    most_m, none_m = _travel_m(full), _travel_m(least)
    if most_m - none_m < _SLACK_M:
        return full
    return _scaled(turns, shallow_m, (travel_m - none_m) / (most_m - none_m))


def _scaled(turns: list[Turn], shallow_m: float, share: float) -> list[float]:
    return [
        shallow_m + share * (turn.depth_m - shallow_m) if turn.gives_way else turn.depth_m
        for turn in turns
    ]


def _steeper(turns: list[Turn], line: Line) -> list[float] | None:
    """Return the same turns just as deep as each glide needs; None where that is too steep."""
    least, full = (_scaled(turns, line.shallow_m, share) for share in (0.0, 1.0))
    needed = 0.0
    for (a, b), (c, d) in zip(pairwise(least), pairwise(full), strict=True):
        gain_m, lacks_m = abs(d - c) - abs(b - a), line.depth_change_min_m - abs(b - a)
        if lacks_m > _SLACK_M:
            needed = max(needed, lacks_m / gain_m if gain_m > 0.0 else math.inf)
    if needed > 1.0:
        return None
    depths = _scaled(turns, line.shallow_m, needed)
    is_gentle = _travel_m(depths) <= line.steepest_m + _SLACK_M
    return depths if is_gentle and _is_steady(depths, line.depth_change_min_m) else None


def _fewer(turns: list[Turn], line: Line) -> list[float] | None:
    """Return the same with one descent and climb less, at full depth; None where none is left."""
    kept = [turn.depth_m for turn in turns[:-2]]
    if len(kept) < _ENDS:
        return None
    return [*kept[:-1], 0.0] if line.ends_up else kept


def _travel_m(depths: list[float]) -> float:
    return sum(abs(b - a) for a, b in pairwise(depths))


def _is_steady(depths: list[float], least_m: float) -> bool:
    """Tell whether each glide changes depth by enough, down and up in turn."""
    changes = [b - a for a, b in pairwise(depths)]
    alternates = all(a * b < 0.0 for a, b in pairwise(changes))
    return alternates and all(abs(change) >= least_m - _SLACK_M for change in changes)
