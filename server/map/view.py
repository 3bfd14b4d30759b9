"""A field map as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from autonomy.field.learned import LearnedKernels
from autonomy.result import Result
from server.base.view import View, one_of


@dataclass(frozen=True, slots=True)
class ScoresView(View):
    """A map held against the truth of the simulated field."""

    model: str
    title: str
    rmse: float
    nlpd: float
    """Negative log predictive density per point."""
    wmse: float
    """Weighted mean squared error: 1 where the model's uncertainty is right."""
    coverage_90: float
    """Share of the truth inside the 90 % interval."""
    samples: int


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
    scale: Annotated[str, one_of("linear", "log")]
    """``log``: mean and std are those of the natural logarithm of the value."""
    value_unit: str
    """Unit of mean and std: that of the variable, or of its logarithm."""
    colour_map: Annotated[str, one_of("viridis", "cividis", "magma")]
    """Of the mean, as the catalogue of channels has it."""
    is_derived: bool
    """Whether the variable was computed ashore of what robots measured."""
    model: str
    site: str
    origin_latitude_deg: float
    """Where north and east are 0."""
    origin_longitude_deg: float
    axes: AxesView
    shape: list[int]
    """``nx, ny, nz``."""
    order: str
    """How the values of ``mean`` follow each other in that shape."""
    mean: Sequence[float | None]
    """``nx * ny * nz`` values, x slowest, z fastest; ``null`` where there is no water."""
    std: Sequence[float | None]
    mask: list[bool] | None
    """Where there is water, in the order of ``mean``; ``null`` where all of it is water."""
    samples: SampleCountView
    smoothed_samples: int
    """Samples that were located better by the fix at the end of their dive."""
    models: list[str]
    """Models that can be asked for: the live one, then those of the newest comparison."""
    config_version: str | None
    """Version of the field's settings that the live map is made with; ``null`` of a recording."""
    carriage: Annotated[str, one_of("still", "water")]
    """``water``: samples were carried along to where their water is now."""
    water_moved: str
    """How far the water moved while the map was made, a sentence, or that samples are not carried
    though they are to be; empty where that is not known, or too little to misplace anything."""
    simulation: bool
    """Whether the station runs a simulation."""
    updated_at: datetime | None
    """Of the newest sample behind the map."""
    scores: ScoresView | None
    threshold: float | None = None
    """What the robot's settings hold the map against, in ``unit``."""


@dataclass(frozen=True, slots=True)
class MapChoiceView(View):
    """A channel that robots of a water have told or announced, and that can be mapped."""

    variable: str
    title: str
    unit: str
    samples: int
    is_derived: bool
    """Whether it is computed ashore of what they measured."""
    is_chosen: bool
    """Whether the map is of it now."""


@dataclass(frozen=True, slots=True)
class ShareAboveView(View):
    """How much of the water a field is above a value in."""

    robot: str
    variable: str
    unit: str
    above: float
    """The value, in ``unit``."""
    low: float
    """In 5 % of the fields that agree with the map no larger share of the water is above it."""
    high: float
    """The same of 95 %."""
    draws: int
    """How many such fields were drawn."""
    points: int
    """At how many points of the water, evenly spread over the domain."""
    updated_at: datetime | None
    """Of the newest sample behind the map that they were drawn from."""


@dataclass(frozen=True, slots=True)
class MapEntryView(View):
    """One map that can be asked for."""

    variable: str
    title: str
    unit: str
    models: list[str]
    """The default first."""
    titles: dict[str, str]
    """What each model is called."""
    samples: int
    updated_at: datetime | None


class ComparedModelScores(Result):
    """How well one field model explains what is known."""

    model: str
    rmse: float | None = None
    """Root mean square error in the model's scale; ``null`` with the others where nothing could be
    scored."""
    nlpd: float | None = None
    """Negative log predictive density per point; lower is better."""
    wmse: float | None = None
    """Weighted mean squared error: 1 where the model's uncertainty is right."""
    coverage: float | None = None
    """Share inside the central 90 % interval: 0.9 where the model's uncertainty is right."""
    log_marginal_likelihood: float
    """Log density of the samples under the model."""


class ComparedModelView(ComparedModelScores):
    """One field model in a comparison."""

    title: str
    is_default: bool
    """Whether it is the model of the live map."""


class ComparedSamples(Result):
    """On what field models were compared."""

    samples: int = 0
    against: str | None = None
    """``truth`` of a simulated field, or ``held-out samples`` of whole dives, where cameras saw the
    robot at the places that they tell."""
    message: str = ""
    """Why there are no scores, if there are none."""


class KeptComparison(ComparedSamples):
    """A comparison as the database keeps it, beside its maps."""

    basis: str
    """Name of what the maps are made of (``server.map.site_map.basis_of``)."""
    models: list[ComparedModelScores]
    axes: AxesView
    samples_per_level: list[int]
    updated_at: datetime | None
    scale: str


class MapComparisonView(ComparedSamples):
    """All field models on the same samples."""

    state: Annotated[str, one_of("none", "working", "ready")]
    """``none``, ``working`` or ``ready``; while one works, the rest is the one before."""
    job: str | None
    """The job that works."""
    compared_at: datetime | None
    is_outdated: bool
    """Whether samples came, moved or settings changed since."""
    models: list[ComparedModelView]


class ComparedView(Result):
    """What the job of a comparison leaves."""

    variable: str
    samples: int
    against: str | None


class LearnedView(LearnedKernels):
    """What the job of learning leaves."""

    variable: str
    samples: int
    config: str | None
    """Version of the field's settings with what was learned; null if nothing was better."""
