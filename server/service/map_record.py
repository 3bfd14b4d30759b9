"""A field map as the database keeps it, and back."""

import io
from collections.abc import Iterable
from dataclasses import asdict, fields
from datetime import datetime

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.variable import VARIABLES
from db.query.maps import MapRecord
from server.service.view.mission import ScoresView
from webui.scene.source import MapView

_SCORES = tuple(field.name for field in fields(ScoresView))


def record_of(robot: str, view: MapView, scores: ScoresView | None, at: datetime) -> MapRecord:
    """Return a map as the database keeps it; the arrays lose what float32 cannot hold."""
    return MapRecord(
        robot=robot,
        variable=view.variable.key,
        model=view.model,
        at=at,
        samples=sum(view.samples_per_level),
        document={
            "axes": {"x_m": view.x_m.tolist(), "y_m": view.y_m.tolist(), "z_m": view.z_m.tolist()},
            "samples_per_level": list(view.samples_per_level),
            "scores": None if scores is None else asdict(scores),
        },
        grid=_packed(view.mean, view.std),
    )


def view_of(record: MapRecord) -> MapView:
    """Return a kept map as arrays."""
    axes = {name: np.array(values) for name, values in record.document["axes"].items()}
    shape = (len(axes["x_m"]), len(axes["y_m"]), len(axes["z_m"]))
    with np.load(io.BytesIO(record.grid), allow_pickle=False) as arrays:
        mean = arrays["mean"].astype(np.float64).reshape(shape)
        std = arrays["std"].astype(np.float64).reshape(shape)
    return MapView(
        variable=VARIABLES[record.variable],
        model=record.model,
        **axes,
        mean=mean,
        std=std,
        samples_per_level=tuple(record.document.get("samples_per_level", (record.samples,))),
        version=1,
        updated_at=record.at,
    )


def scores_of(records: Iterable[MapRecord]) -> dict[tuple[str, str], ScoresView]:
    """Return the scores that were kept with maps, by variable and model."""
    return {
        (record.variable, record.model): ScoresView(
            **{name: record.document["scores"][name] for name in _SCORES}
        )
        for record in records
        if record.document.get("scores") is not None
    }


def _packed(mean: FloatArray, std: FloatArray) -> bytes:
    packed = io.BytesIO()
    np.savez_compressed(packed, mean=mean.astype(np.float32), std=std.astype(np.float32))
    return packed.getvalue()
