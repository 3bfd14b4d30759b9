r"""Follows robots from pictures to pictures: one fix of each robot from what cameras saw together.

Pictures that belong together were taken within some 60 ms. Each is predicted at its own time
with the velocity of the robot's filter, which holds its place and velocity, driven by white
acceleration. The filter averages noise alone; what does not average out is kept beside it and added
whenever something is claimed.

A robot is known by the ids of its tags and by nothing else, so robots that cross are not swapped.
Nothing here has a memory: tracks come in and go out.

Source:
    Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
    section 6.2.2 (nearly constant velocity).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.constants import TELEMETRY_S
from autonomy.vision.corner import area_px2, mean_side_px
from autonomy.vision.fix import (
    DEPTH_STD_M,
    TILT_STD_RAD,
    VELOCITY_STD_M_S,
    Fix,
    NoFix,
    Sighting,
    Telemetry,
    find_robot,
)
from autonomy.vision.quality import USUAL_GATES, Expectation, Gates, Verdict, Water, judge
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import sights
from autonomy.vision.tag import Bundle, Registry

ACCELERATION_M2_S3 = 0.02
"""Spectral density of the acceleration, per axis: after 1 s without a fix a place is known to 8 cm,
a velocity to 0.14 m/s."""
UNKNOWN_VELOCITY_STD_M_S = 0.3
"""Of a robot that is found anew, per axis."""
FORGET_S = 5.0
"""A robot that was not found for so long is sought as if it had never been."""
REGION_S = 2.0
"""For so long after its last fix the place of a robot in a picture is predicted."""
MARGIN_PX = 30.0
TURN_STD_RAD_S = math.radians(5.0)
"""By how much a robot's tilt may have changed since it told it."""
ROBOTS_MAX, TAGS_MAX = 20, 200
_NEVER_S = -math.inf

Standing = Literal["found", "lost", "unseen"]
"""``lost`` is a robot that cameras should see and do not; ``unseen`` is out of every picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """The tags that one camera saw in one picture."""

    camera: str
    taken_s: float
    """On any clock that is the same for all cameras."""
    sightings: tuple[Sighting, ...]


@dataclass(frozen=True, slots=True)
class Said:
    """What a robot says of itself, and how long before the pictures it was so."""

    age_s: float
    roll_rad: float | None = None
    pitch_rad: float | None = None
    depth_m: float | None = None
    """Below the surface, by its pressure sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Where a robot is and how it moves, as far as cameras know. Immutable."""

    fixed_s: float
    """When it was found last."""
    rotation: FloatArray
    """Of its body axes in NED at that moment, shape ``(3, 3)``."""
    state: FloatArray
    """North, east, depth below the surface (m) and velocity (m/s) then, shape ``(6,)``."""
    noise: FloatArray
    """Covariance of the state as far as it averages out, shape ``(6, 6)``."""
    considered: FloatArray
    """Of the place: what does not, shape ``(3, 3)``, m^2."""
    surprises: int = 0
    """Fixes in a row that were refused as too far from where it should be."""
    standing: Standing = "found"

    @property
    def velocity_ned_m_s(self) -> FloatArray:
        """Shape ``(3,)``."""
        return self.state[3:]

    @property
    def velocity_std_m_s(self) -> float:
        """How well the velocity is known, along its worst axis; never better than is plausible."""
        return max(VELOCITY_STD_M_S, math.sqrt(float(np.linalg.eigvalsh(self.noise[3:, 3:])[-1])))

    @property
    def position_covariance(self) -> FloatArray:
        """Of the place, never less than what does not average out, shape ``(3, 3)``, m^2."""
        return self.noise[:3, :3] + self.considered

    @classmethod
    def begun(cls, fix: Fix, at_s: float) -> "Track":
        """Return the track of a robot that is found for the first time."""
        noise = np.zeros((6, 6))
        noise[:3, :3] = fix.noise_covariance[:3, :3]
        noise[3:, 3:] = UNKNOWN_VELOCITY_STD_M_S**2 * np.eye(3)
        state = np.append(fix.position_ned_m, np.zeros(3))
        return cls(at_s, fix.pose.rotation, state, noise, fix.considered_covariance[:3, :3])

    def at(self, at_s: float) -> "Track":
        """Return the prediction for a moment that is not earlier; its last fix stays the same."""
        dt = max(at_s - self.fixed_s, 0.0)
        move, shaken = np.eye(6), np.zeros((6, 6))
        move[:3, 3:] = dt * np.eye(3)
        for rows, columns, share in (
            (slice(3), slice(3), dt**3 / 3.0),
            (slice(3), slice(3, 6), dt**2 / 2.0),
            (slice(3, 6), slice(3), dt**2 / 2.0),
            (slice(3, 6), slice(3, 6), dt),
        ):
            shaken[rows, columns] = share * ACCELERATION_M2_S3 * np.eye(3)
        noise = move @ self.noise @ move.T + shaken
        return replace(self, state=move @ self.state, noise=noise)

    def updated(self, fix: Fix, at_s: float) -> "Track":
        """Return the prediction ``self`` after a fix of its moment, by that fix's noise alone."""
        S = self.noise[:3, :3] + fix.noise_covariance[:3, :3]
        K = np.linalg.solve(S, self.noise[:3]).T  # (6, 3)
        state = self.state + K @ (fix.position_ned_m - self.state[:3])
        rest = np.eye(6)
        rest[:, :3] -= K
        noise = rest @ self.noise @ rest.T + K @ fix.noise_covariance[:3, :3] @ K.T
        return Track(at_s, fix.pose.rotation, state, noise, fix.considered_covariance[:3, :3])

    def pose(self, level_m: float) -> Pose:
        """Return its pose in the tank, whose nominal level is 0."""
        return Pose(self.rotation, self.state[:3] + np.array([0.0, 0.0, level_m]))


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What became of one robot in one set of pictures."""

    robot: str
    at_s: float
    """Moment of the fix: the middle of those at which it was seen."""
    fix: Fix | None
    """None where no pose explains what was seen."""
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Region:
    """Where a robot's tags are expected in a picture, margins included, px."""

    left: int
    top: int
    right: int
    bottom: int


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """What one set of pictures says."""

    tracks: Mapping[str, Track]
    found: tuple[Found, ...] = ()
    left_out: tuple[str, ...] = ()
    """Robots that were seen and not sought, for there are too many; the farthest."""


