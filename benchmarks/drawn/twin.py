"""How long a flight of the readable program keeps to twins of it, flown in the same noise.

The twins' currents are others by less than anybody could measure, one in each direction. Where
one of them parts, the flight is chaotic, as that of a robot that dives to a place straight below
it: what differs grows a thousandfold in ten seconds. From there on a comparison with another
program tells nothing. The nudge is of the size of what two programs differ by in any case: a fix
goes through degrees and back, which rounds it by 1e-8 m.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from robot_link.mission import Mission
from simulator.ahead import readable
from simulator.ahead.drawn import Drawn
from simulator.ahead.state import ROW_BELIEVED_NORTH, ROW_NORTH, ROW_TIME
from simulator.fleet import RobotDefinition

NUDGE_M_S = 1e-7
TOLD_APART_M = 1e-3
"""In the twenty minutes of a flight the nudge alone moves a robot by a tenth of this."""
_ROUNDING_S = 1e-6
_DIRECTIONS = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))


def calm_rows(
    definition: RobotDefinition,
    mission: Mission,
    drawn: Drawn,
    seed: int,
    truth: readable.ReadableFlight,
) -> int:
    """Return how many rows of a flight are as those of its twins; all of them if it is calm.

    Args:
        definition: The robot.
        mission: What it flies.
        drawn: What the flight met.
        seed: Of its noise.
        truth: What came of it.
    """
    twins = _twins(definition, mission, drawn, seed)
    return min(_rows_alike(truth, twin) for twin in twins)


def _twins(
    definition: RobotDefinition, mission: Mission, drawn: Drawn, seed: int
) -> Iterator[readable.ReadableFlight]:
    north, east = drawn.current_ne_m_s
    for to_north, to_east in _DIRECTIONS:
        nudged = (north + to_north * NUDGE_M_S, east + to_east * NUDGE_M_S)
        twin = readable.fly_readable(
            definition, mission, replace(drawn, current_ne_m_s=nudged), seed
        )
        if twin is None:
            raise ValueError("it was cancelled")
        yield twin


def _rows_alike(truth: readable.ReadableFlight, twin: readable.ReadableFlight) -> int:
    both = min(len(truth.rows), len(twin.rows), _rows_before_changes_part(truth, twin))
    apart_m = np.abs(truth.rows[:both] - twin.rows[:both])[:, ROW_NORTH : ROW_BELIEVED_NORTH + 3]
    is_apart = (apart_m > TOLD_APART_M).any(axis=1)
    return int(np.argmax(is_apart)) if is_apart.any() else both


def _rows_before_changes_part(truth: readable.ReadableFlight, twin: readable.ReadableFlight) -> int:
    """Return how many rows lie before the first change of leg or mode that one has alone.

    What is decided so narrowly may come a step later in another program, too, and is seen in the
    way only after a while.
    """
    pairs = zip_longest(truth.changes, twin.changes)
    apart_s = [min(one[0] for one in pair if one) for pair in pairs if pair[0] != pair[1]]
    if not apart_s:
        return len(truth.rows)
    return int(np.searchsorted(truth.rows[:, ROW_TIME], apart_s[0] - _ROUNDING_S))
