"""Calibrations as documents that are kept, and back."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.calibration.adjustment import Adjustment
from autonomy.vision.calibration.lens_fit import LensCalibration
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.fix import Sighting
from autonomy.vision.lens import Lens
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Layout, layout_of

Document = Mapping[str, Any]
"""A JSON object."""


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


def rig_of(document: Document, covariance: FloatArray, keys: Mapping[str, int]) -> Rig:
    """Return the cameras of a calibration that still are the same ones.

    Args:
        document: As ``rig_document`` made it.
        covariance: Joint covariance of all that were calibrated.
        keys: Of each camera that there is now, its key in the database.
    """
    cameras = tuple(map(_camera_of, document["cameras"]))
    rig = Rig(cameras, document["level_m"], covariance, document["index"])
    for camera in document["cameras"]:
        if keys.get(camera["id"]) != camera["key"]:
            rig = rig.without(camera["id"])
    return rig


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
    }


def _camera_of(document: Document) -> Camera:
    pose = Pose(np.array(document["rotation"]), np.array(document["position_m"]))
    return Camera(document["id"], lens_of(document["lens"]), pose, document["edge_px"])
