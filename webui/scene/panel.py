"""Switches and sliders of the view; everybody who looks at a robot shares them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import viser

from webui.scene.field_map import AXES, FORMS, QUANTITIES, FieldMap
from webui.scene.view import LayerState, SceneChange, SceneState

WATER = "Frame the water"
WHAT_IF = "Frame the what-if"
_NO_MODEL = "no map yet"
_SHORTEST_RANGE = 40.0
"""The vertical exaggeration can be raised at least this far."""


_Control: TypeAlias = (
    viser.GuiCheckboxHandle
    | viser.GuiButtonHandle
    | viser.GuiSliderHandle[Any]
    | viser.GuiDropdownHandle[Any]
)


class Layer(Protocol):
    """A part of the scene that can be switched off."""

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        ...

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        ...

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        ...


@dataclass(frozen=True, slots=True)
class LayerEntry:
    """A layer with the name that operators know it by."""

    title: str
    layer: Layer


class Panel:
    """viser's own panel, folded away until somebody wants it, holds what is chosen.

    The operator app shows the same choices beside the view and changes them by ``change``.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        field_map: FieldMap,
        layers: Mapping[str, LayerEntry],
        exaggeration: float,
        views: Mapping[str, Callable[[viser.ClientHandle], None]],
        target_legend: Callable[[], str],
    ) -> None:
        gui.set_panel_label("Layers")
        self._map = field_map
        self._target_legend = target_legend
        self._layers = layers
        self._boxes = {key: _layer_box(gui, entry) for key, entry in layers.items()}
        self._quantity = gui.add_dropdown("Quantity", QUANTITIES)
        self._form = gui.add_dropdown("Form", FORMS)
        self._model: viser.GuiDropdownHandle[str] = gui.add_dropdown(
            "Model", [_NO_MODEL], visible=False
        )
        self._cuts = {
            axis: (
                gui.add_checkbox(f"Slice {axis}", axis in field_map.slices),
                gui.add_slider(f"At {axis}", 0.0, 1.0, 0.02, field_map.slices.get(axis, 0.5)),
            )
            for axis in AXES
        }
        self._opacity = gui.add_slider("Opacity", 0.02, 1.0, 0.02, field_map.opacity)
        self._exaggeration_max = max(_SHORTEST_RANGE, 2 * exaggeration)
        self._exaggeration = gui.add_slider(
            "Vertical x", 1.0, self._exaggeration_max, 0.5, exaggeration
        )
        self._views = {label: _view(gui, label, look) for label, look in views.items()}
        self.offer(WHAT_IF, False)
        controls: list[_Control] = [
            *self._boxes.values(),
            *self._views.values(),
            *(control for cut in self._cuts.values() for control in cut),
            *(self._quantity, self._form, self._model, self._opacity, self._exaggeration),
        ]
        self._by_id = {_id(handle): handle for handle in controls}
        self._legend = gui.add_markdown("")
        gui.main_panel.minimize()

    def offer(self, view: str, offered: bool) -> None:
        """Show or hide the button of a view."""
        self._views[view].visible = offered

    def accepts(self, control: str, value: object) -> bool:
        """Tell whether a control of this id may take a value that a browser chose."""
        handle = self._by_id.get(control)
        if handle is None or not handle.visible:
            return False
        match handle:
            case viser.GuiSliderHandle():
                return (
                    isinstance(value, int | float)
                    and not isinstance(value, bool)
                    and handle.min <= value <= handle.max
                )
            case viser.GuiDropdownHandle():
                return value in handle.options
            case _:
                return isinstance(value, bool)

    @property
    def exaggeration(self) -> float:
        """Return the vertical exaggeration asked for."""
        return float(self._exaggeration.value)

    def apply(self) -> None:
        """Hand what is chosen to the map, and show the legends; a single model is no choice."""
        self._offer_models()
        self._map.quantity = self._quantity.value
        self._map.form = self._form.value
        self._map.model = self._chosen_model()
        self._map.slices = {
            axis: float(place.value) for axis, (box, place) in self._cuts.items() if box.value
        }
        self._map.opacity = float(self._opacity.value)
        legend = "\n\n".join(filter(None, (self._map.legend, self._target_legend())))
        if self._legend.content != legend:
            self._legend.content = legend

    def state(self) -> SceneState:
        """Return what is chosen now."""
        cuts = {
            axis: place.value if box.value else None for axis, (box, place) in self._cuts.items()
        }
        return SceneState(
            quantity="mean" if self._quantity.value == QUANTITIES[0] else "std",
            form="volume" if self._form.value == FORMS[0] else "slices",
            model=self._chosen_model(),
            models=tuple(self._map.models.items()),
            slice_depth=cuts["depth"],
            slice_north=cuts["north"],
            slice_east=cuts["east"],
            opacity=float(self._opacity.value),
            exaggeration=self.exaggeration,
            exaggeration_max=self._exaggeration_max,
            layers=tuple(
                LayerState(key, entry.title, entry.layer.visible, entry.layer.has_content)
                for key, entry in self._layers.items()
            ),
            legend=self._map.legend,
            colours=self._map.colours if self._map.visible else None,
            target_legend=self._target_legend(),
        )

    def change(self, change: SceneChange) -> None:
        """Choose something else; a model or layer that is not there changes nothing."""
        if "quantity" in change:
            self._quantity.value = QUANTITIES[0 if change["quantity"] == "mean" else 1]
        if "form" in change:
            self._form.value = FORMS[0 if change["form"] == "volume" else 1]
        title = self._map.models.get(change.get("model", ""))
        if title is not None:
            self._offer_models()
            self._model.value = title
        for axis in AXES:
            self._change_cut(axis, change)
        if "opacity" in change:
            self._opacity.value = change["opacity"]
        if "exaggeration" in change:
            self._exaggeration.value = min(change["exaggeration"], self._exaggeration_max)
        for key, visible in change.get("layers", {}).items():
            if key in self._layers:
                self._boxes[key].value = visible
                self._layers[key].layer.show(visible)

    def _change_cut(self, axis: str, change: SceneChange) -> None:
        key = f"slice_{axis}"
        if key not in change:
            return
        share: float | None = change[key]  # type: ignore[literal-required]
        box, place = self._cuts[axis]
        box.value = share is not None
        if share is not None:
            place.value = share

    def _offer_models(self) -> None:
        titles = tuple(self._map.models.values())
        if titles and tuple(self._model.options) != titles:
            self._model.options = titles
        is_choice = len(titles) > 1
        if self._model.visible != is_choice:
            self._model.visible = is_choice

    def _chosen_model(self) -> str:
        for model, title in self._map.models.items():
            if title == self._model.value:
                return model
        return next(iter(self._map.models), "")


def _id(handle: _Control) -> str:
    return handle._impl.uuid  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]


def _layer_box(gui: viser.GuiApi, entry: LayerEntry) -> viser.GuiCheckboxHandle:
    box = gui.add_checkbox(entry.title, entry.layer.visible)
    box.on_update(lambda event: entry.layer.show(event.target.value))
    return box


def _view(
    gui: viser.GuiApi, label: str, look: Callable[[viser.ClientHandle], None]
) -> viser.GuiButtonHandle:
    button = gui.add_button(label, hint="Moves your camera only")

    @button.on_click
    def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        if event.client is not None:
            look(event.client)

    return button
