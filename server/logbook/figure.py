"""Figures of reports as SVG: lines over time, and a track from above; drawn for paper."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from math import ceil, floor, isfinite, log10
from typing import Final

_WIDTH, _HEIGHT = 720, 190
_LEFT, _RIGHT, _TOP, _BOTTOM = 58, 12, 12, 26
_TICKS: Final = 5
_GAP_SHARE: Final = 0.02
"""A longer silence, as a share of the time shown, is a gap in the line."""
_MAP: Final = 460
_NAME: Final = 50
"""Room for the name of an end of a track beside it."""
Scale = Callable[[float], float]


_SHAPES: Final = {
    "doubtful": ("M-3.4 0a3.4 3.4 0 1 0 6.8 0a3.4 3.4 0 1 0-6.8 0", "#fff", "#555"),
    "suspect": ("M0-4.5L4.5 0L0 4.5L-4.5 0Z", "#f0a000", "#7a4a00"),
    "bad": ("M-3.6-3.6L3.6 3.6M3.6-3.6L-3.6 3.6", "none", "#c00000"),
}
"""Path, fill and stroke of each kind of mark: colour and shape both tell."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A value of a curve that is to be noticed."""

    at: datetime
    value: float
    kind: str
    """``doubtful``, ``suspect`` or ``bad``."""


@dataclass(frozen=True, slots=True)
class Curve:
    """Values over time."""

    title: str
    unit: str
    at: Sequence[datetime]
    value: Sequence[float]
    is_downwards: bool = False
    least_span: float = 0.0
    """Its axis spans at least so much, so that noise does not look like a dive."""
    marks: Sequence[Mark] = ()


def curve_figure(curve: Curve, first: datetime, last: datetime) -> str:
    """Return a curve as SVG; "" where there is nothing to draw."""
    span_s = (last - first).total_seconds()
    points = [
        ((at - first).total_seconds(), value)
        for at, value in zip(curve.at, curve.value, strict=True)
        if isfinite(value)
    ]
    if not points or span_s <= 0.0:
        return ""
    low, high = min(value for _, value in points), max(value for _, value in points)
    if curve.is_downwards:
        low = min(low, 0.0)
    high = max(high, low + curve.least_span)
    ticks = _ticks(low, high)
    low, high = min(low, ticks[0]), max(high, ticks[-1])

    def x(seconds: float) -> float:
        return _LEFT + seconds / span_s * (_WIDTH - _LEFT - _RIGHT)

    def y(value: float) -> float:
        share = (value - low) / (high - low)
        share = share if curve.is_downwards else 1.0 - share
        return _TOP + share * (_HEIGHT - _TOP - _BOTTOM)

    parts = [_grid(x, y, ticks, first, span_s)]
    parts += [_line([(x(s), y(v)) for s, v in run]) for run in _runs(points, span_s)]
    parts += [
        mark_shape(one.kind, x((one.at - first).total_seconds()), y(one.value))
        for one in curve.marks
    ]
    title = f"{curve.title}, {curve.unit}" if curve.unit else curve.title
    return _svg(_WIDTH, _HEIGHT, title, "".join(parts))


def mark_shape(kind: str, x: float, y: float) -> str:
    """Return a mark as SVG at a place of its figure."""
    path, fill, stroke = _SHAPES[kind]
    place = f"translate({x:.1f} {y:.1f})"
    look = f'fill="{fill}" stroke="{stroke}" stroke-width="1.6"'
    return f'<path class="{kind}" transform="{place}" d="{path}" {look}/>'


def legend_mark(kind: str) -> str:
    """Return a mark as it stands in a line of text."""
    shape = mark_shape(kind, 6.0, 6.0)
    return f'<svg viewBox="0 0 12 12" width="12" height="12" role="img">{shape}</svg>'


