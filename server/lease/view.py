"""Leases as an operator sees them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from db.query.fleet.leases import LeaseRecord
from db.record import same
from robot_link.clock import monotonic_s
from robot_link.lease_config import LeaseConfig
from server.base.view import View, one_of
from server.lease.ground_station import GroundStations
from server.lease.leases import Leases
from server.lease.state import Holder


@dataclass(frozen=True, slots=True)
class LeaseRequestView(View):
    """Who asks for a robot that another is in charge of."""

    by: str
    at: datetime
    note: str
    granted_in_s: float | None
    """When it is granted by itself unless somebody answers, s of the wall from now; ``null`` for
    another ground station, to which nothing is granted by itself."""
    ends_in_s: float | None
    """When what another ground station asks is refused by itself unless somebody answers."""


@dataclass(frozen=True, slots=True)
class ScriptAskView(View):
    """A script that was refused since a person is in charge, who can let it act."""

    name: str
    token: str
    """Id of its bearer token."""
    age_s: float


@dataclass(frozen=True, slots=True)
class LeaseView(View):
    """Who is in charge of a robot, as one person or script sees it."""

    robot: str
    state: Annotated[str, one_of("free", "held", "requested")]
    holder: str
    """Empty while nobody is in charge."""
    holder_kind: Annotated[str, one_of("person", "script", "station", "")]
    """``station`` is another ground station on the MAVLink side."""
    is_mine: bool
    """Whether it is who asks."""
    since: datetime | None
    reason: str
    """How they came to be in charge, or how it came that nobody is."""
    silent_s: float
    """For how long nothing was seen of them by the station's own clock, s of the wall; 0 while a
    page or stream of theirs is open."""
    is_silent: bool
    """Whether that is so long that another pilot can take charge at once."""
    request: LeaseRequestView | None
    script: str
    """The script that may act too; empty for none."""
    asking: ScriptAskView | None
    by_radio: str
    """Whom the robot itself obeys by its last word, which other ground stations see too; one
    sentence, empty for a robot without a radio."""
    refusal: str
    """Why who asks can send the robot nothing now, one sentence; empty where they can."""


def lease_view(
    leases: Leases,
    stations: GroundStations,
    lease: LeaseRecord,
    limits: LeaseConfig,
    me: Holder,
) -> LeaseView:
    """Return a lease as somebody sees it."""
    silent_s = leases.silent_s(lease)
    return same(
        LeaseView,
        lease,
        holder=lease.holder or "",
        holder_kind=lease.holder_kind or "",
        is_mine=me.holds(lease),
        silent_s=silent_s,
        is_silent=lease.holder is not None and silent_s >= limits.silent_s,
        request=_request_view(leases, stations, lease, limits),
        script=lease.script or "",
        asking=_asking_view(leases, lease.robot),
        by_radio=stations.by_radio(lease.robot),
        refusal=leases.refusal(lease, me, limits),
    )


def _request_view(
    leases: Leases, stations: GroundStations, lease: LeaseRecord, limits: LeaseConfig
) -> LeaseRequestView | None:
    if lease.requested_by is None or lease.requested_at is None:
        return None
    return LeaseRequestView(
        by=lease.requested_by,
        at=lease.requested_at,
        note=lease.request_note,
        granted_in_s=leases.granted_in_s(lease, limits),
        ends_in_s=stations.ends_in_s(lease),
    )


def _asking_view(leases: Leases, robot: str) -> ScriptAskView | None:
    ask = leases.asked_by_script(robot)
    return None if ask is None else ScriptAskView(ask.name, ask.token, monotonic_s() - ask.at_s)
