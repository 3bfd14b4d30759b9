"""Field maps and their comparisons as the database keeps them, and back."""

import io
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from datetime import datetime
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.variable import VARIABLES
from db.column import microseconds
from db.query.comparisons import ComparisonRecord
from db.query.maps import MapRecord
from server.map.field_model import MODEL_TITLES
from server.survey.view import ScoresView
from webui.scene.source import MapView

_SCORES = tuple(field.name for field in fields(ScoresView))


@dataclass(frozen=True, slots=True)
class Comparison:
    """Four models on the same samples."""

    compared_at: datetime
    basis: str
    """Name of what the maps are made of (``server.map.site_map.basis_of``)."""
    samples: int
    against: str | None
    """``truth`` or ``held-out samples``; ``None`` where nothing could be scored."""
    message: str
    """What to know of the scores, one sentence or "" """
    models: tuple[Mapping[str, Any], ...]
    """Key and scores of each model; a score is ``None`` where there is none."""
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
            "axes": _axes(view),
            "samples_per_level": list(view.samples_per_level),
            "scores": None if scores is None else asdict(scores),
        },
        grid=_packed({"mean": view.mean, "std": view.std}),
    )


def view_of(record: MapRecord) -> MapView:
    """Return a kept map as arrays."""
    arrays = _unpacked(record.grid)
    return _view(
        record.document,
        record.variable,
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


def comparison_record(robot: str, variable: str, comparison: Comparison) -> ComparisonRecord:
    """Return a comparison as the database keeps it; the arrays lose what float32 cannot hold."""
    arrays: dict[str, FloatArray] = {}
    first = next(iter(comparison.views.values()))
    for (_, model), view in comparison.views.items():
        arrays |= {f"{model}.mean": view.mean, f"{model}.std": view.std}
    return ComparisonRecord(
        robot=robot,
        variable=variable,
        at=comparison.compared_at,
        document={
            "axes": _axes(first),
            "basis": comparison.basis,
            "samples": comparison.samples,
            "samples_per_level": list(first.samples_per_level),
            "updated_at": None if first.updated_at is None else first.updated_at.isoformat(),
            "scale": first.variable.scale,
            "against": comparison.against,
            "message": comparison.message,
            "models": [dict(one) for one in comparison.models],
        },
        grid=_packed(arrays),
    )


def comparison_of(record: ComparisonRecord) -> Comparison:
    """Return a kept comparison."""
    document, arrays = record.document, _unpacked(record.grid)
    updated_at = document["updated_at"]
    models = tuple(document["models"])
    return Comparison(
        compared_at=record.at,
        basis=document["basis"],
        samples=document["samples"],
        against=document["against"],
        message=document["message"],
        models=models,
        views={
            (record.variable, one["model"]): _view(
                document,
                record.variable,
                one["model"],
                arrays[f"{one['model']}.mean"],
                arrays[f"{one['model']}.std"],
                samples_per_level=tuple(document["samples_per_level"]),
                version=microseconds(record.at),
                updated_at=None if updated_at is None else datetime.fromisoformat(updated_at),
            )
            for one in models
            if f"{one['model']}.mean" in arrays
        },
    )


def _axes(view: MapView) -> dict[str, list[float]]:
    return {"x_m": view.x_m.tolist(), "y_m": view.y_m.tolist(), "z_m": view.z_m.tolist()}


def _view(
    document: Mapping[str, Any],
    variable: str,
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
    known = VARIABLES[variable]
    return MapView(
        variable=replace(known, scale=document.get("scale", known.scale)),
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
