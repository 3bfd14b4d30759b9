"""Field maps and their comparisons as the database keeps them, and back."""

import io
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.channel import Channel
from db.column import microseconds
from db.query.measured.maps import MapRecord
from db.query.mission import studies as query
from server.map.field_model import MODEL_TITLES
from server.map.view import KeptComparison, ScoresView
from webui.scene.source import MapView

_COMPARISON = "comparison"
"""Kind of the studies that comparisons are."""
_SCORES = tuple(field.name for field in fields(ScoresView))


@dataclass(frozen=True, slots=True)
class Comparison:
    """Four models on the same samples."""

    compared_at: datetime
    found: KeptComparison
    views: Mapping[tuple[str, str], MapView]
    """By variable and model."""


def record_of(robot: str, view: MapView, scores: ScoresView | None, at: datetime) -> MapRecord:
    """Return a map as the database keeps it; the arrays lose what float32 cannot hold."""
    return MapRecord(
        robot=robot,
        variable=view.variable.key,
        model=view.model,
        at=at,
        samples=sum(view.samples_per_level),
        document={
            "axes": axes_of(view),
            "samples_per_level": list(view.samples_per_level),
            "scores": None if scores is None else asdict(scores),
        },
        grid=_packed({"mean": view.mean, "std": view.std}),
    )


def view_of(record: MapRecord, channel: Channel) -> MapView:
    """Return a kept map as arrays."""
    arrays = _unpacked(record.grid)
    return _view(
        record.document,
        channel,
        record.model,
        arrays["mean"],
        arrays["std"],
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


def comparison_arrays(comparison: Comparison) -> bytes:
    """Return the maps of a comparison packed; they lose what float32 cannot hold."""
    arrays: dict[str, FloatArray] = {}
    for (_, model), view in comparison.views.items():
        arrays |= {f"{model}.mean": view.mean, f"{model}.std": view.std}
    return _packed(arrays)


def keep_comparison(
    session: Session, robot: str, variable: str, comparison: Comparison, arrays: bytes, by: str
) -> None:
    """Keep a comparison in the place of the one before.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    query.replace_study(
        session,
        _COMPARISON,
        robot,
        asked={"variable": variable},
        result=comparison.found.model_dump(mode="json"),
        arrays=arrays,
        at=comparison.compared_at,
        by=by,
    )


def newest_comparison(
    session: Session, robots: Iterable[str], channel: Channel
) -> Comparison | None:
    """Return the newest comparison of a channel that was kept for any of some robots."""
    kept = (
        record
        for record in query.newest_studies(session, _COMPARISON, list(robots))
        if record.asked["variable"] == channel.key
    )
    newest = next(kept, None)
    if newest is None:
        return None
    record = query.get_study(session, _COMPARISON, newest.id)
    packed = query.get_arrays(session, _COMPARISON, newest.id)
    found = KeptComparison.model_validate(record.result)
    return _comparison_of(record.created_at, channel, found, _unpacked(packed or b""))


def _comparison_of(
    compared_at: datetime, channel: Channel, found: KeptComparison, arrays: Mapping[str, FloatArray]
) -> Comparison:
    document = found.model_dump()
    return Comparison(
        compared_at,
        found,
        views={
            (channel.key, one.model): _view(
                document,
                channel,
                one.model,
                arrays[f"{one.model}.mean"],
                arrays[f"{one.model}.std"],
                samples_per_level=tuple(found.samples_per_level),
                version=microseconds(compared_at),
                updated_at=found.updated_at,
            )
            for one in found.models
            if f"{one.model}.mean" in arrays
        },
    )


def axes_of(view: MapView) -> dict[str, list[float]]:
    """Return the coordinates of a map's grid."""
    return {"x_m": view.x_m.tolist(), "y_m": view.y_m.tolist(), "z_m": view.z_m.tolist()}


def _view(
    document: Mapping[str, Any],
    channel: Channel,
    model: str,
    mean: FloatArray,
    std: FloatArray,
    *,
    samples_per_level: tuple[int, ...],
    version: int,
    updated_at: datetime | None,
) -> MapView:
    x_m, y_m, z_m = (np.array(document["axes"][name]) for name in ("x_m", "y_m", "z_m"))
    shape = (len(x_m), len(y_m), len(z_m))
    return MapView(
        variable=replace(channel, scale=document.get("scale", channel.scale)),
        model=model,
        title=MODEL_TITLES.get(model, model),
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        mean=mean.reshape(shape),
        std=std.reshape(shape),
        samples_per_level=samples_per_level,
        version=version,
        updated_at=updated_at,
    )


def _packed(arrays: Mapping[str, FloatArray]) -> bytes:
    packed = io.BytesIO()
    narrow: dict[str, Any] = {name: one.astype(np.float32) for name, one in arrays.items()}
    np.savez_compressed(packed, **narrow)
    return packed.getvalue()


def _unpacked(grid: bytes) -> dict[str, FloatArray]:
    with np.load(io.BytesIO(grid), allow_pickle=False) as arrays:
        return {name: arrays[name].astype(np.float64) for name in arrays.files}
