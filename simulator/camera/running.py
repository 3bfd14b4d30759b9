"""Cameras over the simulated tank, as long as the simulator runs."""

import logging
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

from simulator.camera.fault import TANK_NAME, faulty_camera, faulty_tank
from simulator.camera.laboratory import tank_robots, true_scene
from simulator.camera.stream import CameraServer
from simulator.camera.tank import EmulatedTank
from simulator.fault_desk import FaultDesk
from simulator.settings import SimulatorSettings

FPS = 5.0
"""Pictures a second of each camera: enough to follow a robot, and half the work of a webcam's."""

_log = logging.getLogger(__name__)


@asynccontextmanager
async def emulated_cameras(
    settings: SimulatorSettings, desk: FaultDesk
) -> AsyncGenerator[EmulatedTank]:
    """Serve the cameras of the settings as long as the context lasts; give their tank.

    Raises:
        CameraExtraMissingError: If OpenCV is not installed.
        OSError: If the port is taken.
    """
    scene = true_scene(tank_robots(settings.robots), settings.cameras, settings.seed)
    tank = EmulatedTank(scene, settings.clock())
    desk.meet_other(TANK_NAME, faulty_tank(tank))
    for camera in scene.cameras:
        desk.meet_other(camera.name, faulty_camera(tank, camera.name))
    async with CameraServer(tank, fps=FPS).serve(settings.camera_port or 0) as url:
        for camera in scene.cameras:
            _log.info("camera %s at %s/camera/%s", camera.name, url, camera.name)
        yield tank
