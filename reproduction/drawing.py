"""Draws a reproduction's figure; the only module that loads the drawing library."""

import io
from typing import TYPE_CHECKING, Any

from reproduction.result import Figure, Hue, Mark, Panel, Reproduction, Series

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = {
    Hue.PROPOSED: "#0072b2",
    Hue.BASELINE: "#d55e00",
    Hue.PID: "#009e73",
    Hue.REFERENCE: "#1a1a1a",
    Hue.FAINT: "#8c8c8c",
    Hue.SINGLE: "#d55e00",
    Hue.RECURSIVE: "#0072b2",
    Hue.JOINT: "#cc79a7",
    Hue.POSITION_NOISE: "#009e73",
    Hue.MFE: "#0072b2",
    Hue.MFIG: "#56b4e9",
    Hue.SFE: "#d55e00",
    Hue.SFIG: "#e69f00",
    Hue.TARGET: "#1a1a1a",
    Hue.BARRIER: "#0072b2",
    Hue.THESIS_BARRIER: "#e69f00",
    Hue.NOMINAL: "#8c8c8c",
    Hue.MPC_NONE: "#8c8c8c",
    Hue.MPC_TRACE: "#009e73",
    Hue.MPC_DETERMINANT: "#d55e00",
    Hue.MPC_CONDITION: "#cc79a7",
    Hue.CUBIC: "#56b4e9",
    Hue.ZERO: "#009e73",
    Hue.NEGATIVE: "#d55e00",
    Hue.SLIGHTLY_NEGATIVE: "#e69f00",
    Hue.ROOT: "#cc79a7",
    Hue.CONSTANT: "#1a1a1a",
    Hue.STATE: "#8c8c8c",
    Hue.OUTPUT: "#d55e00",
    Hue.STATE_BARRIER: "#009e73",
    Hue.OUTPUT_BARRIER: "#0072b2",
    Hue.ESTIMATED_BARRIER: "#cc79a7",
}
"""Okabe and Ito's colours, which people with every kind of colour vision tell apart."""
_SHAPES = {
    Hue.PROPOSED: "o",
    Hue.BASELINE: "s",
    Hue.PID: "^",
    Hue.SINGLE: "s",
    Hue.RECURSIVE: "o",
    Hue.JOINT: "D",
    Hue.POSITION_NOISE: "^",
    Hue.MFE: "o",
    Hue.MFIG: "D",
    Hue.SFE: "s",
    Hue.SFIG: "^",
    Hue.TARGET: "*",
    Hue.BARRIER: "o",
    Hue.THESIS_BARRIER: "P",
    Hue.NOMINAL: "s",
    Hue.MPC_NONE: "s",
    Hue.MPC_TRACE: "^",
    Hue.MPC_DETERMINANT: "v",
    Hue.MPC_CONDITION: "D",
}
_STYLES: dict[Mark, dict[str, Any]] = {
    Mark.LINE: {"linewidth": 1.6},
    Mark.DASHED: {"linewidth": 1.6, "linestyle": (0, (5, 3))},
    Mark.THIN: {"linewidth": 0.8},
    Mark.FILLED: {"linestyle": "none", "markersize": 7},
    Mark.HOLLOW: {
        "linestyle": "none",
        "markersize": 7,
        "markerfacecolor": "white",
        "markeredgewidth": 1.5,
    },
}
_FEW = 8
"""Up to so many points of a line are drawn as dots as well: between them nothing is known."""
_WIDTH_IN, _DOTS_PER_IN = 10.0, 120
_ROW_IN, _PLANE_ROW_IN = 3.1, 4.3
_HEAD_IN, _FOOT_IN = 0.95, 0.45
_INSET = (0.33, 0.27)
_LETTERS: Any = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.labelsize": 10,
    "axes.edgecolor": "#666666",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "figure.facecolor": "white",
    "axes.facecolor": "white",
}


