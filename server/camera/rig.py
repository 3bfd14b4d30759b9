"""Cameras that robots are found by: where they are, what is unsure of that, where to look."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

from sqlalchemy.orm import Session

from autonomy.vision.camera import Rig
from autonomy.vision.tag import Layout, Registry
from db.query.camera import calibrations as query
from db.query.camera.calibrations import CalibrationRecord
from robot_link.camera.sighting import Region
from server.base.foundation import Foundation
from server.camera.cameras import Cameras
from server.camera.document import found_layout, rig_of
from server.camera.event import RigChanged
from server.camera.tags import Tags

SetRegions = Callable[[str, Sequence[Region]], None]


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedRig:
    """Cameras as they were calibrated, with the level and the ripples of now."""

    rig: Rig
    layout: Layout
    """Tags where the calibration found them."""
    record: CalibrationRecord


class CameraRig:
    """What fixes are made with. Belongs to one event loop.

    ``RigChanged`` tells on the bus that it is another one.
    """

    def __init__(self, foundation: Foundation, cameras: Cameras, tags: Tags) -> None:
        self._foundation = foundation
        self._cameras = cameras
        self._tags = tags
        self._left_out: frozenset[str] = frozenset()
        self._usable: Rig | None = None
        self._regions: dict[str, tuple[Region, ...]] = {}
        self._set_regions: SetRegions | None = None
        self.calibrated: CalibratedRig | None = None
        """All cameras that are calibrated, those that are left out too; None where none is."""

    async def load(self) -> None:
        """Take up the calibration that is in use."""
        record = await self._foundation.store.query(query.rig_in_use)
        self._calibrated_by(record)

    @property
    def rig(self) -> Rig | None:
        """Cameras to find robots by; None where there is none.

        Those that are not calibrated or have moved are not among them.
        """
        return self._usable

    @property
    def calibration(self) -> int | None:
        """Key of the calibration that a fix cites."""
        return None if self.calibrated is None else self.calibrated.record.key

    @property
    def registry(self) -> Registry:
        """Who has which tag; the fixed ones as they were surveyed."""
        return self._tags.registry

    @property
    def left_out(self) -> frozenset[str]:
        """Cameras that are calibrated, but not used."""
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
        self._calibrated_by(calibration)

    def renew(self) -> None:
        """Look again which of the calibrated cameras there still are."""
        self._calibrated_by(None if self.calibrated is None else self.calibrated.record)

    def put_water(self, rig: Rig) -> None:
        """Take the water's level and ripples of a rig that was made of ``calibrated``."""
        if self.calibrated is not None:
            self.calibrated = replace(self.calibrated, rig=rig)
            self._tell()

    def leave_out(self, cameras: Collection[str]) -> None:
        """Leave these cameras out, and no others."""
        if self._left_out != frozenset(cameras):
            self._left_out = frozenset(cameras)
            self._tell()

    def _calibrated_by(self, record: CalibrationRecord | None) -> None:
        self.calibrated = None
        if record is not None:
            keys = {camera.id: camera.key for camera in self._cameras.records}
            rig = rig_of(record.result, record.covariance, keys)
            if rig.cameras:
                self.calibrated = CalibratedRig(rig, found_layout(record.result), record)
        self._tell()

    def _tell(self) -> None:
        usable = None if self.calibrated is None else self.calibrated.rig
        for name in self._left_out:
            if usable is not None and usable.number(name) is not None:
                usable = usable.without(name)
        self._usable = usable if usable is not None and usable.cameras else None
        self._foundation.bus.publish(RigChanged())
