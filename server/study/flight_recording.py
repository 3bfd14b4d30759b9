"""Recorded flights as the studies need them, or the sentence that says what they lack."""

import math
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from autonomy.arrays import BoolArray
from autonomy.identification.config import SegmentRules
from autonomy.identification.recording import Recording
from db.column import microseconds, moment
from db.query.camera.fixes import iterate_fixes
from db.query.fleet.deployments import DeploymentRecord, get_deployment, list_deployments
from db.query.measured.state_columns import StateColumns, begin_of_last_dives, state_columns
from db.store import Store
from robot_link.camera.fix import CameraFix
from server.base.problem import FieldError, Problem, conflict, unprocessable

SURFACE_DEPTH_M = 0.05
"""A report from above this is one from the surface."""

_FEWEST_FIXES = 10
ROWS_MAX = 50_000
"""Longest recording that is held against a model: 14 hours at one report a second."""


@dataclass(frozen=True, slots=True)
class Flight:
    """The reports of a robot from a stretch of time."""

    deployment: DeploymentRecord
    columns: StateColumns
    fixes: tuple[CameraFix, ...] | None = None
    """Where cameras saw it meanwhile, in order of time; None where its own word counts."""

    @property
    def start_at(self) -> datetime:
        """Moment of the first report."""
        return moment(int(self.columns.measured_at_us[0]))

    @property
    def end_at(self) -> datetime:
        """Moment of the last report."""
        return moment(int(self.columns.measured_at_us[-1]))

    def recording(self) -> Recording:
        """Return the reports with their time in seconds from the first of them."""
        columns = self.columns
        own = Recording(
            time_s=(columns.measured_at_us - columns.measured_at_us[0]) * 1e-6,
            position_ned=columns.position_ned,
            position_std_m=columns.position_std_m,
            has_fix=columns.has_fix,
            attitude_rad=columns.attitude_rad,
            net_buoyancy_kg=columns.net_buoyancy_kg,
            mass_position_m=columns.mass_position_m,
            tail_rad=columns.tail_rad,
            mode=None if (columns.mode < 0).all() else columns.mode,
        )
        if self.fixes is None:
            return own
        begin_us = int(columns.measured_at_us[0])
        after_s = np.array(
            [1e-6 * (microseconds(fix.measured_at) - begin_us) for fix in self.fixes]
        )
        places = np.array([fix.ned_m[:2] for fix in self.fixes]).reshape(-1, 2)
        stds = np.array([_std_m(fix) for fix in self.fixes])
        return own.seen_from_outside(after_s, places, stds)


async def find_deployment(store: Store, robot: str, deployment: str | None) -> DeploymentRecord:
    """Return a deployment of a robot, the newest if none is named.

    Raises:
        Problem: 422 if it is another robot's, 409 if the robot has none.
        UnknownIdError: If there is no such deployment.
    """
    if deployment is None:
        newest = await store.query(lambda s: list_deployments(s, robot=robot, limit=1))
        if not newest:
            raise conflict(f"{robot} has no deployment yet.")
        return newest[0]
    found = await store.query(lambda session: get_deployment(session, deployment))
    if found.robot != robot:
        message = f"{deployment} is one of {found.robot}"
        raise unprocessable("1 field is wrong.", [FieldError(loc=["deployment"], msg=message)])
    return found


