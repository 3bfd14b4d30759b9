"""What operators decide about deployments, each decision written down with its event."""

from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from db.query.fleet import deployment_change as change
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.query.fleet.robots import first_title, get_robot
from db.query.station.events import add_event
from server.base.foundation import Foundation
from server.base.problem import FieldError, conflict, unprocessable
from server.camera.picture.keeping import KeptPictures
from server.fleet.roster import Roster

_AHEAD_MAX = timedelta(minutes=1)
"""A moment this far ahead may be one of a clock that is not quite the station's."""

Launch = Callable[[Session, str], str]
"""Called with the id of a deployment in the transaction that begins it: raises 409 where it must
not begin, and returns what is to be said of it, "" if nothing."""
LaunchGate = Callable[[str, str, str], Awaitable[Launch]]
"""Looks at a robot that is about to be launched: its id, the reason why it shall be all the same
("" for none), and by whom."""


class Deployments:
    """Changes deployments; the fleet takes up each change before the caller is answered."""

    def __init__(self, foundation: Foundation, roster: Roster, pictures: KeptPictures) -> None:
        self._clock = foundation.clock
        self._store = foundation.store
        self._roster, self._pictures = roster, pictures
        self._gate: LaunchGate = _open_gate

    def set_gate(self, gate: LaunchGate) -> None:
        """Let every launch pass a gate; until then all pass."""
        self._gate = gate

    async def add(
        self,
        robot: str,
        *,
        title: str | None,
        purpose: str,
        people: Sequence[str],
        started_at: datetime | None,
        ended_at: datetime | None,
        by: str,
        overrule: str = "",
    ) -> DeploymentRecord:
        """Plan a deployment; one with a start has begun, one with an end too is over.

        ``overrule`` is why one begins although a checklist is open.

        Raises:
            Problem: 409 for a recording, a retired robot, a time that another deployment has, or a
                launch that a checklist keeps; 422 for times that do not fit.
        """
        self._refuse_future(started_at=started_at, ended_at=ended_at)
        at = self._clock.now()
        is_launch = started_at is not None and ended_at is None

        def write(session: Session) -> DeploymentRecord:
            name = title or first_title(get_robot(session, robot).name, started_at or at)
            return change.add_deployment(
                session,
                robot,
                title=name,
                purpose=purpose,
                people=people,
                started_at=started_at,
                ended_at=ended_at,
            )

        verb = "planned" if started_at is None else "began" if ended_at is None else "noted"
        launch = await self._gate(robot, overrule, by) if is_launch else None
        return await self._write(write, verb, by, launch=launch)

    async def begin(
        self, deployment: str, at: datetime | None, *, by: str, overrule: str = ""
    ) -> DeploymentRecord:
        """Begin a planned deployment, now or at a moment before.

        ``overrule`` is why it begins although a checklist is open.

        Raises:
            Problem: 409 if it is not planned, its robot is in the water, or a checklist keeps it;
                422 for the future.
        """
        self._refuse_future(at=at)
        moment = at or self._clock.now()
        record = await self._store.query(lambda session: get_deployment(session, deployment))
        launch = await self._gate(record.robot, overrule, by)
        return await self._write(
            lambda session: change.begin_deployment(session, deployment, moment),
            "began",
            by,
            launch=launch,
        )

    async def end(self, deployment: str, at: datetime | None, *, by: str) -> DeploymentRecord:
        """End a deployment, now or at a moment before.

        Raises:
            Problem: 409 if its robot is not in the water; 422 for a moment before it began.
        """
        self._refuse_future(at=at)
        moment = at or self._clock.now()
        return await self._write(
            lambda session: change.end_deployment(session, deployment, moment), "ended", by
        )

    async def split(
        self, deployment: str, at: datetime, title: str | None, *, by: str
    ) -> tuple[DeploymentRecord, DeploymentRecord]:
        """Let a deployment end at a moment within it and another go on from there.

        Raises:
            Problem: 409 if it has not begun or is a recording; 422 for a moment outside of it.
        """
        other: list[DeploymentRecord] = []

        def write(session: Session) -> DeploymentRecord:
            record = get_deployment(session, deployment)
            name = title or first_title(get_robot(session, record.robot).name, at)
            first, second = change.split_deployment(session, deployment, at, name)
            other.append(second)
            return first

        first = await self._write(write, "split", by)
        return first, other[-1]

    async def correct(self, deployment: str, changes: dict[str, Any], by: str) -> DeploymentRecord:
        """Change what is written of a deployment, or its times.

        Raises:
            Problem: 409 if it is void, a file was made of it, or another has this time; 422 for
                times that do not fit.
        """
        self._refuse_future(started_at=changes.get("started_at"), ended_at=changes.get("ended_at"))
        return await self._write(
            lambda session: change.correct_deployment(session, deployment, **changes),
            "corrected",
            by,
        )

    async def void(self, deployment: str, reason: str, *, by: str) -> DeploymentRecord:
        """Hide a deployment that was made by mistake; pictures that are kept of it are deleted.

        Raises:
            Problem: 409 if it is void already.
        """
        at = self._clock.now()
        record = await self._write(
            lambda s: change.void_deployment(s, deployment, reason, at), "voided", by, reason
        )
        await self._pictures.forget(deployment, by=by)
        return record

    async def review(self, deployment: str, note: str, *, by: str) -> DeploymentRecord:
        """Sign that the data were looked at.

        Raises:
            Problem: 409 if it is not recovered.
        """
        at = self._clock.now()
        return await self._write(
            lambda s: change.review_deployment(s, deployment, note, at, by), "reviewed", by, note
        )

    async def deliver(self, deployment: str, to: str, *, by: str) -> DeploymentRecord:
        """Note to whom the data were handed over; pictures that are kept of it are deleted.

        Raises:
            Problem: 409 if it is not reviewed.
        """
        at = self._clock.now()
        record = await self._write(
            lambda s: change.deliver_deployment(s, deployment, to, at, by), "delivered", by, to
        )
        await self._pictures.forget(deployment, by=by)
        return record

    async def reopen(self, deployment: str, reason: str, *, by: str) -> DeploymentRecord:
        """Let a reviewed or delivered deployment be reviewed anew.

        Raises:
            Problem: 409 if it is neither.
        """
        return await self._write(
            lambda s: change.reopen_deployment(s, deployment), "reopened", by, reason
        )

    async def _write(
        self,
        decide: Callable[[Session], DeploymentRecord],
        verb: str,
        by: str,
        why: str = "",
        launch: Launch | None = None,
    ) -> DeploymentRecord:
        at = self._clock.now()
        try:
            record = await self._store.write(
                lambda session: write_step(session, at, decide, verb, by, why, launch)
            )
        except change.DeploymentTimesError as error:
            raise unprocessable(str(error), []) from error
        except (change.DeploymentStateError, change.DeploymentOverlapError) as error:
            raise conflict(str(error)) from error
        await self._roster.refresh(record.robot)
        return record

    def _refuse_future(self, **moments: datetime | None) -> None:
        limit = self._clock.now() + _AHEAD_MAX * max(1.0, self._clock.speed)
        errors = [
            FieldError(loc=[name], msg=f"{at:%Y-%m-%d %H:%M:%S}Z has not come yet")
            for name, at in moments.items()
            if at is not None and at > limit
        ]
        if errors:
            raise unprocessable(f"{len(errors)} moments are in the future.", errors)