def png(result: Reproduction) -> bytes:
    """Return the figure as a PNG of 1200 pixels across on a light ground."""
    # The library takes half a second to load, and no other verb needs it.
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Sheet
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = result.figure
    rows = -(-len(figure.panels) // figure.columns)
    row_in = _PLANE_ROW_IN if any(_is_square(panel) for panel in figure.panels) else _ROW_IN
    height = _HEAD_IN + rows * row_in + (_FOOT_IN if figure.caption else 0.0)
    with mpl.rc_context(_LETTERS):
        foot = _FOOT_IN / height if figure.caption else 0.0
        layout = ConstrainedLayoutEngine(rect=(0.0, foot, 1.0, 1.0 - foot - _HEAD_IN / height))
        sheet = Sheet(figsize=(_WIDTH_IN, height), dpi=_DOTS_PER_IN, layout=layout)
        every = sheet.subplots(rows, figure.columns, squeeze=False).flat
        for axes, panel in zip(every, figure.panels, strict=False):
            _draw(axes, panel)
        for axes in list(every)[len(figure.panels) :]:
            axes.set_axis_off()
        sheet.text(0.012, 1.0 - 0.17 / height, result.title, va="top", fontsize=13, weight="bold")
        sheet.text(0.012, 0.12 / height, figure.caption, va="bottom", color="#444444")
        _legend(sheet, figure, 1.0 - 0.42 / height)
        target = io.BytesIO()
        FigureCanvasAgg(sheet).print_png(target, metadata={"Title": result.title})
    return target.getvalue()


def _draw(axes: "Axes", panel: Panel) -> None:
    for series in panel.series:
        _line(axes, series)
    axes.set_title(panel.title, loc="left")
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    axes.margins(x=0.02)
    if panel.names:
        axes.set_yticks(range(len(panel.names)), panel.names)
        axes.set_ylim(len(panel.names) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=False, axis="y")
        for edge in range(1, len(panel.names)):
            axes.axhline(edge - 0.5, color="#e3e3e3", linewidth=0.8)
    if panel.x_names:
        axes.set_xticks(range(len(panel.x_names)), panel.x_names)
        axes.set_xlim(-0.5, len(panel.x_names) - 0.5)
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False, axis="x")
        for edge in range(1, len(panel.x_names)):
            axes.axvline(edge - 0.5, color="#e3e3e3", linewidth=0.8)
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    if panel.logarithmic == "x":
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_formatter("")
        axes.margins(x=0.08)
    elif panel.logarithmic == "y":
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.yaxis.set_minor_formatter("")
    if _is_square(panel):
        axes.set_aspect("equal", adjustable="datalim")
    if panel.is_plane:
        axes.invert_yaxis()
    if panel.inset is not None:
        small = axes.inset_axes((*panel.inset_at, *_INSET))
        _draw(small, panel.inset)
        small.tick_params(labelsize=8)
        small.set_title(panel.inset.title, loc="left", fontsize=9)
        small.xaxis.label.set_fontsize(8)


def colour_of(hue: Hue) -> str:
    """Return the colour in which what a hue stands for is drawn, ``#rrggbb``."""
    return _COLOURS[hue]


def _is_square(panel: Panel) -> bool:
    """Return whether a metre is as long on both axes."""
    return panel.is_plane or panel.is_map


def _line(axes: "Axes", series: Series) -> None:
    colour = colour_of(series.hue)
    style: dict[str, Any] = {"color": colour, **_STYLES[series.mark]}
    if series.mark in {Mark.FILLED, Mark.HOLLOW} or len(series.x) <= _FEW:
        style["marker"] = _SHAPES.get(series.hue, "D")
        style.setdefault("markersize", 5)
    if series.band is not None:
        axes.fill_between(series.x, *series.band, color=colour, alpha=0.15, linewidth=0)
    if series.x_bounds is not None:
        axes.hlines(series.y, *series.x_bounds, color=colour, linewidth=1.4)
    if series.y_bounds is not None:
        axes.vlines(series.x, *series.y_bounds, color=colour, linewidth=1.4)
    axes.plot(series.x, series.y, label=series.label or "_", **style)


def _legend(sheet: Any, figure: Figure, top: float) -> None:  # noqa: ANN401 - a figure of the library
    """List each label once, in one row above all panels."""
    handles: dict[str, Any] = {}
    for axes in sheet.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    sheet.legend(
        handles.values(),
        handles.keys(),
        loc="upper left",
        bbox_to_anchor=(0.004, top),
        ncols=len(handles),
        frameon=False,
        columnspacing=1.6,
        handlelength=3.0,
    )
