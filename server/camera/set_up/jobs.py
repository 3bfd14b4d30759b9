"""Calibrations that take a while: a lens, the place of all cameras or of one, the latency."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Final

from sqlalchemy.orm import Session

from autonomy.vision.calibration.refusal import Refusal
from db.identity import public_id
from db.query.camera.calibrations import CalibrationKind, CalibrationRecord, add_calibration
from db.query.station.settings import get_setting, put_setting
from robot_link.camera.config import CameraConfig
from robot_link.camera.sighting import Sighting
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import conflict
from server.base.worker import WORKER_FAILURES
from server.camera import task
from server.camera.address import source_of
from server.camera.calibrations import CALIBRATION, Calibrations
from server.camera.cameras import Cameras
from server.camera.rig import CameraRig, origin_of
from server.camera.set_up.boards import Boards
from server.camera.set_up.collector import Collector
from server.camera.set_up.latency import PICTURES, latency_of, shows_one
from server.camera.tags import Tags
from server.camera.task import AdjustProblem, Found, KnownLens, LensProblem, ReadjustProblem

ADJUST_PICTURES: Final = 50
LEVEL_STD_M: Final = 0.005
_ACCURACY: Final = "camera.accuracy"
_LATENCY_PATIENCE_S: Final = 30.0
_LEAD_S: Final = 1.0
_BUSY: Final = "The cameras are being adjusted already."


@dataclass(frozen=True, slots=True)
class LatencyCheck:
    """What the page that a camera looks at is to show."""

    job: str
    begun_at: datetime
    """When the first tag is shown, by the station's clock."""


