"""What everybody sees in a robot's 3D view."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Self

from db.record import same
from server.base.view import View, one_of
from server.scene.past import PastKnowledge
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
class PastMapView(View):
    """The map that a past view shows: as it was kept last before its moment."""

    variable: str
    model: str
    kept_at: datetime
    samples: int


@dataclass(frozen=True, slots=True)
class PastViewView(View):
    """What the 3D view of a robot at a moment shows, and how old each part was then."""

    robot: str
    at: datetime
    measured_at: datetime | None
    """Of the pose that is drawn: the newest that had arrived; ``null`` where none had."""
    received_at: datetime | None
    """When it had arrived."""
    plan: str | None
    """Plan that was proved to be on board."""
    plan_state: Annotated[str, one_of("on_board", "running")] | None
    map: PastMapView | None
    """``null`` where none had been kept of its deployment."""
    track_points: int

    @classmethod
    def of(cls, known: PastKnowledge) -> Self:
        """Return what is known of a past view as it is told."""
        state, shown = known.state, known.maps[0] if known.maps else None
        kept_at = None if shown is None else shown.updated_at
        return cls(
            robot=known.robot,
            at=known.at,
            measured_at=None if state is None else state.measured_at,
            received_at=None if state is None else state.received_at,
            plan=None if known.plan is None else known.plan.plan_id,
            plan_state=None if known.plan is None else known.plan.state,
            map=None
            if shown is None or kept_at is None
            else PastMapView(
                shown.variable.key, shown.model, kept_at, sum(shown.samples_per_level)
            ),
            track_points=len(known.track.measured_at),
        )
