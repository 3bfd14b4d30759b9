"""The emulated tank while it runs: who swims in it, what is wrong with it, and what cameras see."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime

import numpy as np

from autonomy.vision.camera import Camera
from autonomy.vision.lens import Lens
from autonomy.vision.rigid import Pose, rotation_of
from robot_link.clock import Clock
from simulator.camera.body import board_middle_m
from simulator.camera.scene import Motion, Scene
from simulator.robot import SimulatedBody

BOARD_VIEWS = 30
"""Different poses in which a board is held; then they begin anew."""
BOARD_HOLD_S = 2.0
"""How long it is held still in each, by the clock."""
_MOST_TILT_DEG, _MOST_TURN_DEG = 40.0, 20.0
_NEAREST_M, _FARTHEST_M = 0.45, 0.9
_LONGEST_AHEAD_S = 0.5


@dataclass(frozen=True, slots=True)
class CameraTrouble:
    """What was done to one camera."""

    shift_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """About its own axes."""
    is_frozen: bool = False
    """It sends the same picture again and again."""
    is_cut: bool = False
    """It hangs up, and takes no call."""
    is_silent: bool = False
    """It takes calls and says nothing."""
    board_since: datetime | None = None
    """From when on somebody holds the board in front of it."""


NO_TROUBLE = CameraTrouble()


@dataclass(frozen=True, slots=True, eq=False)
class Exposure:
    """All that one picture is drawn from."""

    scene: Scene
    camera: Camera
    """As it hangs now."""
    at: datetime
    """The middle of the exposure, by the clock."""
    robots: Mapping[str, Motion]
    board: Pose | None
    """Takes the axes of a board that is held in front of the camera into the camera's."""


@dataclass(slots=True, eq=False)
class _Swimmer:
    body: SimulatedBody
    born: datetime


@dataclass(slots=True, eq=False)
class EmulatedTank:
    """Knows the truth of one tank. Belongs to one event loop.

    ``scene`` may be replaced as time goes on: by another level, by ripples, by other light.
    """

    scene: Scene
    clock: Clock
    """The robots' time."""
    _swimmers: dict[str, _Swimmer] = field(default_factory=dict[str, _Swimmer])
    _troubles: dict[str, CameraTrouble] = field(default_factory=dict[str, CameraTrouble])
    _boards: dict[str, tuple[Pose, ...]] = field(default_factory=dict[str, tuple[Pose, ...]])

    def meet(self, robot: str, body: SimulatedBody, born: datetime) -> None:
        """Take a robot that lives from a time on, by the clock."""
        self._swimmers[robot] = _Swimmer(body, born)

    def trouble(self, camera: str) -> CameraTrouble:
        """Return what was done to a camera."""
        return self._troubles.get(camera, NO_TROUBLE)

    def trouble_with(self, camera: str, **changes: object) -> None:
        """Do something to a camera, or undo it: fields of ``CameraTrouble``.

        Raises:
            KeyError: If there is no camera of this name.
        """
        self.scene.camera(camera)
        self._troubles[camera] = replace(self.trouble(camera), **changes)  # pyright: ignore[reportArgumentType] - names and values are the dataclass's

    def set_water(
        self, *, level_m: float | None = None, ripple_slope_rad: float | None = None
    ) -> None:
        """Let the water have another mean level or other ripples.

        Raises:
            ValueError: If the tank cannot have it.
        """
        changes = {"level_m": level_m, "ripple_slope_rad": ripple_slope_rad}
        told = {name: value for name, value in changes.items() if value is not None}
        self.scene = replace(self.scene, **told)

    def set_brightness(self, brightness: float) -> None:
        """Let the light be so many times the usual; 0 is darkness."""
        lighting = replace(self.scene.lighting, brightness=brightness)
        self.scene = replace(self.scene, lighting=lighting)

    def exposure(self, camera: str) -> Exposure:
        """Return what a picture that is taken now is drawn from.

        Raises:
            KeyError: If there is no camera of this name.
        """
        hung, trouble, now = self.scene.camera(camera), self.trouble(camera), self.clock.now()
        turn = np.radians(trouble.turn_deg)
        pose = hung.pose.moved(np.array(trouble.shift_ned_m), turn)
        motions = {name: _motion(one, now) for name, one in self._swimmers.items()}
        return Exposure(
            self.scene, replace(hung, pose=pose), now, motions, self._board(hung, trouble, now)
        )

    def _board(self, camera: Camera, trouble: CameraTrouble, now: datetime) -> Pose | None:
        if trouble.board_since is None:
            return None
        poses = self._boards.get(camera.name)
        if poses is None:
            rng = np.random.default_rng([self.scene.seed, 13, *camera.name.encode()])
            poses = self._boards[camera.name] = board_poses(camera.lens, rng)
        held_s = (now - trouble.board_since).total_seconds()
        return poses[math.floor(held_s / BOARD_HOLD_S) % len(poses)]


def board_poses(lens: Lens, rng: np.random.Generator, count: int = BOARD_VIEWS) -> tuple[Pose, ...]:
    """Return poses of a board in front of a lens, in camera axes: everywhere, near and tilted.

    Args:
        lens: Of the camera.
        rng: Draws them.
        count: How many.
    """
    middle = board_middle_m()
    poses: list[Pose] = []
    for i in range(count):
        across, down = (i % 4 + 0.5) / 4.0, (i // 4 % 3 + 0.5) / 3.0  # one part after the other
        pixel = np.array([across * lens.width_px, down * lens.height_px])
        ray = lens.rays(pixel + rng.uniform(-60.0, 60.0, 2))
        axis = rng.normal(size=2)
        tilt = np.radians(rng.uniform(15.0, _MOST_TILT_DEG)) * axis / np.linalg.norm(axis)
        turn = np.radians(rng.uniform(-_MOST_TURN_DEG, _MOST_TURN_DEG))
        rotation = rotation_of(np.append(tilt, 0.0)) @ rotation_of(np.array([0.0, 0.0, turn]))
        place = ray * rng.uniform(_NEAREST_M, _FARTHEST_M)
        poses.append(Pose(rotation, place - rotation @ middle))
    return tuple(poses)


def _motion(swimmer: _Swimmer, now: datetime) -> Motion:
    """Return how a robot moves now, a part of a step after the state that it has."""
    plant = swimmer.body.plant
    ahead_s = (now - swimmer.born).total_seconds() - plant.time_s
    state = plant.state
    pose = Pose.of_angles(state[:3], *state[3:6].tolist())
    motion = Motion(pose, plant.velocity_ned_m_s, state[9:12].copy())
    pose = motion.after(min(max(ahead_s, 0.0), _LONGEST_AHEAD_S))
    return replace(motion, pose=pose)
