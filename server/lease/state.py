"""Who is in charge of a robot: nothing moves a lease but what a person or the clock said.

===============  ==============  =========  ====================
state            evidence        becomes    event
===============  ==============  =========  ====================
free             taken           held       lease.taken
held, requested  taken_over      held       lease.taken_over
held             requested       requested  lease.requested
requested        granted         held       lease.granted
requested        timed_out       held       lease.timed_out
requested        refused         held       lease.refused
requested        withdrawn       held       lease.withdrawn
requested        expired         held       lease.expired
held, requested  handed_over     held       lease.handed_over
held             released        free       lease.released
requested        released        held       lease.granted
held             script_let      held       lease.script_let
requested        script_let      requested  lease.script_let
held             script_stopped  held       lease.script_stopped
requested        script_stopped  requested  lease.script_stopped
===============  ==============  =========  ====================

Each row is written by the one writer of the database with its event, so of two who take a free
robot at once one has it and the other is told who. A lease with a request that is given back goes
to the one who asked.
"""

from dataclasses import dataclass, replace
from datetime import datetime
from enum import StrEnum
from typing import Literal

from sqlalchemy.orm import Session

from db.query.fleet.leases import LeaseRecord, get_lease, put_lease
from db.query.station.events import add_event
from db.writer import tell_after_commit
from server.base.transition_table import transitions


class LeaseEvidence(StrEnum):
    """What can be said of a lease."""

    TAKEN = "taken"
    TAKEN_OVER = "taken_over"
    """From a script, from somebody silent, or by an administrator with a reason."""
    REQUESTED = "requested"
    GRANTED = "granted"
    TIMED_OUT = "timed_out"
    """A request that nobody answered is granted by itself."""
    REFUSED = "refused"
    WITHDRAWN = "withdrawn"
    EXPIRED = "expired"
    """What another ground station asked was answered by nobody while it stood."""
    HANDED_OVER = "handed_over"
    RELEASED = "released"
    SCRIPT_LET = "script_let"
    SCRIPT_STOPPED = "script_stopped"


TRANSITIONS = transitions(__doc__, LeaseEvidence)
_TO_REQUESTER = frozenset({LeaseEvidence.GRANTED, LeaseEvidence.TIMED_OUT, LeaseEvidence.RELEASED})
_LEVELS = {LeaseEvidence.TAKEN_OVER: "watch", LeaseEvidence.TIMED_OUT: "watch"}


@dataclass(frozen=True, slots=True)
class Holder:
    """A person, a script, or another ground station on the MAVLink side."""

    name: str
    kind: Literal["person", "script", "station"] = "person"
    token: str | None = None
    """Id of a script's bearer token."""
    system: int | None = None
    """MAVLink system id of another ground station."""

    @classmethod
    def station(cls, system: int) -> "Holder":
        """Return another ground station."""
        return cls(f"ground station {system}", "station", system=system)

    def holds(self, lease: LeaseRecord) -> bool:
        """Tell whether a lease is theirs; a script is known by its name, with a new token too."""
        return (self.name, self.kind) == (lease.holder, lease.holder_kind)


@dataclass(frozen=True, slots=True)
class LeaseChanged:
    """A lease is another's, or more is said of it; told after the commit."""

    lease: LeaseRecord
    before: LeaseRecord

    @property
    def has_other_holder(self) -> bool:
        """Whether somebody else is in charge now, or nobody."""
        return _holder_of(self.lease) != _holder_of(self.before)


def apply(
    session: Session,
    robot: str,
    evidence: LeaseEvidence,
    text: str,
    at: datetime,
    *,
    to: Holder | None = None,
    note: str = "",
) -> LeaseRecord | None:
    """Move a lease as the table says, with its event, which is the record of who, to whom and why.

    Args:
        session: The transaction.
        robot: Whose lease.
        evidence: What was said.
        text: It in one sentence.
        at: When, by the robots' clock.
        to: Who takes it, asks for it, is handed it, or is the script that may act.
        note: Why, in the words of who did it.

    Returns:
        The lease now; ``None`` if the evidence leads nowhere, and nothing was changed.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    before = get_lease(session, robot)
    step = TRANSITIONS.get((before.state, evidence))
    if step is None:
        return None
    after = _moved(before, step.state, evidence, text, at, to, note)
    put_lease(session, after)
    data = {
        "from": before.holder,
        "from_kind": before.holder_kind,
        "to": after.holder,
        "to_kind": after.holder_kind,
        "about": None if to is None else to.name,
        "note": note,
    }
    level = _LEVELS.get(evidence, "info")
    add_event(session, at, step.event, text, level=level, robot=robot, data=data)
    tell_after_commit(session, LeaseChanged(after, before), robot)
    return after


def _moved(
    before: LeaseRecord,
    state: str,
    evidence: LeaseEvidence,
    text: str,
    at: datetime,
    to: Holder | None,
    note: str,
) -> LeaseRecord:
    """Return what a lease becomes."""
    robot = before.robot
    if evidence in _TO_REQUESTER and before.requested_by is not None:
        system = before.requested_system
        to = Holder(before.requested_by) if system is None else Holder.station(system)
    match evidence:
        case LeaseEvidence.SCRIPT_LET if to is not None:
            return replace(before, script=to.name, script_token=to.token)
        case LeaseEvidence.SCRIPT_STOPPED:
            return replace(before, script=None, script_token=None)
        case LeaseEvidence.REQUESTED if to is not None:
            return replace(
                before,
                state=state,
                requested_by=to.name,
                requested_system=to.system,
                requested_at=at,
                request_note=note,
            )
        case LeaseEvidence.REFUSED | LeaseEvidence.WITHDRAWN | LeaseEvidence.EXPIRED:
            return replace(
                before,
                state=state,
                requested_by=None,
                requested_system=None,
                requested_at=None,
                request_note="",
            )
        case LeaseEvidence.RELEASED if to is None:
            return LeaseRecord(robot, state, reason=text)
        case _ if to is not None:
            return LeaseRecord(robot, state, to.name, to.kind, to.token, to.system, at, text)
        case _:
            raise ValueError(f"{evidence} needs somebody")


def _holder_of(lease: LeaseRecord) -> tuple[str | None, str | None]:
    return lease.holder, lease.holder_kind
