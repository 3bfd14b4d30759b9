"""The states on a recovered card: where the robot believed to be, and how it flew.

A state of the same millisecond is the same one. Telemetry's numbers stay, for they are finer than
the five digits of the card; what telemetry did not tell of a state, the card does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
from sqlalchemy.orm import Session

from autonomy.site import Site
from db.column import microseconds
from db.query.fleet.robots import robot_key
from db.query.measured.imported import FLIGHT, known_states
from robot_link.messages import STATE, RobotId, StateReport
from server.fleet.plausibility import fault_of_state
from server.recording.merge import nearest_state
from server.recording_file.card import Card
from server.recording_file.raw import FileFault


def judged_states(
    robot: str,
    card: Card,
    shift: timedelta,
    faults: list[FileFault],
    site: Site,
    at: datetime,
    speed: float,
) -> list[StateReport]:
    """Return the states that can be true, in the robot's name; the others join the faults."""
    found: list[StateReport] = []
    for one in card.states:
        measured_at = one.state.measured_at - shift
        state = replace(one.state, robot=RobotId(robot), measured_at=measured_at, received_at=at)
        fault = fault_of_state(state, site, at, speed)
        if fault is None:
            found.append(state)
        else:
            faults.append(FileFault(one.place, fault))
    return found


def held_states(
    session: Session, robot: str, states: Sequence[StateReport]
) -> tuple[list[StateReport], list[tuple[int, Mapping[str, float]]]]:
    """Return the new states; and of the others the kept moment, and what the card tells of it."""
    if not states:
        return [], []
    at_us = np.array([microseconds(one.measured_at) for one in states], dtype=np.int64)
    known_us, _ = known_states(session, robot_key(session, robot), int(at_us[0]), int(at_us[-1]))
    nearest = nearest_state(known_us, at_us)
    new = [states[row] for row in np.flatnonzero(nearest < 0).tolist()]
    same = [
        (int(known_us[nearest[row]]), _flown(states[row]))
        for row in np.flatnonzero(nearest >= 0).tolist()
    ]
    return new, same


def _flown(state: StateReport) -> Mapping[str, float]:
    return {key: value for key, value in STATE.values(state).items() if key in FLIGHT}