def write_step(
    session: Session,
    at: datetime,
    decide: Callable[[Session], DeploymentRecord],
    verb: str,
    by: str,
    why: str = "",
    launch: Launch | None = None,
) -> DeploymentRecord:
    """Make one change of a deployment and write its event, in one transaction.

    Args:
        session: A writing session.
        at: When it is done.
        decide: The change itself.
        verb: Last word of the event's kind, a key of ``_DONE``.
        by: Who decided.
        why: What they said.
        launch: Of a robot that is launched with it: whether it may be.
    """
    record = decide(session)
    passed = "" if launch is None else launch(session, record.id)
    said = f": {why}" if why else "."
    text = f"{by}: {record.id} of {record.robot} ({record.title}) {_DONE[verb]}{said} {passed}"
    text = text.rstrip()
    data = {"deployment": record.id}
    add_event(session, at, f"deployment.{verb}", text, robot=record.robot, data=data)
    return record


async def _open_gate(robot: str, overrule: str, by: str) -> Launch:
    """Let a launch pass."""
    del robot, overrule, by
    return lambda _session, _deployment: ""


_DONE = {
    "planned": "is planned",
    "began": "began",
    "noted": "is noted as over",
    "ended": "ended",
    "split": "was split",
    "corrected": "was corrected",
    "voided": "is void",
    "reviewed": "was reviewed",
    "delivered": "was delivered",
    "reopened": "is to be reviewed anew",
}
"""What became of a deployment, by the last word of its event's kind."""
