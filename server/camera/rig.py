"""Cameras that robots are found by: where they are, what is unsure of that, where to look."""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

from sqlalchemy.orm import Session

from autonomy.vision.tag import Layout, Registry, layout_of
from db.fault import StoreUnavailableError
from db.query.camera import calibrations as query
from db.query.camera.calibrations import CalibrationRecord
from db.query.camera.cameras import CameraRecord
from robot_link.camera.sighting import Region
from server.base.foundation import Foundation
from server.camera.address import source_of
from server.camera.cameras import Cameras
from server.camera.event import RigChanged
from server.camera.tags import Tags
from server.camera.used_rig import Document, UsedRig

log = logging.getLogger(__name__)
SetRegions = Callable[[str, Sequence[Region]], None]


class CameraRig:
    """What fixes are made with. Belongs to one event loop.

    ``RigChanged`` tells on the bus that it is another one.
    """

    def __init__(self, foundation: Foundation, cameras: Cameras, tags: Tags) -> None:
        self._foundation = foundation
        self._cameras = cameras
        self._tags = tags
        self._left_out: frozenset[str] = frozenset()
        self._left_out_kept: frozenset[str] = frozenset()
        self._usable: UsedRig | None = None
        self._regions: dict[str, tuple[Region, ...]] = {}
        self._set_regions: SetRegions | None = None
        self.record: CalibrationRecord | None = None
        """The calibration that is in use, whether its cameras are still there or not."""
        self.calibrated: UsedRig | None = None
        """All cameras that are calibrated, those that are left out too; None where none is."""

    async def load(self) -> None:
        """Take up the calibration that is in use, and which cameras are left out."""

        def read(session: Session) -> tuple[CalibrationRecord | None, frozenset[str]]:
            return query.rig_in_use(session), query.left_out(session)

        record, left_out = await self._foundation.store.query(read)
        self._left_out = self._left_out_kept = left_out
        self._calibrated_by(record)

    @property
    def rig(self) -> UsedRig | None:
        """Cameras to find robots by; None where there is none.

        Those that are not calibrated or have moved are not among them.
        """
        return self._usable

    @property
    def calibration(self) -> int | None:
        """Key of the calibration that a fix cites."""
        return None if self.calibrated is None else self.calibrated.calibration

    @property
    def registry(self) -> Registry:
        """Who has which tag; the fixed ones as they were surveyed."""
        return self._tags.registry

    @property
    def left_out(self) -> frozenset[str]:
        """Cameras that are calibrated, but not used; also after the next start."""
        return self._left_out

    def set_regions(self, camera: str, regions: Sequence[Region]) -> None:
        """Say where in a camera's pictures robots are expected; none: seek everywhere."""
        told = tuple(regions)
        if self._regions.get(camera, ()) != told:
            self._regions[camera] = told
            if self._set_regions is not None:
                self._set_regions(camera, told)

    def regions(self, camera: str) -> tuple[Region, ...]:
        """Return where robots are expected in a camera's pictures."""
        return self._regions.get(camera, ())

    def on_regions(self, set_regions: SetRegions) -> None:
        """Have regions told to the processes of the cameras."""
        self._set_regions = set_regions

    async def use(self, calibration: CalibrationRecord | None) -> None:
        """Find robots by a calibration from now on; it is in use after the next start, too."""
        key = None if calibration is None else calibration.key

        def write(session: Session) -> None:
            query.use_rig(session, key)

        await self._foundation.store.write(write)
        self._left_out = self._left_out_kept = frozenset()
        self._calibrated_by(calibration)

    def renew(self) -> None:
        """Look again which of the calibrated cameras there still are, at their addresses."""
        now = () if self.calibrated is None else self.calibrated.cameras
        if self.record is not None and self._placed(self.record) != now:
            self._calibrated_by(self.record)

    def lens_key(self, camera: str) -> int | None:
        """Return the calibration of a camera's lens that its place rests on, None if not known."""
        origin = {} if self.record is None else _origins(self.record).get(camera, {})
        return origin.get("lens")

    @property
    def layout(self) -> Layout:
        """The fixed tags where the calibration found them, as surveyed where there is none."""
        if self.record is None:
            return self._tags.registry.layout
        return layout_of({"tags": self.record.result["tags"]})

    def put_water(self, level_m: float, level_std_m: float, ripple_slope_rad: float) -> None:
        """Take the water's level and ripples as the cameras see them now."""
        if self.calibrated is not None:
            self.calibrated = replace(
                self.calibrated,
                level_m=level_m,
                level_std_m=level_std_m,
                ripple_slope_rad=ripple_slope_rad,
            )
            self._tell()

    def leave_out(self, cameras: Collection[str]) -> None:
        """Leave these cameras out, and no others; what cannot be kept is kept the next time."""
        if self._left_out != frozenset(cameras):
            self._left_out = frozenset(cameras)
            self._tell()
        if self._left_out != self._left_out_kept:
            self._left_out_kept = self._left_out
            self._foundation.background.start("cameras that are left out", self._keep_left_out())

    async def _keep_left_out(self) -> None:
        kept, key = self._left_out_kept, self.calibration
        try:
            await self._foundation.store.write(lambda session: query.leave_out(session, key, kept))
        except StoreUnavailableError as error:
            log.warning("which cameras are left out is not kept: %s", error)
            self._left_out_kept = frozenset()

    def _calibrated_by(self, record: CalibrationRecord | None) -> None:
        self.record, self.calibrated = record, None
        if record is not None:
            cameras = self._placed(record)
            if cameras:
                level_m: float = record.result["level_m"]
                late = {
                    one.id: one.latency_std_s
                    for one in self._cameras.records
                    if one.latency_std_s is not None
                }
                self.calibrated = UsedRig(
                    record.key,
                    record.result,
                    record.covariance,
                    cameras,
                    level_m,
                    latency_std_s=late,
                )
        self._tell()

    def _placed(self, record: CalibrationRecord) -> tuple[str, ...]:
        """Return the cameras of a calibration that there still are, at the same addresses."""
        known, origins = {one.id: one for one in self._cameras.records}, _origins(record)
        return tuple(
            name
            for one in record.result["cameras"]
            if (camera := known.get(name := one["id"])) is not None
            and camera.key == one["key"]
            and origins.get(name, {}).get("source", source_of(camera.uri)) == source_of(camera.uri)
        )

    def _tell(self) -> None:
        self._usable = None
        if self.calibrated is not None:
            used = tuple(one for one in self.calibrated.cameras if one not in self._left_out)
            self._usable = replace(self.calibrated, cameras=used) if used else None
        self._foundation.bus.publish(RigChanged())


def origin_of(camera: CameraRecord) -> Document:
    """Return what a calibration of the rig notes of a camera, to know whether it still is it."""
    return {"lens": camera.lens_key, "source": source_of(camera.uri)}


def _origins(record: CalibrationRecord) -> Mapping[str, Document]:
    return record.inputs.get("origins", {})
