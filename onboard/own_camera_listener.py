"""The robot finds itself by its own camera: what the camera's node sees becomes fixes."""

import asyncio
import re
from collections import Counter
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any, Protocol

import numpy as np

from autonomy.vision.corner import corner_sigma_px
from autonomy.vision.fix import Fix, NoFix, Sighting, Telemetry
from autonomy.vision.onboard.own_fix import CAMERA, find_self
from autonomy.vision.quality import judge
from autonomy.warm_up import OWN_CAMERA, compile_step
from onboard.flight.navigation import Estimate
from onboard.log import OnboardLog
from onboard.node.camera import STATE, TAGS
from onboard.node.client import NodeClient
from onboard.own_camera_file import OwnCameraSetup
from robot_link.camera.received_fix import AGE_MAX_S, ReceivedFix

_TAGS_MAX = 200
_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?")
_BLUR_PX = 0.8
"""Of a camera that does not tell the noise of its corners."""


class Finder(Protocol):
    """The onboard program, as far as it is concerned."""

    @property
    def now(self) -> datetime:
        """The robot's clock."""
        ...

    @property
    def estimate(self) -> Estimate:
        """What the robot believes of itself."""
        ...

    def hear_own_fix(self, fix: ReceivedFix) -> None:
        """Take a fix of the robot's own camera."""
        ...


class OwnCameraListener:
    """Solves each picture for the robot's pose, with the tilt and depth of its own sensors.

    Args:
        program: Who wants the fixes.
        node: The camera's node, which somebody else runs.
        setup: The camera, and the tank that it looks at.
        time_at: The robot's time at a count of its counter.
        log: The robot's own log, which is told what is wrong when that changes.
    """

    def __init__(
        self,
        program: Finder,
        node: NodeClient,
        setup: OwnCameraSetup,
        time_at: Callable[[float], datetime],
        log: OnboardLog,
    ) -> None:
        self._program = program
        self._setup = setup
        self._time_at = time_at
        self._log = log
        self._tags = node.subscribe(TAGS)
        self._state = node.subscribe(STATE)
        self._told = ""
        self.refused: Counter[str] = Counter()
        """Pictures without a fix, by the reason without its numbers."""

    async def run(self) -> None:
        """Listen until cancelled, from when the kernels are there: flying waits for no compiler."""
        for step in OWN_CAMERA:
            await asyncio.to_thread(compile_step, step)
        async for said in self._tags:
            self.take(said)

    async def watch(self) -> None:
        """Write down what the camera's node says of itself, until cancelled."""
        async for said in self._state:
            self._log.note(f"own camera: {said.get('words') or 'sees again'}")

    def take(self, said: Mapping[str, Any]) -> None:
        """Take one picture's tags as the node told them."""
        try:
            sightings, taken_at = _sightings(said), self._time_at(float(said["count_s"]))
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            self._refuse(f"what the node says cannot be read: {error}")
            return
        if not sightings:
            return
        age_s = (self._program.now - taken_at).total_seconds()
        if age_s > AGE_MAX_S:  # to find itself takes time that the robot needs for flying
            self._refuse(f"the picture is {age_s:.1f} s old; it may be {AGE_MAX_S:g} s")
            return
        setup = self._setup
        found = find_self(
            setup.camera, setup.layout, setup.water, sightings, telemetry=self._telemetry(age_s)
        )
        if isinstance(found, NoFix):
            self._refuse(found.reason)
            return
        verdict = judge(found)
        if verdict.quality == "refused":
            self._refuse(verdict.reason)
            return
        try:
            fix = _received(found, taken_at, has_tilt=verdict.quality == "good")
        except ValueError as error:
            self._refuse(str(error))
            return
        self._told = ""
        self._program.hear_own_fix(fix)

    def _telemetry(self, age_s: float) -> Telemetry:
        """Return the tilt and depth of the robot's own sensors so long ago."""
        estimate = self._program.estimate
        readings = estimate.readings
        depth_m = readings.depth_m - estimate.velocity_ned[2] * age_s
        return Telemetry.of_tilt(readings.roll_rad, readings.pitch_rad, depth_m)

    def _refuse(self, reason: str) -> None:
        """Count a picture that gives no fix; the log hears of a kind of reason that is new."""
        kind = _NUMBER.sub("..", reason)
        if kind != self._told:
            self._log.note(f"own camera: no fix: {reason}")
        self.refused[kind] += 1
        self._told = kind


def _sightings(said: Mapping[str, Any]) -> list[Sighting]:
    """Return what a node says that it sees.

    Raises:
        KeyError: If a field is missing.
        TypeError: If a field is of another type.
        ValueError: If a field cannot be.
    """
    tags = list(said["tags"])
    if len(tags) > _TAGS_MAX:
        raise ValueError(f"more than {_TAGS_MAX} tags in one picture")
    seen: list[Sighting] = []
    for tag in tags:
        corners = np.array(tag["corners_px"], dtype=np.float64)
        if corners.shape != (4, 2):
            raise ValueError("corners_px are not four pixels")
        sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        usual = corner_sigma_px(float(sides.mean()), _BLUR_PX)
        seen.append(Sighting(CAMERA, int(tag["id"]), corners, float(tag.get("sigma_px", usual))))
    return seen


def _received(found: Fix, taken_at: datetime, *, has_tilt: bool) -> ReceivedFix:
    """Return a fix as the navigator takes it.

    Raises:
        ValueError: If it is known too badly to be one.
    """
    north, east, depth = found.position_ned_m.tolist()
    variance = found.position_covariance
    roll, pitch, heading = found.pose.angles_rad
    roll_std, pitch_std, heading_std = found.angle_stds_rad
    return ReceivedFix(
        measured_at=taken_at,
        ned_m=(north, east, depth),
        covariance_ne_m2=(float(variance[0, 0]), float(variance[0, 1]), float(variance[1, 1])),
        depth_variance_m2=float(variance[2, 2]),
        heading_rad=heading if has_tilt else None,
        heading_std_rad=heading_std,
        roll_rad=roll if has_tilt else None,
        pitch_rad=pitch if has_tilt else None,
        tilt_std_rad=max(roll_std, pitch_std),
        rms=found.rms,
        cameras=1,
        tags=len(found.tags),
    )