def follow(
    tracks: Mapping[str, Track],
    pictures: Sequence[Picture],
    rig: Rig,
    registry: Registry,
    *,
    waters: Mapping[str, Water] | None = None,
    said: Mapping[str, Said] | None = None,
    gates: Gates = USUAL_GATES,
) -> Followed:
    """Find every robot that a set of pictures shows.

    Args:
        tracks: Of robots that were found before.
        pictures: Of one moment, at most one of each camera.
        rig: Calibrated cameras and the water; pictures of others are passed over.
        registry: Which tags belong to whom.
        waters: Of robots of which it is known, the water outside of which they cannot be.
        said: What robots say of themselves.
        gates: From where on a fix is refused.
    """
    seen = _by_robot(pictures, registry)
    nearest = sorted(seen, key=lambda robot: _area_px2(seen[robot]), reverse=True)
    sought = _within_limits(nearest, seen)
    new, found = dict(tracks), list[Found]()
    for bundle in registry.bundles:
        if bundle.robot not in sought:
            continue
        track = new.get(bundle.robot)
        one, later = _follow_one(
            track,
            bundle,
            seen[bundle.robot],
            rig,
            (waters or {}).get(bundle.robot),
            (said or {}).get(bundle.robot),
            gates,
        )
        found.extend([] if one is None else [one])
        if later is not None:
            new[bundle.robot] = later
    at_s = max((picture.taken_s for picture in pictures), default=_NEVER_S)
    good = {one.robot for one in found if one.verdict.quality != "refused"}
    for bundle in registry.bundles:
        track = new.get(bundle.robot)
        if track is not None and bundle.robot not in good:
            new[bundle.robot] = _missed(track, bundle, rig, at_s)
    left_out = tuple(robot for robot in nearest if robot not in sought)
    return Followed(new, tuple(found), left_out)


def regions(
    tracks: Mapping[str, Track], rig: Rig, registry: Registry, at_s: float
) -> dict[str, tuple[Region, ...]]:
    """Return where each camera should look for robots that were found lately.

    A camera that should see none of them has no regions, and seeks everywhere.
    """
    found: dict[str, list[Region]] = {camera.name: [] for camera in rig.cameras}
    for bundle in registry.bundles:
        track = tracks.get(bundle.robot)
        if track is None or at_s - track.fixed_s > REGION_S:
            continue
        pose = track.at(at_s).pose(rig.level_m)
        for camera in rig.cameras:
            region = _region(camera, bundle, pose, rig)
            found[camera.name].extend([] if region is None else [region])
    return {camera: tuple(places) for camera, places in found.items()}


def telemetry_of(said: Said | None, track: Track | None) -> Telemetry | None:
    """Return what a robot says as rows for the search, surely enough for its age.

    Its depth is brought to the moment of the pictures with the velocity that cameras saw.
    """
    if said is None or not 0.0 <= said.age_s <= TELEMETRY_S:
        return None
    depth_std = math.hypot(DEPTH_STD_M, said.age_s * VELOCITY_STD_M_S)
    depth_m = said.depth_m
    if track is not None and depth_m is not None:
        depth_std = math.hypot(DEPTH_STD_M, said.age_s * track.velocity_std_m_s)
        depth_m += said.age_s * float(track.velocity_ned_m_s[2])
    tilt_std = math.hypot(TILT_STD_RAD, said.age_s * TURN_STD_RAD_S)
    down = None
    if said.roll_rad is not None and said.pitch_rad is not None:
        down = Telemetry.of_tilt(said.roll_rad, said.pitch_rad).down
    if down is None and depth_m is None:
        return None
    return Telemetry(down, depth_m, tilt_std, depth_std)


Seen = tuple[float, Sighting]
"""A tag in a picture, and when that was taken."""


