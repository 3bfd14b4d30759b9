"""Quality control of deployments: runs of the rules that hold, and flags that people set."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from autonomy.quality.rules import QualityRules
from autonomy.seawater import DERIVED, can_derive
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.query.fleet.robots import get_robot
from db.query.measured import quality as query
from db.query.measured.quality import FlagStateError, ManualFlag
from db.query.measured.samples import sampled_variables
from db.query.station.events import add_event
from server.base.channels import catalogue_in
from server.base.configuration import current
from server.base.configuration_kind import find_kind
from server.base.dependency import period_of
from server.base.foundation import Foundation
from server.base.job import JobPerKey, JobProgress
from server.base.problem import FieldError, conflict, unprocessable
from server.base.study import worked_out
from server.delivery import quality_task
from server.delivery.judged import DEPTH, POSITION, Wanted
from server.delivery.quality_task import QualityFound

JOB = "quality"
FLAG_WORDS = {1: "good", 2: "probably good", 3: "probably bad", 4: "bad"}
"""Flags that people set, as files of OG1.0 have them."""


def wanted_of(
    session: Session,
    deployment: str,
    database_url: str,
    *,
    smoothed: bool = False,
    rules: QualityRules | None = None,
) -> Wanted:
    """Return what a worker judges of a deployment, by default by the rules of its robot now.

    Raises:
        UnknownIdError: If there is none of this id.
        Problem: 409 if it has not begun.
    """
    record = get_deployment(session, deployment)
    period_of(record)
    if rules is None:
        rules = current(session, find_kind("quality"), record.robot).value_as(QualityRules)
    known = catalogue_in(session)
    sampled = channels_of(session, record)
    derived = tuple(key for key in derived_of(sampled) if key in known)
    believable = {
        key: (known[key].low, known[key].high) for key in (*sampled, *derived) if key in known
    }
    return Wanted(
        database_url=database_url,
        deployment=record,
        believable=believable,
        rules=rules.with_ranges(believable),
        smoothed=smoothed,
        derived=derived,
        has_true_headings=record.kind == "recorded" or get_robot(session, record.robot).is_foreign,
    )


def run_of(session: Session, deployment: str, database_url: str) -> Wanted:
    """Return what a run judges: once the robot is back, the values of the file that is signed.

    Raises:
        UnknownIdError: If there is none of this id.
        Problem: 409 if it has not begun.
    """
    is_back = get_deployment(session, deployment).state not in ("planned", "in_water")
    return wanted_of(session, deployment, database_url, smoothed=is_back)


def samples_of(session: Session, record: DeploymentRecord) -> dict[str, int]:
    """Return how many measurements there are of each channel of a deployment that has begun."""
    start, end = record.begun_at, record.last_at
    return sampled_variables(session, record.robot, start=start, end=end, log=record.log)


def channels_of(session: Session, record: DeploymentRecord) -> list[str]:
    """Return the channels that were sampled in a deployment, in the order of their names."""
    return sorted(samples_of(session, record))


def derived_of(sampled: Sequence[str]) -> list[str]:
    """Return the channels that follow of those that were sampled."""
    return [key for key in DERIVED if can_derive(key, set(sampled))]


def series_of(session: Session, record: DeploymentRecord) -> list[str]:
    """Return everything of a deployment that is judged and can be flagged."""
    sampled = channels_of(session, record)
    return [*sampled, *derived_of(sampled), POSITION, DEPTH]


def write_run(
    session: Session, wanted: Wanted, found: QualityFound, at: datetime, by: str
) -> query.QualityRun:
    """Keep a run, with its event."""
    rules, record = wanted.rules, wanted.deployment
    run = query.add_quality_run(
        session,
        record.id,
        rules=rules.model_dump(mode="json"),
        sha256=rules.sha256,
        counts=found.counts,
        rows=found.rows,
        samples=found.samples,
        seen=found.seen,
        found=found.stretches,
        at=at,
        by=by,
    )
    bad = sum(one["all"]["suspect"] + one["all"]["fail"] for one in found.counts.values())
    text = (
        f"{by}: {rules.name} {rules.version} looked at {found.rows} moments of {record.id} and"
        f" flagged {bad} values."
    )
    data = {"deployment": record.id, "sha256": rules.sha256, "flagged": bad}
    add_event(session, at, "deployment.checked", text, robot=record.robot, data=data)
    return run


def write_flag(
    session: Session,
    deployment: str,
    *,
    series: str,
    first_at: datetime,
    last_at: datetime,
    flag: int,
    reason: str,
    at: datetime,
    by: str,
) -> ManualFlag:
    """Set a flag, with its event.

    Raises:
        UnknownIdError: If there is no such deployment.
        FlagStateError: If it is not open.
        Problem: 422 for a series that the deployment does not have, or times that do not fit.
    """
    record = get_deployment(session, deployment)
    period_of(record)
    known = series_of(session, record)
    errors: list[FieldError] = []
    if series not in known:
        errors.append(FieldError(loc=["series"], msg=f"must be one of {', '.join(known)}"))
    if last_at < first_at:
        errors.append(FieldError(loc=["last_at"], msg="must not be before first_at"))
    # screens and people tell times in whole seconds
    begun_at = record.begun_at.replace(microsecond=0)
    for name, at in (("first_at", first_at), ("last_at", last_at)):
        if at < begun_at or (record.last_at is not None and at > record.last_at):
            errors.append(FieldError(loc=[name], msg=f"must be within {deployment}"))
    if errors:
        raise unprocessable("The flag does not fit the deployment.", errors)
    kept = query.add_manual_flag(
        session,
        deployment,
        series=series,
        first_at=first_at,
        last_at=last_at,
        flag=flag,
        reason=reason,
        at=at,
        by=by,
    )
    text = (
        f"{by}: {series} of {deployment} is {FLAG_WORDS[flag]} from {first_at:%Y-%m-%d %H:%M:%S}Z"
        f" to {last_at:%Y-%m-%d %H:%M:%S}Z: {reason}"
    )
    data = {"deployment": deployment, "flag": kept.id}
    add_event(session, at, "deployment.flagged", text, robot=record.robot, data=data)
    return kept


class QualityResult(TypedDict):
    """Whose data were judged."""

    deployment: str


class QualityRuns:
    """Runs the rules over deployments, one at a time each. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation
        self._runs = JobPerKey[str](foundation.jobs, JOB)

    async def start(self, deployment: str, *, by: str) -> str:
        """Begin a run; return the id of the job.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 409 if it has not begun, or a run is under way.
        """
        url = self._foundation.settings.resolved_database_url
        store = self._foundation.store
        wanted = await store.query(lambda session: run_of(session, deployment, url))
        return await self._runs.start_alone(
            deployment,
            lambda progress: self._work(wanted, by, progress),
            refusal=f"A run over {deployment} is under way; wait for it, or cancel it.",
            by=by,
            robot=wanted.deployment.robot,
        )

    async def flag(self, deployment: str, *, by: str, **said: object) -> ManualFlag:
        """Set a flag; see ``write_flag``."""
        at = self._foundation.clock.now()
        try:
            return await self._foundation.store.write(
                lambda session: write_flag(session, deployment, at=at, by=by, **said)  # pyright: ignore[reportArgumentType]
            )
        except FlagStateError as error:
            raise conflict(str(error)) from error

    async def withdraw(self, deployment: str, flag: str, *, by: str) -> ManualFlag:
        """Let a flag count no more.

        Raises:
            UnknownIdError: If the deployment has no such flag.
            Problem: 409 if the deployment is signed, or the flag was withdrawn already.
        """
        at = self._foundation.clock.now()

        def write(session: Session) -> ManualFlag:
            gone = query.withdraw_manual_flag(session, deployment, flag, at, by)
            robot = get_deployment(session, deployment).robot
            text = f"{by} withdrew {flag} of {deployment} ({gone.series}: {gone.reason})."
            data = {"deployment": deployment, "flag": flag}
            add_event(session, at, "deployment.unflagged", text, robot=robot, data=data)
            return gone

        try:
            return await self._foundation.store.write(write)
        except FlagStateError as error:
            raise conflict(str(error)) from error

    async def _work(self, wanted: Wanted, by: str, progress: JobProgress) -> QualityResult:
        found = await worked_out(
            self._foundation.study_workers,
            quality_task.TASK,
            wanted,
            lambda news: progress.report(*news),
        )
        at = self._foundation.clock.now()
        await self._foundation.store.write(
            lambda session: write_run(session, wanted, found, at, by)
        )
        return {"deployment": wanted.deployment.id}
