"""The processes of all cameras: one each, started, told and ended as their records say."""

import asyncio
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from robot_link.camera.config import CameraConfig
from robot_link.camera.sighting import BoardView, Region, Sighting, SourceSettings
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.base.secret import CameraAccount
from server.camera.calibrations import Calibrations, lens_size
from server.camera.cameras import Cameras
from server.camera.event import CameraChanged, PictureSeen
from server.camera.picture.newest import Pictures
from server.camera.rig import CameraRig
from server.camera.set_up.boards import Boards
from server.camera.status import CameraStatuses
from server.camera.supervisor import Supervisor, Surroundings


@dataclass(frozen=True, slots=True)
class _Run:
    """A supervisor at work."""

    supervisor: Supervisor
    tasks: tuple[asyncio.Task[None], ...]

    async def end(self) -> None:
        """End its process and wait until it is gone."""
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)


class CameraProcesses:
    """Belongs to one event loop. What cameras see is published on the bus as ``PictureSeen``."""

    def __init__(
        self,
        foundation: Foundation,
        cameras: Cameras,
        statuses: CameraStatuses,
        rig: CameraRig,
        calibrations: Calibrations,
        boards: Boards,
        pictures: Pictures,
    ) -> None:
        self._foundation = foundation
        self._cameras, self._statuses, self._rig = cameras, statuses, rig
        self._calibrations, self._boards, self._pictures = calibrations, boards, pictures
        self._runs: dict[str, _Run] = {}
        self._everywhere: Counter[str] = Counter()
        self._settling = asyncio.Lock()
        self._is_open = False
        self.config = CameraConfig()
        """As it holds now."""
        self._around = Surroundings(
            foundation.clock,
            foundation.alarms,
            foundation.background,
            lambda: self.config,
            self,
            statuses.tell,
        )

    async def load(self) -> None:
        """Take up the settings."""
        current = await self._foundation.configurations.current("camera", None)
        self.config = current.value_as(CameraConfig)

    async def start(self) -> None:
        """Start a process for each camera."""
        self._is_open = True
        for record in self._cameras.records:
            await self._settle(record.id)

    async def stop(self) -> None:
        """End all processes."""
        self._is_open = False
        async with self._settling:
            runs, self._runs = list(self._runs.values()), {}
        await asyncio.gather(*(run.end() for run in runs))

    def process_id(self, camera: str) -> int | None:
        """Return the id of a camera's process; None where none runs."""
        run = self._runs.get(camera)
        return None if run is None else run.supervisor.process_id

    def changed(self, told: CameraChanged) -> None:
        """Have the process of a camera follow its record."""
        if self._is_open:
            self._foundation.background.start(f"camera {told.id}", self._settle(told.id))

    def settings_changed(self, changed: SettingsChanged) -> None:
        """Take up changed settings."""
        if changed.kind == "camera":
            self._foundation.background.start("camera settings", self.load())

    def set_regions(self, camera: str, regions: Sequence[Region]) -> None:
        """Say where in a camera's pictures robots are expected."""
        if camera in self._runs:
            told = () if self._everywhere[camera] else regions
            self._runs[camera].supervisor.set_regions(told)

    def seek_everywhere(self, camera: str, wanted: bool) -> None:
        """Have tags sought everywhere in a camera's pictures while somebody wants that."""
        self._everywhere[camera] += 1 if wanted else -1
        self.set_regions(camera, self._rig.regions(camera))

    def want_previews(self, camera: str, wanted: bool) -> None:
        """Say whether somebody looks through a camera."""
        if camera in self._runs:
            self._runs[camera].supervisor.want_previews(wanted)

    def ask_board(self, camera: str) -> None:
        """Have the board sought in the next picture of a camera."""
        if camera in self._runs:
            self._runs[camera].supervisor.ask_board()

    def sighting(self, camera: str, sighting: Sighting, taken_at: datetime) -> None:
        """Take what was seen in a picture whose time is believed."""
        size = self._lens_size(camera)
        if size is not None and size != sighting.size:
            fault = f"calibrated for {size[0]} x {size[1]}, sends {sighting.size[0]} x "
            self._statuses.of(camera).refused[f"{fault}{sighting.size[1]}"] += 1
            return
        self._foundation.bus.publish(PictureSeen(camera, sighting, taken_at))

    def _lens_size(self, camera: str) -> tuple[int, int] | None:
        """Return the size of pictures that a camera's lens was calibrated for, if it was."""
        record = self._calibrations.lens(camera)
        return None if record is None else lens_size(record)

    def board(self, camera: str, view: BoardView) -> None:
        """Take what was seen of the calibration board."""
        self._boards.hear(camera, view)

    def preview(self, camera: str, jpeg: bytes) -> None:
        """Take a picture."""
        self._pictures.hear(camera, jpeg)

    async def _settle(self, camera: str) -> None:
        """Have a camera's process be the one that its record asks for."""
        async with self._settling:
            record = next((one for one in self._cameras.records if one.id == camera), None)
            run = self._runs.get(camera)
            wanted = None
            if record is not None and self._is_open:
                account = await self._cameras.account(camera)
                wanted = self._settings(camera, record.uri, record.latency_s, account)
            if run is not None and run.supervisor.settings != wanted:
                del self._runs[camera]
                await run.end()
                if wanted is None:
                    await run.supervisor.clear_alarms()
            if wanted is not None and camera not in self._runs:
                self._runs[camera] = self._begun(wanted)

    def _begun(self, settings: SourceSettings) -> _Run:
        camera = settings.camera
        supervisor = Supervisor(settings, self._statuses.of(camera), self._around)
        supervisor.set_regions(() if self._everywhere[camera] else self._rig.regions(camera))
        supervisor.want_previews(self._pictures.is_wanted(camera))
        start = self._foundation.background.start
        tasks = (
            start(f"process of {camera}", supervisor.run()),
            start(f"silence of {camera}", supervisor.watch_silence()),
        )
        return _Run(supervisor, tasks)

    def _settings(
        self, camera: str, uri: str, latency_s: float | None, account: CameraAccount | None
    ) -> SourceSettings:
        folder = self._foundation.settings.camera_dir
        return SourceSettings(
            camera=camera,
            uri=uri,
            latency_s=latency_s,
            folder=None if folder is None else str(folder),
            user="" if account is None else account.user,
            password="" if account is None else account.password,
        )
