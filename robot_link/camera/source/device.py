"""A webcam at this machine, by Video4Linux; its driver tells when a picture was taken."""

import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from robot_link.camera.picture import Content
from robot_link.camera.sighting import SourceSettings
from robot_link.camera.source.frame import Frame, Frames, SourceError, arrived
from robot_link.camera.uri import DeviceUri

_MJPG: Final = cv2.VideoWriter.fourcc(*"MJPG")
_BY_HAND, _BY_ITSELF = 1, 3
"""Video4Linux's words for exposure."""
_EXPOSURE_UNIT_S: Final = 1e-4
_BUFFERS: Final = 2
_LATEST_S: Final = 1.0
"""A driver's time that is longer ago, or ahead, is no time of this picture."""


def device_frames(uri: DeviceUri, settings: SourceSettings) -> Frames:
    """Return the pictures of a webcam as they come, as JPEGs where it makes them itself."""
    latency_s = uri.latency_s if settings.latency_s is None else settings.latency_s
    try:
        path = uri.path()
    except ValueError as error:
        raise SourceError(str(error)) from None
    if not path.exists():
        raise SourceError(f"there is no {path}: is the camera plugged in?")
    if not os.access(path, os.R_OK | os.W_OK):
        raise SourceError(f"this account may not use {path}: add it to the group video")
    with _opened(path, uri) as camera:
        is_jpeg = int(camera.get(cv2.CAP_PROP_FOURCC)) == _MJPG
        camera.set(cv2.CAP_PROP_CONVERT_RGB, 0.0 if is_jpeg else 1.0)
        while True:
            is_there, array = camera.read()
            if not is_there:
                raise SourceError(f"{path} gives no more pictures: was the camera unplugged?")
            content: Content = np.asarray(array).tobytes() if is_jpeg else np.asarray(array)
            yield _timed(content, camera.get(cv2.CAP_PROP_POS_MSEC) / 1e3, latency_s)


def _timed(content: Content, driver_s: float, latency_s: float) -> Frame:
    """Return a picture with the driver's time, if that is one of now by the monotonic clock."""
    frame = arrived(content, latency_s)
    age_s = time.clock_gettime(time.CLOCK_MONOTONIC) - driver_s
    if not 0.0 <= age_s <= _LATEST_S:
        return frame
    return Frame(content, frame.arrived_at - timedelta(seconds=age_s), frame.arrived_at)


@contextmanager
def _opened(path: Path, uri: DeviceUri) -> Generator[cv2.VideoCapture]:
    camera = cv2.VideoCapture(_number(path), cv2.CAP_V4L2)
    try:
        if not camera.isOpened():
            raise SourceError(f"{path} cannot be opened: another program may have it")
        width, height = uri.size
        exposure_s = uri.exposure_s
        for name, value in (
            (cv2.CAP_PROP_FOURCC, _MJPG),
            (cv2.CAP_PROP_FRAME_WIDTH, width),
            (cv2.CAP_PROP_FRAME_HEIGHT, height),
            (cv2.CAP_PROP_FPS, uri.fps),
            (cv2.CAP_PROP_BUFFERSIZE, _BUFFERS),
            (cv2.CAP_PROP_AUTO_EXPOSURE, _BY_ITSELF if exposure_s is None else _BY_HAND),
        ):
            camera.set(name, float(value))
        if exposure_s is not None:
            camera.set(cv2.CAP_PROP_EXPOSURE, exposure_s / _EXPOSURE_UNIT_S)
        yield camera
    finally:
        camera.release()


def _number(path: Path) -> int:
    return int(path.name.removeprefix("video"))
