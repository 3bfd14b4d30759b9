"""Layer switches of the view; everybody who looks at a robot shares them."""

from collections.abc import Callable, Mapping
from typing import Protocol

import viser

from webui.scene.field_map import FORMS, QUANTITIES, FieldMap

_MODEL_TITLES = {"recursive": "three fidelities", "single": "one fidelity"}


WATER = "Frame the water"
WHAT_IF = "Frame the what-if"


class Layer(Protocol):
    """A part of the scene that can be switched off."""

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        ...

    def show(self, visible: bool) -> None:
        """Show or hide all of it."""
        ...


class Panel:
    """viser's own panel, folded away until somebody wants it."""

    def __init__(
        self,
        gui: viser.GuiApi,
        field_map: FieldMap,
        layers: Mapping[str, Layer],
        exaggeration: float,
        views: Mapping[str, Callable[[viser.ClientHandle], None]],
    ) -> None:
        gui.set_panel_label("Layers")
        self._map = field_map
        for label, layer in layers.items():
            box = gui.add_checkbox(label, layer.visible)
            box.on_update(lambda event, layer=layer: layer.show(event.target.value))
        self._quantity = gui.add_dropdown("Quantity", QUANTITIES)
        self._form = gui.add_dropdown("Form", FORMS)
        self._model = gui.add_dropdown("Model", tuple(_MODEL_TITLES.values()))
        self._slice = gui.add_slider("Slice depth", 0.0, 1.0, 0.02, field_map.slice_share)
        self._opacity = gui.add_slider("Opacity", 0.02, 1.0, 0.02, field_map.opacity)
        self._exaggeration = gui.add_slider(
            "Vertical x", 1.0, max(40.0, 2 * exaggeration), 0.5, exaggeration
        )
        self._views = {label: self._view(gui, label, look) for label, look in views.items()}
        self.offer(WHAT_IF, False)
        self._legend = gui.add_markdown("")
        gui.main_panel.minimize()

    def offer(self, view: str, offered: bool) -> None:
        """Show or hide the button of a view."""
        self._views[view].visible = offered

    def _view(
        self, gui: viser.GuiApi, label: str, look: Callable[[viser.ClientHandle], None]
    ) -> viser.GuiButtonHandle:
        button = gui.add_button(label, hint="Moves your camera only")

        @button.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is not None:
                look(event.client)

        return button

    @property
    def exaggeration(self) -> float:
        """Return the vertical exaggeration asked for."""
        return float(self._exaggeration.value)

    def apply(self) -> None:
        """Hand what is chosen to the map, and show its legend; a single model is no choice."""
        self._map.quantity = self._quantity.value
        self._map.form = self._form.value
        is_choice = len(self._map.models) > 1
        if self._model.visible != is_choice:
            self._model.visible = is_choice
        titles = {title: model for model, title in _MODEL_TITLES.items()}
        self._map.model = titles[self._model.value]
        self._map.slice_share = float(self._slice.value)
        self._map.opacity = float(self._opacity.value)
        if self._legend.content != self._map.legend:
            self._legend.content = self._map.legend
