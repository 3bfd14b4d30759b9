"""The field map as a volume of translucent cells, or slices of it; opacity follows the value."""

import numpy as np
import numpy.typing as npt
import viser

from autonomy.arrays import BoolArray, FloatArray
from autonomy.frames import ned_to_enu
from webui.scene.colour import ColourArray, linear, mapped
from webui.scene.source import MapView, SceneSource
from webui.scene.stage import Stage
from webui.scene.view import ColourScale

QUANTITIES = ("mean", "standard deviation")
FORMS = ("volume", "slices")
AXES = ("depth", "north", "east")
"""What a slice may be cut across."""
_AXIS_OF = {"north": 0, "east": 1, "depth": 2}
_DEVIATION_COLOURS = "magma"
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
        self._drawn: tuple[object, ...] | None = None
        self.quantity = QUANTITIES[0]
        self.form = FORMS[0]
        self.model = ""
        """Wanted model; the source's default where it has no such map."""
        self.models: dict[str, str] = {}
        """Models that the source has maps of, with their titles; the default first."""
        self.slices: dict[str, float] = {"depth": 0.4}
        """Where slices are cut, as shares of the map's extent; see ``AXES``."""
        self.opacity = 0.8
        self.visible = True
        self.legend = ""
        """What colours mean now, with numbers and unit."""
        self.colours: ColourScale | None = None
        """The same in numbers."""

    def update(self) -> None:
        """Fetch the newest map and draw what changed."""
        views = {model: self._source.map_view(model) for model in self._source.maps()}
        self.models = {
            model: view.title or model for model, view in views.items() if view is not None
        }
        model = self.model if self.model in self.models else next(iter(self.models), None)
        view = None if model is None else views[model]
        if view is None or not any(view.samples_per_level):
            # A map that nothing was measured for says nothing; it would only hide the water.
            self._forget()
            return
        cuts = tuple(sorted(self.slices.items()))
        wanted = (
            view.version,
            view.model,
            self.quantity,
            self.form,
            cuts,
            self.opacity,
            view.variable,
        )
        if wanted == self._drawn:
            return
        self._drawn = wanted
        self._draw(view)

    @property
    def has_content(self) -> bool:
        """Whether there is anything to show."""
        return self._cells is not None

    def show(self, visible: bool) -> None:
        """Show or hide the map."""
        self.visible = visible
        if self._cells is not None:
            self._cells.visible = visible

    def _forget(self) -> None:
        if self._cells is not None:
            self._stage.remove("map")
        self._cells, self._drawn, self.legend, self.colours = None, None, "", None

    def _draw(self, view: MapView) -> None:
        values = view.mean if self.quantity == "mean" else view.std
        if not np.isfinite(values).any():
            return
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        name = view.variable.colour_map if self.quantity == "mean" else _DEVIATION_COLOURS
        colours = linear(mapped(values, low, high, name).reshape(-1, 3))
        opacities = self._opacities(view, values, low, high).reshape(-1).astype(np.float32)
        self.legend = _legend(view, self.quantity, low, high)
        is_log = view.variable.scale == "log"
        self.colours = ColourScale(low, high, view.variable.unit, is_log, name)
        axes = (view.x_m, view.y_m, view.z_m)
        if self._cells is None or self._axes is None or not _same(axes, self._axes):
            self._axes = axes
            self._cells = self._build(axes, colours, opacities)
        else:
            self._cells.batched_colors = colours
            self._cells.batched_opacities = opacities

    def _opacities(self, view: MapView, values: FloatArray, low: float, high: float) -> FloatArray:
        """Let high values stand out; slices are nearly solid, and where no water is is nothing."""
        is_water = np.isfinite(values)
        if self.form == "slices":
            solid = 1.0 - (1.0 - self.opacity) ** 2
            return np.where(is_water & self._is_cut(view), solid, 0.0)
        share = (values - low) / (high - low) if high > low else np.full_like(values, 0.5)
        return np.where(is_water, self.opacity * np.nan_to_num(share) ** 1.5, 0.0)

    def _is_cut(self, view: MapView) -> BoolArray:
        """Tell which cells lie in a slice; shape of the map."""
        shape = view.mean.shape
        is_cut = np.zeros(shape, dtype=np.bool_)
        for name, share in self.slices.items():
            axis = _AXIS_OF[name]
            layers = np.moveaxis(is_cut, axis, 0)
            layers[round(share * (shape[axis] - 1))] = True
        return is_cut

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