def _by_robot(pictures: Sequence[Picture], registry: Registry) -> dict[str, list[Seen]]:
    seen: dict[str, list[Seen]] = {}
    for picture in pictures:
        for sighting in picture.sightings:
            bundle = registry.robot_of(sighting.tag_id)
            if bundle is not None:
                seen.setdefault(bundle.robot, []).append((picture.taken_s, sighting))
    return seen


def _area_px2(seen: Sequence[Seen]) -> float:
    areas = [area_px2(sighting.corners_px) for _, sighting in seen]
    return max((area for area in areas if math.isfinite(area)), default=0.0)


def _within_limits(nearest: Sequence[str], seen: Mapping[str, Sequence[Seen]]) -> set[str]:
    sought, tags = set[str](), 0
    for robot in nearest[:ROBOTS_MAX]:
        tags += len(seen[robot])
        if tags > TAGS_MAX:
            break
        sought.add(robot)
    return sought


def _follow_one(
    track: Track | None,
    bundle: Bundle,
    seen: Sequence[Seen],
    rig: Rig,
    water: Water | None,
    said: Said | None,
    gates: Gates,
) -> tuple[Found | None, Track | None]:
    at_s = sum(taken_s for taken_s, _ in seen) / len(seen)
    if track is not None and not track.fixed_s < at_s:
        return None, track
    if track is not None and at_s - track.fixed_s > FORGET_S:
        track = None
    expected = None if track is None else track.at(at_s)
    velocity, velocity_std = np.zeros(3), UNKNOWN_VELOCITY_STD_M_S
    if expected is not None:
        velocity, velocity_std = expected.velocity_ned_m_s, expected.velocity_std_m_s
    fix = find_robot(
        rig,
        bundle.tags,
        [_at(at_s, taken_s, sighting, bundle, velocity_std) for taken_s, sighting in seen],
        guess=None if expected is None else expected.pose(rig.level_m),
        velocity_ned_m_s=velocity,
        velocity_std_m_s=velocity_std,
        telemetry=telemetry_of(said, expected),
    )
    if isinstance(fix, NoFix):
        return Found(bundle.robot, at_s, None, Verdict("refused", fix.reason)), track
    hope = None
    if expected is not None:
        hope = Expectation(expected.state[:3], expected.position_covariance, expected.surprises)
    verdict = judge(fix, hope, water, gates)
    found = Found(bundle.robot, at_s, fix, verdict)
    if verdict.quality == "refused":
        if track is not None:
            surprises = track.surprises + 1 if verdict.is_surprise else 0
            track = replace(track, surprises=surprises)
        return found, track
    if expected is None or expected.surprises + 1 >= gates.patience:
        return found, Track.begun(fix, at_s)
    return found, expected.updated(fix, at_s)


def _at(
    at_s: float, taken_s: float, sighting: Sighting, bundle: Bundle, velocity_std_m_s: float
) -> Sighting:
    """Return a sighting with its distance in time, and with the noise that this is worth.

    As long as a velocity is not known as well as in a steady glide, pictures of different moments
    do not fit together to a tenth of a pixel.
    """
    tag, after_s = bundle.tag(sighting.tag_id), taken_s - at_s
    if tag is None:
        return sighting
    excess = math.sqrt(max(velocity_std_m_s**2 - VELOCITY_STD_M_S**2, 0.0))
    moved_px = abs(after_s) * excess * mean_side_px(sighting.corners_px) / tag.size_m
    return replace(sighting, after_s=after_s, sigma_px=math.hypot(sighting.sigma_px, moved_px))


def _missed(track: Track, bundle: Bundle, rig: Rig, at_s: float) -> Track:
    """Return a track that was not fixed, with what that means; known while it is predicted."""
    if at_s - track.fixed_s > FORGET_S:
        return track
    pose = track.at(at_s).pose(rig.level_m)
    is_in_view = any(_region(camera, bundle, pose, rig) is not None for camera in rig.cameras)
    return replace(track, standing="lost" if is_in_view else "unseen")


def _region(camera: Camera, bundle: Bundle, pose: Pose, rig: Rig) -> Region | None:
    """Return where a camera should see a robot, if it should see any of its tags whole."""
    numbers = np.zeros(len(bundle.tags), dtype=np.int64)
    corners = np.array([tag.corners_m for tag in bundle.tags])
    poses = [pose] * len(bundle.tags)
    seen = sights(camera.packed[None], numbers, poses, corners, rig.level_m, rig.index).pixels
    shown = [
        pixels
        for pixels in seen
        if np.isfinite(pixels).all() and camera.lens.shows(pixels).all() and area_px2(pixels) > 0.0
    ]
    if not shown:
        return None
    low = np.floor(np.min(shown, axis=(0, 1)) - MARGIN_PX).astype(int).tolist()
    high = np.ceil(np.max(shown, axis=(0, 1)) + MARGIN_PX).astype(int).tolist()
    return Region(
        max(low[0], 0),
        max(low[1], 0),
        min(high[0], camera.lens.width_px - 1),
        min(high[1], camera.lens.height_px - 1),
    )
