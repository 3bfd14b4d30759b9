"""Files of deployments: which may be written, who wrote them, what the checks say."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, TypeVar

from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from autonomy.field.config import FieldConfig
from autonomy.quality.rules import KEPT, QualityRules
from db.query.fleet.deployments import DeploymentRecord, get_deployment
from db.query.fleet.robots import get_robot
from db.query.measured.delivery_files import DeliveryFile, add_delivery_file, delivery_files
from db.query.measured.quality import manual_flags, newest_quality_run
from db.query.station.configurations import configuration_at
from db.query.station.events import add_event
from db.query.storage.told import pruned_stretches
from robot_link.delivery_config import DeliveryMetadata
from server.base.channels import catalogue_in
from server.base.configuration import current
from server.base.configuration_kind import find_kind
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import FieldError, conflict, unprocessable
from server.base.settings import Settings
from server.base.study import worked_out
from server.delivery import file_task
from server.delivery.file_order import FileOrder
from server.delivery.file_task import KeptFile
from server.delivery.package.order import words_sha256
from server.delivery.quality import samples_of, wanted_of

FOLDER: Final = "delivery"
"""Of the data folder."""
SIGNED: Final = ("reviewed", "delivered")
Order = TypeVar("Order")


def mode_of(record: DeploymentRecord) -> str:
    """Return the mode of a file of a deployment as it stands now.

    D once it is reviewed. Before, R for what came by telemetry, P for an imported recording and
    for what the robot's own card was recovered of.
    """
    if record.state in SIGNED:
        return "D"
    has_card = any(one.get("is_card") for one in record.document.get("imports", ()))
    return "P" if record.kind == "recorded" or has_card else "R"


def metadata_of(session: Session, robot: str) -> DeliveryMetadata:
    """Return what is to be said of a robot's data."""
    return current(session, find_kind("delivery"), robot).value_as(DeliveryMetadata)


def reviewed_rules(session: Session, record: DeploymentRecord) -> QualityRules:
    """Return the rules that whoever reviewed a deployment saw.

    They are those of the newest run before, else those that held then.
    """
    at = datetime.fromisoformat(record.document["review"]["at"])
    run = newest_quality_run(session, record.id, until=at)
    if run is not None:
        return QualityRules.model_validate(run.rules, context=KEPT)
    held = configuration_at(session, "quality", record.robot, at)
    kind = find_kind("quality")
    rules = kind.default.model_dump() if held is None else held.value
    return QualityRules.model_validate(rules, context=KEPT)


@dataclass(frozen=True, slots=True)
class Wish:
    """Of which deployment something is wanted, and where and when it is written."""

    deployment: str
    no_better_data: bool
    """Whether somebody confirms that nothing better exists than telemetry."""
    at: datetime
    database_url: str
    data_dir: Path

    @classmethod
    def of(
        cls, deployment: str, settings: Settings, at: datetime, *, no_better_data: bool
    ) -> "Wish":
        """Return a wish of somebody whose station has these settings."""
        url, folder = settings.resolved_database_url, settings.data_dir
        return cls(deployment, no_better_data, at, url, folder)


def order_of(session: Session, wish: Wish) -> FileOrder:
    """Return what is to be written of a deployment now.

    Raises:
        UnknownIdError: If there is none of this id.
        Problem: 409 if it has not begun or is void; 422 with the path of each field that the
            metadata lack.
    """
    deployment = wish.deployment
    record = get_deployment(session, deployment)
    if record.void_reason:
        raise conflict(f"{deployment} is void: {record.void_reason}")
    mode = mode_of(record)
    rules = reviewed_rules(session, record) if mode == "D" else None
    wanted = wanted_of(session, deployment, wish.database_url, smoothed=mode == "D", rules=rules)
    metadata = metadata_of(session, record.robot)
    errors = [
        FieldError(loc=["metadata", *path.split(".")], msg=f"{title}: must be filled in")
        for path, title in metadata.missing()
    ]
    if mode == "D" and record.kind == "live" and not wish.no_better_data:
        words = "confirm that no better data exist: nothing was recovered from the robot's card"
        errors.append(FieldError(loc=["no_better_data"], msg=words))
    if errors:
        why = "; ".join(one.msg for one in errors)
        raise unprocessable(f"The file cannot be written yet: {why}.", errors)
    known = catalogue_in(session)
    field = current(session, find_kind("field"), record.robot).value_as(FieldConfig)
    review = record.document.get("review") or {}
    before = delivery_files(session, deployment, 1)
    return FileOrder(
        wanted=wanted,
        robot=get_robot(session, record.robot),
        channels={key: known[key] for key in wanted.channels},
        metadata=metadata,
        thresholds_m=tuple(field.fidelity_thresholds_m),
        manual=tuple(manual_flags(session, deployment)),
        mode=mode,
        signed_by=str(review.get("by", "")) if mode == "D" else "",
        written_at=wish.at,
        software=f"grace-ground-station {version('grace-ground-station')}",
        folder=wish.data_dir / FOLDER,
        came_after=_came_after(session, record) if mode == "D" else 0,
        earlier=str(before[0].document["history"]) if before else "",
        pruned=tuple(
            one.text
            for one in pruned_stretches(
                session,
                record.robot,
                ("states", "samples", "readings", "fixes"),
                record.begun_at,
                record.last_at,
            )
        ),
    )


