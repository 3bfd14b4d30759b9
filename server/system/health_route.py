"""Is the station there, and can it work? The one resource that needs no sign-in."""

import shutil
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from typing import Annotated, Final

from fastapi import APIRouter, Response

from db.fault import StoreUnavailableError
from db.query.fleet.robots import list_robots
from server.access.dependency import AccessDep
from server.base.dependency import FoundationDep
from server.base.foundation import CAUSE, Foundation
from server.base.view import View, one_of
from server.system.certificate import ServedCertificate
from server.system.storage_fault import storage_sentence
from server.watch.loop import LoopWatch
from server.watch.station_clock import StationClock

router = APIRouter(prefix="/api/health", tags=["station"])
KERNELS_JOB: Final = "kernels"
"""Kind of the job that compiles the numeric kernels; see ``server.plan.machine_code``."""
DISK_LOW_BYTES: Final = 500_000_000
LAG_LONG_S: Final = 5.0


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
    waiting_changes: int
    """Changes that wait to be written."""


@dataclass(frozen=True, slots=True)
class DiskView(View):
    """Where the data folder is."""

    free_bytes: int
    size_bytes: int


@dataclass(frozen=True, slots=True)
class WorkersView(View):
    """Processes that plan and calculate."""

    busy: int
    idle: int
    queued: int
    """Tasks that wait for one."""


@dataclass(frozen=True, slots=True)
class MachineClockView(View):
    """The clock of the machine."""

    is_synchronised: bool | None
    """Whether something keeps it right; ``null`` where the machine does not say."""
    max_error_s: float | None
    last_jump_s: float
    """By how much it jumped last, of this run of the station; 0 if it never did."""


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
    """Whether the station can take work now; while it cannot, the status of the answer is 503."""
    reasons: list[str]
    """Why it is degraded, a sentence each; empty while nothing is wrong."""
    first_start: bool
    """Whether nobody can sign in yet: show the form that creates the first administrator."""
    simulation: bool
    demo: bool
    """Whether faults of simulated robots can be caused (`/api/demo/faults`)."""
    version: str
    storage: StorageView
    disk: DiskView
    event_loop_lag_s: float
    """How late the station did what was due, at worst in the last minute."""
    workers: WorkersView
    robots: int
    clock: ClockView
    machine_clock: MachineClockView
    unacknowledged_alarms: int
    preparing: str
    """What the station compiles since its first start, and how far it is; empty once all is done.
    Pages are served meanwhile, and what needs a part that is not there yet waits for it."""
    certificate_expires: datetime | None
    """End of the certificate with which the station speaks TLS; null where a proxy does."""


@router.get("", responses={503: {"model": HealthView, "description": "It can take no work."}})
async def get_health(
    response: Response, foundation: FoundationDep, access: AccessDep
) -> HealthView:
    """Return how the station is; 503 while it can take no work."""
    store, services = foundation.store, foundation.services
    loop, clock = services.get(LoopWatch), services.get(StationClock)
    fault = store.fault
    robots = 0
    try:
        robots = len(await store.query(list_robots))
    except StoreUnavailableError as error:
        fault = str(error)
    usage = shutil.disk_usage(foundation.settings.data_dir)
    disk = DiskView(usage.free, usage.total)
    reasons = _reasons(fault, disk, loop.worst_s, clock.text)
    if fault is not None:
        response.status_code = 503
    kernel, jobs = clock.kernel, foundation.jobs.running
    return HealthView(
        status="degraded" if reasons else "ok",
        ready=fault is None,
        reasons=reasons,
        first_start=access.needs_first_admin,
        simulation=foundation.settings.simulation,
        demo=foundation.settings.demo_port is not None,
        version=version("grace-ground-station"),
        storage=_storage(foundation, fault),
        disk=disk,
        event_loop_lag_s=round(loop.worst_s, 3),
        workers=_workers(foundation),
        robots=robots,
        clock=ClockView(foundation.clock.now(), foundation.clock.speed),
        machine_clock=MachineClockView(
            None if kernel is None else kernel.is_synchronised,
            None if kernel is None else kernel.max_error_s,
            clock.newest_jump_s,
        ),
        unacknowledged_alarms=foundation.alarms.unacknowledged,
        preparing=next((one.message for one in jobs if one.kind == KERNELS_JOB), ""),
        certificate_expires=(
            services.get(ServedCertificate).expires if foundation.settings.has_tls else None
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
        waiting_changes=store.waiting_changes,
    )


def _reasons(fault: str | None, disk: DiskView, lag_s: float, clock: str) -> list[str]:
    reasons = [fault] if fault is not None else []
    if disk.free_bytes < DISK_LOW_BYTES:
        reasons.append(f"Only {disk.free_bytes / 1e6:.0f} MB are free where the data folder is.")
    if lag_s > LAG_LONG_S:
        reasons.append(f"The station was {lag_s:.0f} s late in the last minute.")
    if clock:
        reasons.append(clock)
    return reasons


def _workers(foundation: Foundation) -> WorkersView:
    loads = [pool.load() for pool in (foundation.workers, foundation.study_workers)]
    return WorkersView(
        sum(load.busy for load in loads),
        sum(load.idle for load in loads),
        sum(load.queued for load in loads),
    )
