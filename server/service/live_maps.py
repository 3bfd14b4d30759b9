"""The maps of one robot's variable, one for each model, over one grid."""

from collections.abc import Sequence
from datetime import datetime

import numpy as np

from autonomy.field.config import FieldConfig
from autonomy.field.grid import Grid
from autonomy.field.live_map import LiveMap
from autonomy.field.variable import VARIABLES
from db.column import moment
from db.query.samples import SampleColumns
from robot_link.messages import Sample
from server.service.field_model import MODELS
from server.service.seen import Seen
from webui.scene.source import MapView


class LiveMaps:
    """Maps that grow; one thread at a time may change them, any thread may read ``views``."""

    def __init__(self, config: FieldConfig, grid: Grid) -> None:
        """Begin with the prior."""
        self._config = config
        self._grid = grid
        models = sorted(MODELS, key=lambda model: model != config.model)
        self._maps = {
            model: LiveMap(config.model_copy(update={"model": model}), grid) for model in models
        }
        self._seen = Seen()
        self.version = 0
        self.views: dict[tuple[str, str], MapView] = {}
        """Newest arrays by variable and model, the default model first."""
        self._refresh(None)

    @classmethod
    def from_columns(cls, config: FieldConfig, grid: Grid, columns: SampleColumns) -> "LiveMaps":
        """Condition the maps on stored samples."""
        maps = cls(config, grid)
        for log, sequence in zip(columns.log, columns.sequence, strict=True):
            maps._seen.add(int(log), int(sequence))
        for start in range(0, len(columns), config.max_samples):
            piece = slice(start, start + config.max_samples)
            for live in maps._maps.values():
                live.append(
                    columns.position_ned[piece], columns.value[piece], columns.position_std_m[piece]
                )
        if len(columns):
            maps._refresh(moment(int(columns.measured_at_us[-1])))
        return maps

    def is_of(self, config: FieldConfig, grid: Grid) -> bool:
        """Tell whether the maps were made with these settings over this grid."""
        return self._config == config and np.array_equal(self._grid.points, grid.points)

    def append(self, samples: Sequence[Sample]) -> None:
        """Take in samples of the maps' variable that are not in them yet."""
        fresh = [
            sample
            for sample in samples
            if sample.variable == self._config.variable
            and self._seen.add(sample.log, sample.sequence)
        ]
        if not fresh:
            return
        points = np.array([sample.position_ned for sample in fresh])
        values = np.array([sample.value for sample in fresh])
        position_std_m = np.array([sample.position_std_m for sample in fresh])
        for live in self._maps.values():
            live.append(points, values, position_std_m)
        self._refresh(max(sample.measured_at for sample in fresh))

    def _refresh(self, at: datetime | None) -> None:
        self.version += 1
        shape = self._grid.shape
        variable = VARIABLES[self._config.variable]
        self.views = {
            (variable.key, model): MapView(
                variable=variable,
                model=model,
                x_m=self._grid.x_m,
                y_m=self._grid.y_m,
                z_m=self._grid.z_m,
                mean=live.mean.reshape(shape),
                std=live.std.reshape(shape),
                samples_per_level=live.samples_per_level,
                version=self.version,
                updated_at=at,
            )
            for model, live in self._maps.items()
        }
