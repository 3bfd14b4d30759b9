"""Calibrations as documents that are kept, and back; loads numba, so for worker processes alone."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.calibration.adjustment import Adjustment
from autonomy.vision.calibration.lens_fit import LensCalibration
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.fix import Sighting
from autonomy.vision.lens import Lens
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Layout, layout_of
from robot_link.camera.sighting import Sighting as Seen
from server.camera.used_rig import Document, UsedRig


def lens_document(lens: Lens) -> Document:
    """Return a lens as it is kept."""
    return {
        "kind": lens.kind,
        "width_px": lens.width_px,
        "height_px": lens.height_px,
        "parameters": lens.parameters.tolist(),
    }


def lens_of(document: Document) -> Lens:
    """Return a lens that was kept."""
    return Lens.of_parameters(
        document["kind"],
        document["width_px"],
        document["height_px"],
        np.array(document["parameters"]),
    )


def calibration_document(found: LensCalibration) -> Document:
    """Return what the calibration of a lens found, without its covariance."""
    return {
        "lens": lens_document(found.lens),
        "rms_px": found.rms_px,
        "focal_std_share": found.focal_std_share,
        "views": list(found.views),
        "view_rms_px": list(found.view_rms_px),
    }


def rig_document(
    rig: Rig, keys: Mapping[str, int], layout: Layout, rms: float, tag_rms_px: Mapping[int, float]
) -> Document:
    """Return calibrated cameras as they are kept, without their covariance.

    Args:
        rig: The cameras.
        keys: Of each, its key in the database: a camera of the same name may be another one.
        layout: Tags where they were found.
        rms: Residual, in standard deviations.
        tag_rms_px: Residual of each tag.
    """
    return {
        "cameras": [{"key": keys[one.name], **_camera_document(one)} for one in rig.cameras],
        "level_m": rig.level_m,
        "index": rig.index,
        "tags": layout_document(layout)["tags"],
        "rms": rms,
        "tag_rms_px": {str(tag): px for tag, px in tag_rms_px.items()},
    }


def rig_of(used: UsedRig) -> Rig:
    """Return the cameras that are used, as ``autonomy.vision`` takes them."""
    document = used.result
    cameras = tuple(
        replace(one, latency_std_s=used.latency_std_s.get(one.name, 0.0))
        for one in map(_camera_of, document["cameras"])
    )
    rig = Rig(cameras, document["level_m"], used.covariance, document["index"])
    for camera in cameras:
        if camera.name not in used.cameras:
            rig = rig.without(camera.name)
    if used.level_m != rig.level_m:
        rig = rig.at_new_level(used.level_m, used.level_std_m)
    return replace(rig, ripple_slope_rad=used.ripple_slope_rad)


def layout_document(layout: Layout) -> Document:
    """Return fixed tags as they are kept."""
    return {
        "tags": [{k: v for k, v in asdict(tag).items() if v is not None} for tag in layout.tags]
    }


def found_layout(document: Document) -> Layout:
    """Return the tags of a calibration where it found them."""
    return layout_of({"tags": document["tags"]})


def sightings_document(sightings: Sequence[Sighting]) -> list[Document]:
    """Return sightings as the inputs of a calibration keep them."""
    return [
        {
            "camera": one.camera,
            "tag": one.tag_id,
            "corners_px": np.asarray(one.corners_px).tolist(),
            "sigma_px": one.sigma_px,
        }
        for one in sightings
    ]


def sightings_of(seen: Sequence[Seen]) -> list[Sighting]:
    """Return what pictures show, one sighting for each tag."""
    return [
        Sighting(one.camera, tag.id, np.array(tag.corners_px), tag.sigma_px)
        for one in seen
        for tag in one.tags
    ]


def adjustment_document(found: Adjustment, keys: Mapping[str, int]) -> Document:
    """Return what the joint adjustment found, without its covariance."""
    return rig_document(found.rig, keys, found.layout, found.rms, found.tag_rms_px)


def with_exact(rig: Rig) -> FloatArray:
    """Return the joint covariance of a rig, all zero where it is exact."""
    size = len(rig.root)
    return np.zeros((size, size)) if rig.covariance is None else rig.covariance


def _camera_document(camera: Camera) -> Document:
    return {
        "id": camera.name,
        "lens": lens_document(camera.lens),
        "rotation": camera.pose.rotation.tolist(),
        "position_m": camera.pose.position_m.tolist(),
        "edge_px": camera.edge_px,
        "corner_rays": np.nan_to_num(camera.lens.rays(_corners(camera.lens))).tolist(),
    }


def _camera_of(document: Document) -> Camera:
    pose = Pose(np.array(document["rotation"]), np.array(document["position_m"]))
    return Camera(document["id"], lens_of(document["lens"]), pose, document["edge_px"])


def _corners(lens: Lens) -> FloatArray:
    right, bottom = lens.width_px - 1.0, lens.height_px - 1.0
    return np.array([[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]])