def _came_after(session: Session, record: DeploymentRecord) -> int:
    """Return how many measurements came after the signature; 0 of one that did not count them."""
    signed = record.document["review"].get("samples")
    return 0 if signed is None else max(0, sum(samples_of(session, record).values()) - signed)


def write_kept(
    session: Session, order: FileOrder, kept: KeptFile, at: datetime, by: str
) -> DeliveryFile:
    """Note a file that is kept, with its event.

    Raises:
        JobError: If the deployment is not what it was when the file was begun: signed or opened
            anew, of other times, or void.
    """
    record = order.wanted.deployment
    refuse_changed(session, order)
    file = add_delivery_file(
        session,
        record.id,
        name=kept.name,
        mode=order.mode,
        sha256=kept.sha256,
        size=kept.bytes,
        rows=kept.rows,
        document=_document(order, kept),
        at=at,
        by=by,
    )
    findings = sum(len(one.findings) for one in kept.checks)
    unchecked = [one.suite for one in kept.checks if one.state == "unchecked"]
    verdict = f"{findings} findings" if findings else "no finding"
    if unchecked:
        verdict += f"; could not be checked: {', '.join(unchecked)}"
    text = f"{by}: {kept.name} was written of {record.id}, {kept.rows} rows, {verdict}."
    data = {"deployment": record.id, "file": file.id, "sha256": kept.sha256}
    add_event(session, at, "deployment.written", text, robot=record.robot, data=data)
    return file


def refuse_changed(session: Session, order: FileOrder) -> None:
    """Refuse a file that tells of its deployment what is not so any more."""
    begun, now = order.wanted.deployment, get_deployment(session, order.wanted.deployment.id)
    has_other_end = begun.last_at is not None and begun.last_at != now.last_at
    if has_other_end or _told(begun) != _told(now):
        raise JobError(f"{now.id} was changed while its file was written; write it anew.")


def _told(record: DeploymentRecord) -> tuple[object, ...]:
    """Return what a file says of a deployment itself."""
    return mode_of(record), record.document.get("review"), record.begun_at, record.void_reason


def _document(order: FileOrder, kept: KeptFile) -> Mapping[str, Any]:
    return {
        "checks": [asdict(one) for one in kept.checks],
        "source_sha256": kept.source_sha256,
        "history": order.history,
        "written_at": order.written_at.isoformat(),
        "words_sha256": words_sha256(order),
        "raised": kept.raised,
        "left_out": kept.left_out,
        "rule_set_sha256": order.wanted.rules.sha256,
        "metadata": order.metadata.model_dump(mode="json"),
    }


class Writing:
    """Jobs that write something of a deployment, one at a time of each.

    Belongs to one event loop.
    """

    def __init__(self, foundation: Foundation, kind: str) -> None:
        self._foundation = foundation
        self._jobs = JobPerKey[str](foundation.jobs, kind)

    def job(self, deployment: str) -> str | None:
        """Return the id of the job that writes something of a deployment, if one does."""
        return self._jobs.get(deployment)

    async def start(
        self,
        deployment: str,
        order_of: Callable[[Session, Wish], Order],
        work: Callable[[Order, JobProgress], Awaitable[Mapping[str, Any]]],
        *,
        no_better_data: bool,
        by: str,
    ) -> str:
        """Begin to write what an order says, which is made now; return the id of the job.

        Raises:
            Problem: 409 if something is being written of the deployment; else what ``order_of``
                raises.
        """
        foundation = self._foundation
        at = foundation.clock.now()
        wish = Wish.of(deployment, foundation.settings, at, no_better_data=no_better_data)
        order, robot = await foundation.store.query(
            lambda session: (
                order_of(session, wish),
                get_deployment(session, deployment).robot,
            )
        )
        return await self._jobs.start_alone(
            deployment,
            lambda progress: work(order, progress),
            refusal=f"A file of {deployment} is being written; wait for it, or cancel it.",
            by=by,
            robot=robot,
        )


class FileResult(TypedDict):
    """Which file was written."""

    deployment: str
    file: str


class DeliveryFiles:
    """Has files written. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, writing: Writing) -> None:
        self._foundation = foundation
        self._writing = writing

    async def start(self, deployment: str, *, no_better_data: bool, by: str) -> str:
        """Begin to write a file; return the id of the job.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 409 if it has not begun, is void, or something is being written of it; 422
                for what the metadata lack.
        """
        return await self._writing.start(
            deployment,
            order_of,
            lambda order, progress: self._work(order, by, progress),
            no_better_data=no_better_data,
            by=by,
        )

    async def _work(self, order: FileOrder, by: str, progress: JobProgress) -> FileResult:
        foundation = self._foundation
        kept = await worked_out(
            foundation.study_workers,
            file_task.TASK,
            order,
            lambda news: progress.report(*news),
        )
        at = foundation.clock.now()
        file = await foundation.store.write(
            lambda session: write_kept(session, order, kept, at, by)
        )
        return {"deployment": order.wanted.deployment.id, "file": file.id}
