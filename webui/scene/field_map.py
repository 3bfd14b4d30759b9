"""The field map as a volume of translucent cells, or one slice of it; opacity follows the value."""

import numpy as np
import numpy.typing as npt
import viser

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from webui.scene.colour import ColourArray, linear, mapped
from webui.scene.source import MapView, SceneSource
from webui.scene.stage import Stage

QUANTITIES = ("mean", "standard deviation")
FORMS = ("volume", "slice")
_COLOUR_MAP = {"mean": "viridis", "standard deviation": "magma"}
_CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                   [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip


class FieldMap:
    """One mesh instance a cell; a new version changes colours and opacities in place."""

    def __init__(self, stage: Stage, source: SceneSource) -> None:
        self._stage = stage
        self._source = source
        self._cells: viser.BatchedMeshHandle | None = None
        self._axes: tuple[FloatArray, FloatArray, FloatArray] | None = None
        self._drawn: tuple[int, str, str, str, float, float] | None = None
        self.quantity = QUANTITIES[0]
        self.form = FORMS[0]
        self.model = ""
        """Wanted model; the source's default where it has no such map."""
        self.models: tuple[str, ...] = ()
        """Models that the source has maps of."""
        self.slice_share = 0.4
        """Depth of the slice as a share of the map's depth."""
        self.opacity = 0.8
        self.visible = True
        self.legend = ""
        """What colours mean now, with numbers and unit."""

    def update(self) -> None:
        """Fetch the newest map and draw what changed."""
        self.models = self._source.maps()
        model = self.model if self.model in self.models else next(iter(self.models), None)
        view = None if model is None else self._source.map_view(model)
        if view is None:
            return
        wanted = (
            view.version,
            view.model,
            self.quantity,
            self.form,
            self.slice_share,
            self.opacity,
        )
        if wanted == self._drawn:
            return
        self._drawn = wanted
        self._draw(view)

    def show(self, visible: bool) -> None:
        """Show or hide the map."""
        self.visible = visible
        if self._cells is not None:
            self._cells.visible = visible

    def _draw(self, view: MapView) -> None:
        values = view.mean if self.quantity == "mean" else view.std
        low, high = float(values.min()), float(values.max())
        colours = linear(mapped(values, low, high, _COLOUR_MAP[self.quantity]).reshape(-1, 3))
        opacities = self._opacities(view, values, low, high).reshape(-1).astype(np.float32)
        self.legend = _legend(view, self.quantity, low, high)
        axes = (view.x_m, view.y_m, view.z_m)
        if self._cells is None or self._axes is None or not _same(axes, self._axes):
            self._axes = axes
            self._cells = self._build(axes, colours, opacities)
        else:
            self._cells.batched_colors = colours
            self._cells.batched_opacities = opacities

    def _opacities(self, view: MapView, values: FloatArray, low: float, high: float) -> FloatArray:
        """Let high values stand out; in a slice only one layer is there, and it is solid."""
        if self.form == "slice":
            layer = round(self.slice_share * (len(view.z_m) - 1))
            opacities = np.zeros_like(values)
            opacities[:, :, layer] = 0.92
            return opacities
        share = (values - low) / (high - low) if high > low else np.full_like(values, 0.5)
        return self.opacity * share**1.5

    def _build(
        self,
        axes: tuple[FloatArray, FloatArray, FloatArray],
        colours: ColourArray,
        opacities: npt.NDArray[np.float32],
    ) -> viser.BatchedMeshHandle:
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        size = [float(np.diff(axis).mean()) if len(axis) > 1 else 1.0 for axis in axes]
        cube = _CUBE * np.array([size[1], size[0], size[2]])
        cells = self._stage.cells("map", (cube, _FACES), ned_to_enu(grid), colours, opacities)
        cells.visible = self.visible
        return cells


def _same(one: tuple[FloatArray, ...], other: tuple[FloatArray, ...]) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def _legend(view: MapView, quantity: str, low: float, high: float) -> str:
    """Say in words what the first and the last colour stand for."""
    logarithmic = view.variable.scale == "log"
    if quantity == "mean":
        ends = (np.exp(low), np.exp(high)) if logarithmic else (low, high)
        return f"{view.variable.title}: {ends[0]:.3g} (dark) to {ends[1]:.3g} {view.variable.unit}"
    unit = "of the natural logarithm" if logarithmic else view.variable.unit
    return f"Standard deviation: {low:.3g} (dark) to {high:.3g} {unit}"
