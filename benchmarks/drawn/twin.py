"""How long a flight of the readable program keeps to a twin of it, flown in the same noise.

The twin's current is another by less than anybody could measure. Where they part, the flight is
chaotic, as that of a robot that dives to a place straight below it: what differs grows a
thousandfold in ten seconds. From there on a comparison with another program tells nothing.
"""

from dataclasses import replace

import numpy as np

from robot_link.mission import Mission
from simulator.ahead import readable
from simulator.ahead.drawn import Drawn
from simulator.ahead.state import ROW_BELIEVED_NORTH, ROW_NORTH
from simulator.fleet import RobotDefinition

NUDGE_M_S = 1e-12
TOLD_APART_M = 1e-8


def calm_rows(
    definition: RobotDefinition,
    mission: Mission,
    drawn: Drawn,
    seed: int,
    truth: readable.ReadableFlight,
) -> int:
    """Return how many rows of a flight are as those of its twin; all of them if it is calm.

    Args:
        definition: The robot.
        mission: What it flies.
        drawn: What the flight met.
        seed: Of its noise.
        truth: What came of it.
    """
    north, east = drawn.current_ne_m_s
    nudged = replace(drawn, current_ne_m_s=(north + NUDGE_M_S, east))
    twin = readable.fly_readable(definition, mission, nudged, seed)
    if twin is None:
        raise ValueError("it was cancelled")
    both = min(len(truth.rows), len(twin.rows))
    apart_m = np.abs(truth.rows[:both] - twin.rows[:both])[:, ROW_NORTH : ROW_BELIEVED_NORTH + 3]
    is_apart = (apart_m > TOLD_APART_M).any(axis=1)
    return int(np.argmax(is_apart)) if is_apart.any() else both
