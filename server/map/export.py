"""Writes a map to files that other programs read."""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from autonomy.field.scale import from_model
from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from webui.scene.source import MapView

ORDER = "x slowest, z fastest"
"""How the values of a grid follow each other."""


@dataclass(frozen=True, slots=True)
class MapExport:
    """A map with everything that must travel with it."""

    robot: str
    site: Site
    view: MapView
    config_version: str | None
    """Version of the field's settings, with the kernels; ``None`` of a recording."""
    smoothed: int
    """How many of the samples a fix located better after their dive."""
    is_simulation: bool

    @property
    def samples(self) -> int:
        """How many samples are behind the map."""
        return sum(self.view.samples_per_level)

    @property
    def value_unit(self) -> str:
        """Unit of mean and standard deviation."""
        variable = self.view.variable
        return f"ln({variable.unit})" if variable.scale == "log" else variable.unit

    def name(self, ending: str) -> str:
        """Return a file's name, which says it when nothing of the map is real."""
        mark = "_SIMULATION" if self.is_simulation else ""
        return f"{self.robot}_{self.view.variable.key}_{self.view.model}{mark}.{ending}"


def archive(export: MapExport) -> bytes:
    """Return a numpy archive: axes, ``mean``, ``std``, ``mask``, and what is known of them."""
    view = export.view
    packed = io.BytesIO()
    facts: dict[str, Any] = {k: np.array(_told(value)) for k, value in _facts(export).items()}
    np.savez_compressed(
        packed,
        x_m=view.x_m,
        y_m=view.y_m,
        z_m=view.z_m,
        mean=view.mean,
        std=view.std,
        mask=np.isfinite(view.mean),
        shape=np.array(view.mean.shape),
        simulation=np.array(export.is_simulation),
        **facts,
    )
    return packed.getvalue()


def table(export: MapExport) -> str:
    """Return one row for each grid point in the water, after comments that explain them."""
    view, site = export.view, export.site
    unit, scale = view.variable.unit, export.value_unit
    written = io.StringIO()
    if export.is_simulation:
        written.write("# SIMULATION: this was computed, not measured\n")
    for name, value in _facts(export).items():
        written.write(f"# {name}: {_told(value)}\n")
    rows = csv.writer(written, lineterminator="\n")
    rows.writerow(
        [
            "north [m]",
            "east [m]",
            "depth [m]",
            "latitude [deg]",
            "longitude [deg]",
            f"median [{unit}]" if view.variable.scale == "log" else f"value [{unit}]",
            f"mean [{scale}]",
            f"std [{scale}]",
        ]
    )
    points = np.stack(np.meshgrid(view.x_m, view.y_m, view.z_m, indexing="ij"), axis=-1)
    points = points.reshape(-1, 3)
    mean, std = view.mean.ravel(), view.std.ravel()
    wet = np.isfinite(mean)
    places = wgs84_from_ned(points[wet, :2], site.origin_latitude_deg, site.origin_longitude_deg)
    values = from_model(view.variable.scale, mean[wet])
    for point, place, value, one_mean, one_std in zip(
        points[wet].tolist(),
        places.tolist(),
        values.tolist(),
        mean[wet].tolist(),
        std[wet].tolist(),
        strict=True,
    ):
        numbers = [f"{one:.3f}" for one in point] + [f"{one:.8f}" for one in place[:2]]
        rows.writerow([*numbers, *(f"{one:.6g}" for one in (value, one_mean, one_std))])
    return written.getvalue()


def _facts(export: MapExport) -> Mapping[str, Any]:
    view = export.view
    return {
        "robot": export.robot,
        "site": export.site.name,
        "variable": view.variable.key,
        "title": view.variable.title,
        "standard_name": view.variable.standard_name,
        "derived": view.variable.is_derived,
        "unit": view.variable.unit,
        "scale": view.variable.scale,
        "value_unit": export.value_unit,
        "order": ORDER,
        "model": view.model,
        "config_version": export.config_version,
        "samples": export.samples,
        "samples_per_fidelity": list(view.samples_per_level),
        "smoothed_samples": export.smoothed,
        "updated_at": view.updated_at,
        "origin_latitude_deg": export.site.origin_latitude_deg,
        "origin_longitude_deg": export.site.origin_longitude_deg,
    }


def _told(value: object) -> Any:  # noqa: ANN401 - what numpy and a comment can hold
    if isinstance(value, datetime):
        return value.isoformat()
    return "" if value is None else value