async def read_flight(
    store: Store,
    deployment: DeploymentRecord,
    start: datetime | None = None,
    end: datetime | None = None,
    *,
    by_cameras: bool = False,
) -> Flight:
    """Read what a robot reported in a deployment, both ends included, all of it by default.

    With ``by_cameras`` it was where cameras saw it. Reports are dated by the robot's clock, fixes
    by the station's; that the two agreed is assumed, for nobody keeps how far they were apart.

    Raises:
        Problem: 422 if the range is empty, 409 if nothing in it can be used or it is too long; the
            sentence says what is missing, or what to name.
    """
    first = start or deployment.begun_at
    last = end or deployment.last_at
    if last is not None and first >= last:
        message = f"must be after {first.isoformat()}"
        raise unprocessable("1 field is wrong.", [FieldError(loc=["end"], msg=message)])
    columns = await store.query(
        lambda s: state_columns(s, deployment.robot, first, last, limit=ROWS_MAX + 1)
    )
    fault = _too_long(columns, deployment) or _fault(columns, deployment)
    if fault is not None:
        raise fault
    flight = Flight(deployment, columns)
    if not by_cameras:
        return flight
    fixes = await store.query(
        lambda s: tuple(
            one.fix
            for one in iterate_fixes(s, deployment.robot, flight.start_at, flight.end_at)
            if one.fix.quality != "refused"
        )
    )
    if len(fixes) < _FEWEST_FIXES:
        raise conflict(
            f"Cameras saw {deployment.robot} {len(fixes)} times in this time; {_FEWEST_FIXES} are"
            " needed, or let its own positions count. Its clock is taken for the station's."
        )
    return replace(flight, fixes=fixes)


async def read_last_dives(
    store: Store, deployment: DeploymentRecord, dives: int, rules: SegmentRules
) -> Flight:
    """Read what a robot reported in the last dives of a deployment, as far as ``ROWS_MAX`` goes.

    Raises:
        Problem: As ``read_flight``.
    """
    begin = await store.query(
        lambda session: begin_of_last_dives(
            session,
            deployment.robot,
            deployment.begun_at,
            deployment.last_at,
            dives=dives,
            surface_depth_m=rules.surface_depth_m,
            shortest_s=rules.shortest_segment_s,
            limit=ROWS_MAX,
        )
    )
    if begin is None or begin == deployment.last_at:
        return await read_flight(store, deployment)
    return await read_flight(store, deployment, begin)


def _std_m(fix: CameraFix) -> float:
    """Return the standard deviation of the horizontal position along its worst axis."""
    xx, xy, _, yy, _, _ = fix.covariance_m2
    return math.sqrt(0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy))


def _too_long(columns: StateColumns, deployment: DeploymentRecord) -> Problem | None:
    if len(columns) <= ROWS_MAX:
        return None
    first, last = (moment(int(columns.measured_at_us[row])) for row in (0, ROWS_MAX - 1))
    return conflict(
        f"{deployment.id} of {deployment.robot} has more than {ROWS_MAX:,} state reports in this "
        "time, too many to hold against a model at once; name start and end so that they are "
        f"fewer, such as {first:%Y-%m-%dT%H:%M:%SZ} and {last:%Y-%m-%dT%H:%M:%SZ}."
    )


def _fault(columns: StateColumns, deployment: DeploymentRecord) -> Problem | None:
    name = f"{deployment.id} of {deployment.robot}"
    if not len(columns):
        return conflict(f"{name} has no state report in this time.")
    missing = [title for title, known in _channels(columns).items() if not known.any()]
    if missing:
        return conflict(
            f"{name} has no record of {_listed(missing)}; a recording needs attitude and actuators "
            "to be held against a model (see `grace import --help` for their columns)."
        )
    if (columns.position_ned[:, 2] < SURFACE_DEPTH_M).all():
        return conflict(
            f"{name} has no report from under water in this time: the robot spoke at the surface "
            "only. Import what it logged on board, or take another deployment."
        )
    return None


def _channels(columns: StateColumns) -> dict[str, BoolArray]:
    roll, pitch, heading = columns.attitude_rad.T
    return {
        "roll": np.isfinite(roll),
        "pitch": np.isfinite(pitch),
        "heading": np.isfinite(heading),
        "net buoyancy": np.isfinite(columns.net_buoyancy_kg),
        "mass position": np.isfinite(columns.mass_position_m),
        "tail": np.isfinite(columns.tail_rad),
    }


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