class CalibrationJobs:
    """Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        cameras: Cameras,
        tags: Tags,
        rig: CameraRig,
        calibrations: Calibrations,
        boards: Boards,
        collector: Collector,
    ) -> None:
        self._foundation = foundation
        self._cameras, self._tags, self._rig = cameras, tags, rig
        self._calibrations, self._boards, self._collector = calibrations, boards, collector
        self._of_camera: JobPerKey[str] = JobPerKey(foundation.jobs, "camera")
        self._of_rig: JobPerKey[str] = JobPerKey(foundation.jobs, "camera_rig")
        self._checks: dict[str, LatencyCheck] = {}
        self.accuracy: Mapping[str, Any] | None = None
        """What was last measured on the spot, and of which calibration."""

    async def load(self) -> None:
        """Take up what was measured last."""
        self.accuracy = await self._foundation.store.query(
            lambda session: get_setting(session, _ACCURACY)
        )

    async def take_board(self, camera: str, kind: task.LensKind, *, by: str) -> str:
        """Begin to take one picture of the board; return the id of the job."""
        self._cameras.get(camera)

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            return await self._boards.take(camera, kind, progress)

        return await self._of_camera.start_alone(camera, work, refusal=_busy(camera), by=by)

    async def calibrate_lens(self, camera: str, kind: task.LensKind, *, by: str) -> str:
        """Begin to calibrate a lens by the pictures of the board; return the id of the job."""
        before = self._cameras.get(camera)
        key, source = before.key, source_of(before.uri)

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            progress.report(0.1, "Calibrates the lens.")
            problem = LensProblem(kind, self._boards.shots(camera))
            found = await self._worked(task.LENS, problem)
            if source_of(self._cameras.get(camera).uri) != source:
                raise JobError(f"{camera} is another camera by now: take pictures of the board.")
            record = await self._kept("lens", found, by=by, camera_key=key)
            await self._calibrations.take(record, camera, by=by)
            return _result(record)

        return await self._of_camera.start_alone(camera, work, refusal=_busy(camera), by=by)

    async def adjust(
        self, camera: str | None, level_m: float | None, level_std_m: float, *, by: str
    ) -> str:
        """Begin to place all cameras, or one that was moved; return the id of the job."""
        if camera is not None:
            self._cameras.get(camera)

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            if camera is None:
                return await self._adjust_all(level_m, level_std_m, progress, by)
            return await self._adjust_one(camera, progress, by)

        return await self._of_rig.start_alone("rig", work, refusal=_BUSY, by=by)

    async def measure_accuracy(self, *, by: str) -> str:
        """Begin to find each fixed tag by the cameras alone; return the id of the job."""

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            rig = self._rig.calibrated
            level_m = 0.0 if rig is None else rig.level_m
            problem = await self._problem(level_m, LEVEL_STD_M, progress)
            return await self._measure(problem, progress)

        return await self._of_rig.start_alone("rig", work, refusal=_BUSY, by=by)

    async def check_latency(self, camera: str, *, by: str) -> LatencyCheck:
        """Begin to measure how late the pictures of a camera that looks at a page's tags come."""
        self._cameras.get(camera)
        clock = self._foundation.clock
        begun_at = clock.now() + timedelta(seconds=_LEAD_S)
        begun_wall = datetime.now(UTC) + timedelta(seconds=_LEAD_S)

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            seen = await self._collector.collect(
                [camera], PICTURES, progress, shows_one, _LATENCY_PATIENCE_S
            )
            found = latency_of(seen, begun_wall)
            if found is None:
                raise JobError("The pictures do not tell one latency: does the page show its tags?")
            changes = {"latency_s": found[0], "latency_std_s": found[1]}
            await self._cameras.change(camera, changes, by=by)
            return changes

        if clock.speed != 1.0:
            raise conflict("The latency is measured while the station's clock is the wall's.")
        job = await self._of_camera.start_alone(camera, work, refusal=_busy(camera), by=by)
        self._checks[camera] = LatencyCheck(job, begun_at)
        return self._checks[camera]

    def latency_check(self, camera: str) -> LatencyCheck | None:
        """Return the newest check of a camera's latency; None where there is none that runs."""
        self._cameras.get(camera)
        check = self._checks.get(camera)
        return check if check is not None and self._foundation.jobs.is_running(check.job) else None

    async def _adjust_all(
        self, level_m: float | None, level_std_m: float, progress: JobProgress, by: str
    ) -> Mapping[str, Any]:
        known = self._rig.calibrated
        if level_m is None:
            level_m = 0.0 if known is None else known.level_m
        origins = {record.id: origin_of(record) for record in self._cameras.records}
        problem = await self._problem(level_m, level_std_m, progress)
        progress.report(0.85, "Adjusts the cameras.")
        found = await self._worked(task.ADJUST, problem)
        record = await self._kept("rig", found, by=by, origins=origins)
        await self._calibrations.take(record, None, by=by)
        return _result(record)

    async def _adjust_one(self, camera: str, progress: JobProgress, by: str) -> Mapping[str, Any]:
        known = self._rig.calibrated
        if known is None or camera not in known.cameras:
            raise JobError(f"{camera} is not placed yet: adjust all cameras.")
        layout, before = self._rig.layout, self._rig.record
        origins = {} if before is None else before.inputs.get("origins", {})
        seen = await self._collector.collect([camera], ADJUST_PICTURES, progress)
        progress.report(0.85, f"Places {camera}.")
        keys = {record.id: record.key for record in self._cameras.records}
        problem = ReadjustProblem(known, layout, camera, keys, seen)
        found = await self._worked(task.READJUST, problem)
        record = await self._kept("rig", found, by=by, origins=origins)
        await self._calibrations.take(record, None, by=by)
        return _result(record)

    async def _problem(
        self, level_m: float, level_std_m: float, progress: JobProgress
    ) -> AdjustProblem:
        layout = self._tags.registry.layout
        if not layout.tags:
            raise JobError("Tell where the fixed tags of the tank are first.")
        lenses = self._lenses()
        if not lenses:
            raise JobError("No camera's lens is calibrated yet.")
        names = [one.camera for one in lenses]
        seen: tuple[Sighting, ...] = await self._collector.collect(names, ADJUST_PICTURES, progress)
        current = await self._foundation.configurations.current("camera", None)
        index = current.value_as(CameraConfig).refraction_index
        return AdjustProblem(lenses, layout, seen, level_m, level_std_m, index)

    def _lenses(self) -> tuple[KnownLens, ...]:
        known = [(one, self._calibrations.lens(one.id)) for one in self._cameras.records]
        return tuple(
            KnownLens(one.id, one.key, lens.result["lens"], lens.covariance)
            for one, lens in known
            if lens is not None
        )

    async def _measure(self, problem: AdjustProblem, progress: JobProgress) -> Mapping[str, Any]:
        progress.report(0.85, "Finds each fixed tag by the cameras alone.")
        calibration, at = self._rig.calibration, self._foundation.clock.now()
        try:
            found = await self._foundation.study_workers.run(task.ACCURACY, problem)
        except WORKER_FAILURES as error:
            raise JobError(f"This could not be worked out: {error}") from error
        if not found["tags"]:
            raise JobError("; ".join(found["left_out"]) or "No fixed tag is seen.")
        self.accuracy = {"calibration": calibration, "at": at.isoformat(), **found}
        kept = self.accuracy
        await self._foundation.store.write(lambda session: put_setting(session, _ACCURACY, kept))
        self._foundation.feed.mark("cameras")
        return {"tags": len(found["tags"])}

    async def _worked(self, name: str, problem: object) -> Found:
        try:
            found: Found | Refusal = await self._foundation.workers.run(name, problem)
        except WORKER_FAILURES as error:
            raise JobError(f"This could not be worked out: {error}") from error
        if isinstance(found, Refusal):
            raise JobError(f"Not taken: {found.reason}.")
        return found

    async def _kept(
        self,
        kind: CalibrationKind,
        found: Found,
        *,
        by: str,
        camera_key: int | None = None,
        origins: Mapping[str, Any] | None = None,
    ) -> CalibrationRecord:
        at = self._foundation.clock.now()
        tags = None if kind == "lens" else self._tags.record

        def write(session: Session) -> CalibrationRecord:
            return add_calibration(
                session,
                kind,
                result=found.result,
                covariance=found.covariance,
                inputs={**found.inputs, **({} if origins is None else {"origins": origins})},
                at=at,
                by=by,
                camera_key=camera_key,
                tag_set_key=None if tags is None else tags.key,
            )

        return await self._foundation.store.write(write)


def _busy(camera: str) -> str:
    return f"Something is being measured with {camera} already."


def _result(record: CalibrationRecord) -> Mapping[str, Any]:
    return {"calibration": public_id(CALIBRATION, record.key)}
