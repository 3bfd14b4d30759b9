"""What everybody sees in a robot's 3D view: read and changed by the operator app."""

from dataclasses import dataclass
from typing import Literal, TypedDict


@dataclass(frozen=True, slots=True)
class LayerState:
    """A part of the scene that can be switched off."""

    key: str
    title: str
    visible: bool
    has_content: bool
    """Whether there is anything to show now."""


@dataclass(frozen=True, slots=True)
class ColourScale:
    """What the colours of the map stand for, from the first to the last."""

    low: float
    high: float
    """Values of the ends, in the scale that the map has."""
    unit: str
    is_log: bool
    """Whether those are natural logarithms, or deviations of such."""
    colour_map: str
    """Name of the colours."""


@dataclass(frozen=True, slots=True)
class SceneState:
    """The view's switches and sliders; slices lie at shares of the map's extent."""

    quantity: Literal["mean", "std"]
    form: Literal["volume", "slices"]
    model: str
    """Key of the model whose map is drawn; empty before there is one."""
    models: tuple[tuple[str, str], ...]
    """Key and title of every model that has a map, the default first."""
    slice_depth: float | None
    slice_north: float | None
    slice_east: float | None
    opacity: float
    exaggeration: float
    exaggeration_max: float
    layers: tuple[LayerState, ...]
    legend: str
    """What the colours of the map mean, with numbers and unit."""
    colours: ColourScale | None
    """``None`` while no map is drawn."""
    target_legend: str
    """What the marks of the target mean; empty while there is nothing to show of one."""


class SceneChange(TypedDict, total=False):
    """What is to be different; whatever is left out stays."""

    quantity: Literal["mean", "std"]
    form: Literal["volume", "slices"]
    model: str
    slice_depth: float | None
    slice_north: float | None
    slice_east: float | None
    opacity: float
    exaggeration: float
    layers: dict[str, bool]
