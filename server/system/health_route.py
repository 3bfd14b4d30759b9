"""Is the station there, and can it work? The one resource that needs no sign-in."""

from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from typing import Annotated, Final

from fastapi import APIRouter

from db.fault import StoreUnavailableError
from db.query.fleet.robots import list_robots
from server.access.dependency import AccessDep
from server.base.dependency import FoundationDep
from server.base.foundation import CAUSE, Foundation
from server.base.view import View, one_of
from server.system.certificate import ServedCertificate
from server.system.storage_fault import storage_sentence

router = APIRouter(prefix="/api/health", tags=["station"])

KERNELS_JOB: Final = "kernels"
"""Kind of the job that compiles the numeric kernels; see ``server.plan.machine_code``."""


@dataclass(frozen=True, slots=True)
class StorageView(View):
    """Whether the station's memory works."""

    ok: bool
    message: str
    """What is wrong, since when, and where telemetry waits; empty while nothing is."""
    since: datetime | None
    """Since when it fails, by the robots' clock; ``null`` while it works."""
    waiting_rows: int
    """Telemetry that waits to be written."""
    bridged_rows: int
    """How much of that is in the bridge journal on the disk, and survives the station's end."""


@dataclass(frozen=True, slots=True)
class ClockView(View):
    """The robots' time."""

    now: datetime
    speed: float
    """Seconds of this clock per second of the wall."""


@dataclass(frozen=True, slots=True)
class HealthView(View):
    """How the station is."""

    status: Annotated[str, one_of("ok", "degraded")]
    """``ok``, or ``degraded`` when something fails that the station can live with."""
    ready: bool
    """Whether the station can take work now."""
    first_start: bool
    """Whether nobody can sign in yet: show the form that creates the first administrator."""
    simulation: bool
    demo: bool
    """Whether faults of simulated robots can be caused (`/api/demo/faults`)."""
    version: str
    storage: StorageView
    robots: int
    clock: ClockView
    unacknowledged_alarms: int
    preparing: str
    """What the station compiles since its first start, and how far it is; empty once all is done.
    Pages are served meanwhile, and what needs a part that is not there yet waits for it."""
    certificate_expires: datetime | None
    """End of the certificate with which the station speaks TLS; null where a proxy does."""


@router.get("")
async def get_health(foundation: FoundationDep, access: AccessDep) -> HealthView:
    """Return whether the station works."""
    store = foundation.store
    fault = store.fault
    robots = 0
    try:
        robots = len(await store.query(list_robots))
    except StoreUnavailableError as error:
        fault = str(error)
    jobs = foundation.jobs.running
    return HealthView(
        status="ok" if fault is None else "degraded",
        ready=fault is None,
        first_start=access.needs_first_admin,
        simulation=foundation.settings.simulation,
        demo=foundation.settings.demo_port is not None,
        version=version("grace-ground-station"),
        storage=_storage(foundation, fault),
        robots=robots,
        clock=ClockView(foundation.clock.now(), foundation.clock.speed),
        unacknowledged_alarms=foundation.alarms.unacknowledged,
        preparing=next((one.message for one in jobs if one.kind == KERNELS_JOB), ""),
        certificate_expires=(
            foundation.services.get(ServedCertificate).expires
            if foundation.settings.has_tls
            else None
        ),
    )


def _storage(foundation: Foundation, fault: str | None) -> StorageView:
    store = foundation.store
    alarm = None if fault is None else foundation.alarms.standing(CAUSE, None)
    since = None if alarm is None else alarm.raised_at
    return StorageView(
        ok=fault is None,
        message=storage_sentence(store, fault, since),
        since=since,
        waiting_rows=store.waiting_rows,
        bridged_rows=store.bridged_rows,
    )
