"""The thesis's four errors as dots on a logarithmic scale, ours beside the printed ones."""

import numpy as np

from autonomy.arrays import FloatArray
from reproduction.contender import CONTENDERS
from reproduction.result import Mark, Panel, Series
from reproduction.trials import ERRORS

_SPREAD = 0.22
"""Distance of the controllers' lines within one error, of the distance between two errors."""


def error_chart(
    title: str,
    ours: FloatArray,
    thesis: FloatArray,
    bounds: tuple[FloatArray, FloatArray] | None = None,
) -> Panel:
    """Return a panel with a line of dots for each error and controller.

    Args:
        title: Of the panel.
        ours: RMS errors, shape ``(4, 3)``: depth, horizontal, pitch, hybrid; one column a
            controller.
        thesis: The printed ones, same shape.
        bounds: Ends of a bar through ours, each of the same shape.
    """
    series: list[Series] = []
    for column, contender in enumerate(CONTENDERS):
        height = np.arange(float(len(ERRORS))) + _SPREAD * (column - 1)
        bar = None if bounds is None else (bounds[0][:, column], bounds[1][:, column])
        for label, values, mark, ends in (
            (contender.title, ours[:, column], Mark.FILLED, bar),
            ("", thesis[:, column], Mark.HOLLOW, None),
        ):
            series.append(Series(label, values, height, contender.hue, mark, ends))
    names = tuple(f"{error.removesuffix(' error')} ({unit})" for error, unit in ERRORS)
    return Panel(title, "RMS error", "", tuple(series), names=names, logarithmic="x")
