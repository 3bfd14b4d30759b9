"""A field map as arrays."""

from dataclasses import dataclass
from datetime import datetime

from server.service.view.base import View
from server.service.view.mission import ScoresView


@dataclass(frozen=True, slots=True)
class AxesView(View):
    """Coordinates of the grid in the site's frame."""

    x_m: list[float]
    y_m: list[float]
    z_m: list[float]


@dataclass(frozen=True, slots=True)
class SampleCountView(View):
    """Samples behind a map."""

    total: int
    per_fidelity: list[int]
    """By fidelity level, worst located first."""


@dataclass(frozen=True, slots=True)
class FieldMapView(View):
    """Mean and standard deviation of a field on a regular grid."""

    robot: str
    variable: str
    title: str
    unit: str
    scale: str
    """``log``: mean and std are those of the natural logarithm of the value."""
    model: str
    axes: AxesView
    mean: list[float]
    """``nx * ny * nz`` values, x slowest, z fastest."""
    std: list[float]
    samples: SampleCountView
    updated_at: datetime | None
    scores: ScoresView | None


@dataclass(frozen=True, slots=True)
class MapEntryView(View):
    """One map that can be asked for."""

    variable: str
    title: str
    unit: str
    models: list[str]
    """The default first."""
    samples: int
    updated_at: datetime | None
