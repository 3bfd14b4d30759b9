"""A robot that dives below cameras: what it thinks of its place, from drawn pictures on board.

Laboratories are drawn when this runs and calibrated by their own drawn pictures. A Miniglider's
onboard program and body are stepped; five times a second three cameras take a picture of it, which
is compressed, searched and followed as the station does. Fixes go through ``GRACE_FIX`` and arrive
80 to 200 ms late, 2 % never. The robot has no other sensor that tells its place.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Registry
from autonomy.vision.tracker import Found, Said
from benchmarks.vision.picture import ROBOT, laboratory
from robot_link.camera.fix import CameraFix
from robot_link.camera.received_fix import ReceivedFix
from robot_link.mavlink.dialect import grace
from robot_link.mavlink.fix import fix_message, received_fix
from robot_link.messages import RobotId, SystemId
from simulator.camera.laboratory import told_bundles, told_layout
from simulator.camera.scene import Motion
from simulator.fleet import MINI_1
from simulator.robot import SimulatedRobot
from tests.onboard.camera_fixes import Road, SeenLife
from tests.simulator.camera.eyes import Eyes
from tests.simulator.flight import mission, two_dives

DIVES = 3
BAR_M = 0.02
SHALLOW_M = 0.05
"""As delivered: deeper than this a Miniglider takes no fix."""
DEEP_M = 0.2
_SYSTEM = SystemId(1)


@dataclass
class DrawnRoad(Road):
    """The way of fixes that cameras really find in drawn pictures."""

    eyes: Eyes = field(kw_only=True)
    off_m: list[FloatArray] = field(default_factory=list[FloatArray])
    """Of each fix from the truth, down by the depth below the surface."""

    def see(self, robot: SimulatedRobot) -> None:
        plant, program = robot.body.plant, robot.program
        state = plant.state
        level = self.eyes.scene.level_m
        surface = np.array([0.0, 0.0, level])
        pose = Pose.of_angles(state[:3] + surface, *state[3:6].tolist())
        motion = Motion(pose, plant.velocity_ned_m_s, state[9:12].copy())
        told = program.estimate
        said = {ROBOT: Said(0.1, float(told.state[3]), told.pitch_rad, told.depth_m)}
        for found in self.eyes.look(program.time_s, {ROBOT: motion}, said).found:
            fix = _told(found, robot)
            if fix is None:
                continue
            self.off_m.append(np.array(fix.ned_m) - state[:3])
            if self.generator.random() >= self.loss:
                late_s = self.generator.uniform(*self.delay_s)
                self._on_the_way.append((program.time_s + late_s, _by_radio(fix)))


def _told(found: Found, robot: SimulatedRobot) -> CameraFix | None:
    fix, quality = found.fix, found.verdict.quality
    if fix is None or quality == "refused":
        return None
    is_sure = quality == "good"
    roll, pitch, heading = fix.pose.angles_rad
    roll_std, pitch_std, heading_std = fix.angle_stds_rad
    north, east, depth = fix.position_ned_m.tolist()
    whole, part = fix.position_covariance, fix.considered_covariance
    return CameraFix(
        robot=RobotId(ROBOT),
        measured_at=robot.program.now,
        ned_m=(north, east, depth),
        covariance_m2=_triangle(whole),
        considered_covariance_m2=_triangle(part),
        heading_rad=heading if is_sure else None,
        heading_std_rad=heading_std,
        roll_rad=roll if is_sure else None,
        pitch_rad=pitch if is_sure else None,
        tilt_std_rad=max(roll_std, pitch_std),
        cameras=fix.cameras,
        tags=fix.tags,
        rms=fix.rms,
        quality=quality,
        reason="",
        calibration=None,
    )


def _triangle(matrix: FloatArray) -> tuple[float, float, float, float, float, float]:
    xx, xy, xz, yy, yz, zz = (float(matrix[i, j]) for i in range(3) for j in range(i, 3))
    return xx, xy, xz, yy, yz, zz


def _by_radio(fix: CameraFix) -> ReceivedFix:
    """Return a fix as it comes out of the frame in which it was sent."""
    codec = grace.MAVLink(None)
    frame = fix_message(fix, _SYSTEM, 0.0).pack(codec)
    message = codec.decode(bytearray(frame))
    if not isinstance(message, grace.MAVLink_grace_fix_message):
        raise TypeError(f"{message} came instead of a fix")
    return received_fix(message)


@dataclass(frozen=True)
class Dive:
    track: FloatArray
    fixes_off_m: FloatArray

    @property
    def off_m(self) -> FloatArray:
        return np.hypot(self.track[:, 1] - self.track[:, 5], self.track[:, 2] - self.track[:, 6])

    @property
    def nees(self) -> float:
        return float(np.mean(self.off_m**2 / self.track[:, 4] ** 2))


def dive(eyes: Eyes, seed: int, surface_depth_m: float) -> Dive:
    road = DrawnRoad(np.random.default_rng([seed, 7]), eyes=eyes)
    life = SeenLife(MINI_1.fixed_by_cameras(surface_depth_m), seed, road)
    life.live(10.0)
    road.off_m.clear()
    track = life.fly(mission(*two_dives()))
    return Dive(track, np.array(road.off_m))


def measure() -> list[dict[str, Any]]:
    seed = int(np.random.default_rng().integers(2**31))
    registry = Registry(told_layout(), told_bundles([ROBOT]))
    everywhere: list[Dive] = []
    reckoned: list[Dive] = []
    for i in range(DIVES):
        lab = laboratory(seed + i)
        for depth_m, dives in ((1.2, everywhere), (SHALLOW_M, reckoned)):
            eyes = Eyes(lab.scene, lab.calibration.rig, registry)
            dives.append(dive(eyes, seed + i, depth_m))
    return [*by_fixes(everywhere, seed), *by_reckoning(reckoned)]


def by_fixes(dives: list[Dive], seed: int) -> Iterator[dict[str, Any]]:
    off = np.concatenate([one.off_m for one in dives])
    found = np.linalg.norm(np.vstack([one.fixes_off_m for one in dives]), axis=1)
    yield row(f"Fixes in drawn dives (seed {seed}): 3D mean", 1e3 * found.mean(), "mm")
    yield row("Robot's own estimate by them: p95", 1e3 * np.quantile(off, 0.95), "mm")
    yield row("Robot's own estimate by them: most", 1e3 * off.max(), "mm", 1e3 * BAR_M)
    nees = float(np.mean([one.nees for one in dives]))
    yield row("NEES of it, north and east (2 is exact)", nees, "", 4.0)


def by_reckoning(dives: list[Dive]) -> Iterator[dict[str, Any]]:
    deep = [one.track[:, 7] > DEEP_M for one in dives]
    off = np.concatenate([one.off_m[is_deep] for one, is_deep in zip(dives, deep, strict=True)])
    std = np.concatenate([one.track[is_deep, 4] for one, is_deep in zip(dives, deep, strict=True)])
    yield row("Reckoned below 0.2 m: most it is off", 1e3 * off.max(), "mm")
    yield row("Reckoned below 0.2 m: most it claims, std", 1e3 * std.max(), "mm")


def row(name: str, value: Any, unit: str, bar: float | None = None) -> dict[str, Any]:
    return {
        "area": "camera_dive",
        "name": name,
        "value": float(value),
        "unit": unit,
        "bar": bar,
        "met": None if bar is None else bool(value <= bar),
    }