def track_figure(
    title: str,
    north_m: Sequence[float],
    east_m: Sequence[float],
    outline: Sequence[tuple[float, float]] = (),
    marks: Sequence[tuple[float, float, str]] = (),
) -> str:
    """Return a track from above as SVG, north up, with a scale; "" where there is none.

    Args:
        title: What stands above it.
        north_m: Where it leads, in the water's frame.
        east_m: The same.
        outline: Corners of the water, north and east.
        marks: Places that are to be noticed, north and east, with the kind of mark.
    """
    places = [
        (north, east)
        for north, east in zip(north_m, east_m, strict=True)
        if isfinite(north) and isfinite(east)
    ]
    if not places:
        return ""
    shown = [*places, *outline]
    norths, easts = [north for north, _ in shown], [east for _, east in shown]
    side_m = max(max(norths) - min(norths), max(easts) - min(easts), 1.0) * 1.1
    middle = (max(norths) + min(norths)) / 2.0, (max(easts) + min(easts)) / 2.0

    def spot(north: float, east: float) -> tuple[float, float]:
        return (
            (0.5 + (east - middle[1]) / side_m) * _MAP,
            (0.5 - (north - middle[0]) / side_m) * _MAP,
        )

    line = [spot(north, east) for north, east in places]
    bar_m = _nice(side_m / 4.0)
    bar = bar_m / side_m * _MAP
    ends = (("begin", line[0], "#fff"), ("end", line[-1], "#0b5cad"))
    ends_shown = "".join(_end(name, x, y, fill) for name, (x, y), fill in ends)
    scale = (
        f'<path d="M12 {_MAP - 14}h{bar:.1f}" stroke="#222" stroke-width="2"/>'
        f'<text x="12" y="{_MAP - 20}">{bar_m:g} m</text>'
        '<text x="12" y="20">N &#8593;</text>'
    )
    frame = f'<rect width="{_MAP}" height="{_MAP}" fill="none" stroke="#bbb"/>'
    shore = " ".join(f"{x:.1f},{y:.1f}" for x, y in (spot(*corner) for corner in outline))
    water = f'<polygon points="{shore}" fill="#eaf3fb" stroke="#7a9cb8"/>' if shore else ""
    noted = "".join(mark_shape(kind, *spot(north, east)) for north, east, kind in marks)
    return _svg(_MAP, _MAP, title, frame + water + _line(line) + noted + ends_shown + scale)


def _end(name: str, x: float, y: float, fill: str) -> str:
    """Return an end of a track, its name on the side where the frame does not cut it."""
    is_at_edge = x > _MAP - _NAME
    aside, anchor = (x - 7, "end") if is_at_edge else (x + 7, "start")
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{fill}" stroke="#0b5cad"/>'
        f'<text x="{aside:.1f}" y="{y + 4:.1f}" text-anchor="{anchor}" paint-order="stroke" '
        f'stroke="#fff" stroke-width="3">{name}</text>'
    )


def _grid(x: Scale, y: Scale, ticks: Sequence[float], first: datetime, span_s: float) -> str:
    parts = [
        f'<path d="M{_LEFT} {y(tick):.1f}H{_WIDTH - _RIGHT}" stroke="#ddd"/>'
        f'<text x="{_LEFT - 6}" y="{y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>'
        for tick in ticks
    ]
    for number in range(_TICKS):
        seconds = span_s * number / (_TICKS - 1)
        at = datetime.fromtimestamp(first.timestamp() + seconds, first.tzinfo)
        words = f"{at:%d. %H:%M}Z" if span_s > 86_400.0 else f"{at:%H:%M}Z"
        anchor = ("start", "middle", "end")[0 if number == 0 else 2 if number == _TICKS - 1 else 1]
        parts.append(
            f'<text x="{x(seconds):.1f}" y="{_HEIGHT - 8}" text-anchor="{anchor}">{words}</text>'
        )
    return "".join(parts)


def _runs(points: Sequence[tuple[float, float]], span_s: float) -> list[list[tuple[float, float]]]:
    """Return the stretches of a curve between its gaps."""
    runs: list[list[tuple[float, float]]] = []
    for point in points:
        if runs and point[0] - runs[-1][-1][0] <= _GAP_SHARE * span_s:
            runs[-1].append(point)
        else:
            runs.append([point])
    return runs


def _line(points: Sequence[tuple[float, float]]) -> str:
    if len(points) == 1:
        return f'<circle cx="{points[0][0]:.1f}" cy="{points[0][1]:.1f}" r="1.5" fill="#0b5cad"/>'
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="#0b5cad" stroke-width="1.3"/>'


def _ticks(low: float, high: float) -> list[float]:
    step = _nice(max(high - low, 1e-9, abs(high) * 1e-6) / 4.0)
    first, last = floor(low / step), ceil(high / step)
    return [round(number * step, 10) for number in range(first, max(last, first + 1) + 1)]


def _nice(value: float) -> float:
    """Return 1, 2 or 5 times a power of ten, not below a value."""
    power = 10.0 ** floor(log10(value))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value * 0.999)


def _svg(width: int, height: int, title: str, content: str) -> str:
    return (
        f'<figure><figcaption>{escape(title)}</figcaption><svg viewBox="0 0 {width} {height}" '
        f'width="{width}" role="img" aria-label="{escape(title)}">{content}</svg></figure>'
    )
