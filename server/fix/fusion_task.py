"""Finds robots in pictures of one moment; runs in a worker process, where numba is loaded.

The process keeps nothing: tracks come with each call and go back as bytes that the station does
not read. A process that dies takes one moment with it.
"""

import pickle
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import lru_cache

import numpy as np

from autonomy.vision.camera import Rig
from autonomy.vision.fix import Sighting as TagSighting
from autonomy.vision.quality import Gates, Water
from autonomy.vision.tag import Registry
from autonomy.vision.tracker import Found, Picture, Said, Track, follow, regions
from robot_link.camera.config import CameraConfig
from robot_link.camera.fix import CameraFix
from robot_link.camera.sighting import Region
from robot_link.messages import RobotId
from server.camera.vision import rig_of
from server.fix.fusion_call import FoundRobot, FusionAnswer, FusionCall, Pictured

_AHEAD_S = 0.15
"""For when regions are predicted, after the newest picture: the next one of a usual camera."""


def fuse(
    call: FusionCall, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> FusionAnswer:
    """Find the robots that pictures of one moment show."""
    del report, is_cancelled
    rig = _rig(call.rig)
    tracks: Mapping[str, Track] = pickle.loads(call.tracks) if call.tracks else {}
    sought = Registry(
        call.registry.layout,
        tuple(one for one in call.registry.bundles if one.robot in call.robots),
    )
    tracks = {name: track for name, track in tracks.items() if name in call.robots}
    answer = follow(
        tracks,
        [_picture(one) for one in call.pictures],
        rig,
        sought,
        waters={name: Water(*box) for name, box in call.waters.items()},
        said={name: Said(*words) for name, words in call.said.items()},
        gates=_gates(call.config),
    )
    newest_s = max(one.taken_s for one in call.pictures)
    places = regions(answer.tracks, rig, sought, newest_s + _AHEAD_S)
    return FusionAnswer(
        tracks=pickle.dumps(dict(answer.tracks), pickle.HIGHEST_PROTOCOL),
        found=tuple(_found(one, call) for one in answer.found),
        standings={name: track.standing for name, track in answer.tracks.items()},
        regions={
            camera: tuple(Region(one.left, one.top, one.right, one.bottom) for one in found)
            for camera, found in places.items()
        },
        left_out=answer.left_out,
    )


@lru_cache(maxsize=1)
def _rig(used: bytes) -> Rig:
    return rig_of(pickle.loads(used))


def _gates(config: CameraConfig) -> Gates:
    return Gates(
        config.rms_max,
        config.position_std_max_m,
        config.outside_max_m,
        config.jump_max,
        config.jumps_refused,
    )


def _picture(pictured: Pictured) -> Picture:
    seen = tuple(
        TagSighting(pictured.camera, tag.id, np.array(tag.corners_px), tag.sigma_px)
        for tag in pictured.tags
    )
    return Picture(pictured.camera, pictured.taken_s, seen)


def _found(found: Found, call: FusionCall) -> FoundRobot:
    verdict = found.verdict
    if found.fix is None:
        return FoundRobot(found.robot, None, verdict.reason)
    fix, is_sure = found.fix, verdict.quality != "position_only"
    roll, pitch, heading = fix.pose.angles_rad
    roll_std, pitch_std, heading_std = fix.angle_stds_rad
    north, east, depth = fix.position_ned_m.tolist()
    return FoundRobot(
        found.robot,
        CameraFix(
            robot=RobotId(call.robots[found.robot]),
            measured_at=datetime.fromtimestamp(found.at_s, UTC),
            ned_m=(north, east, depth),
            covariance_m2=_triangle(fix.position_covariance),
            considered_covariance_m2=_triangle(fix.considered_covariance),
            heading_rad=heading if is_sure else None,
            heading_std_rad=heading_std,
            roll_rad=roll if is_sure else None,
            pitch_rad=pitch if is_sure else None,
            tilt_std_rad=max(roll_std, pitch_std),
            cameras=fix.cameras,
            tags=fix.tags,
            rms=fix.rms,
            quality=verdict.quality,
            reason=verdict.reason,
            calibration=call.calibration,
        ),
        verdict.reason,
    )


def _triangle(covariance: "np.ndarray") -> tuple[float, float, float, float, float, float]:
    xx, xy, xz, yy, yz, zz = covariance[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]].tolist()
    return xx, xy, xz, yy, yz, zz
