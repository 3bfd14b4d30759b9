"""What everybody sees in a robot's 3D view."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Self

from db.record import same
from server.base.view import View, one_of
from server.scene.replay_source import Moment
from webui.scene.view import SceneState


@dataclass(frozen=True, slots=True)
class SceneModelView(View):
    """A model that has a map."""

    key: str
    title: str


@dataclass(frozen=True, slots=True)
class SceneLayerView(View):
    """A part of the scene that can be switched off."""

    key: str
    title: str
    visible: bool
    has_content: bool
    """Whether there is anything to show now."""


@dataclass(frozen=True, slots=True)
class SceneColoursView(View):
    """What the colours of the map stand for, from the first to the last."""

    low: float
    high: float
    """Values of the ends, in the scale that the map has."""
    unit: str
    is_log: bool
    """Whether those are natural logarithms, or deviations of such."""
    colour_map: Annotated[str, one_of("viridis", "cividis", "magma")]


@dataclass(frozen=True, slots=True)
class SceneStateView(View):
    """Switches and sliders of a 3D view."""

    quantity: Annotated[str, one_of("mean", "std")]
    """``mean`` or ``std``."""
    form: Annotated[str, one_of("volume", "slices")]
    """``volume`` or ``slices``."""
    model: str
    """Model whose map is drawn; empty before there is one."""
    models: list[SceneModelView]
    slice_depth: float | None
    """Where a slice lies, as a share of the map's extent; ``null``: it is not drawn."""
    slice_north: float | None
    slice_east: float | None
    opacity: float
    exaggeration: float
    """Depth is drawn this many times as deep as it is."""
    exaggeration_max: float
    layers: list[SceneLayerView]
    legend: str
    """What the colours of the map mean, with numbers and unit."""
    colours: SceneColoursView | None
    """``null`` while no map is drawn."""
    target_legend: str
    """What the marks of the target mean; empty while there is nothing to show of one."""

    @classmethod
    def of(cls, state: SceneState) -> Self:
        """Return a scene's state as it is told."""
        return cls(
            quantity=state.quantity,
            form=state.form,
            model=state.model,
            models=[SceneModelView(key, title) for key, title in state.models],
            slice_depth=state.slice_depth,
            slice_north=state.slice_north,
            slice_east=state.slice_east,
            opacity=state.opacity,
            exaggeration=state.exaggeration,
            exaggeration_max=state.exaggeration_max,
            layers=[
                SceneLayerView(layer.key, layer.title, layer.visible, layer.has_content)
                for layer in state.layers
            ],
            legend=state.legend,
            colours=state.colours and same(SceneColoursView, state.colours),
            target_legend=state.target_legend,
        )


@dataclass(frozen=True, slots=True)
class ReplayViewView(View):
    """What the 3D view of a replay shows of a moment."""

    robot: str
    at: datetime
    clock: Annotated[str, one_of("measured", "received")]
    measured_at: datetime | None
    """Of the pose that is drawn; ``null`` where none is."""
    plan: str | None
    """Plan that was proved to be on board."""
    map_kept_at: datetime | None
    """When the map was kept that is drawn; ``null`` where none had been of its deployment."""

    @classmethod
    def of(cls, robot: str, moment: Moment) -> Self:
        """Return what is drawn as it is told."""
        return cls(
            robot=robot,
            at=moment.at,
            clock=moment.clock,
            measured_at=None if moment.pose is None else moment.pose.measured_at,
            plan=None if moment.plan is None else moment.plan.plan_id,
            map_kept_at=moment.maps[0].updated_at if moment.maps else None,
        )
