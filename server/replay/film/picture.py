"""A film as pictures: the way from above, the depth over time and the words of each moment.

They are numbered PNG of one size, so that any program makes a video of them.
"""

import io
import zipfile
from collections.abc import Sequence
from functools import cache
from math import ceil, cos, floor, isfinite, log10, sin
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from autonomy.arrays import FloatArray
from autonomy.site import Box
from server.replay.film.order import FilmOrder
from server.replay.film.scene import caption
from server.scene.replay_source import Moment, ReplaySource
from webui.scene.colour import DOMAIN, KEEP_OUT, PRIMITIVE, ROBOT

WIDTH: Final = 1280
HEIGHT: Final = 720
_GROUND, _PANEL, _GRID, _TEXT, _MUTED = (
    (13, 19, 26), (20, 29, 38), (44, 58, 72), (226, 234, 242), (150, 164, 178),
)  # fmt: skip
_TRACK: Final = (160, 240, 225)
_PLAN: Final = PRIMITIVE["glide"]
_MAP: Final = (40, 80)
"""Left and upper edge of what is seen from above, pixels."""
_MAP_WIDTH, _MAP_HEIGHT = 660, 610
_CHART: Final = (770, 400, 1250, 680)
"""Left, upper, right and lower edge, pixels."""
_TICKS: Final = 5
_ROOM: Final = 0.08
"""Around what is drawn from above, as a share of it."""
_LEAST_M: Final = 0.5
_SILENT: Final = 0.02
"""A longer silence, as a share of the stretch, is a gap in the line of the depth."""
Pixel = tuple[float, float]


class Pictures:
    """Draws moments into a ZIP, each as soon as it is told."""

    def __init__(self, order: FilmOrder, source: ReplaySource, target: Path) -> None:
        self._order, self._source = order, source
        self._archive = zipfile.ZipFile(target, "x")
        self._times: list[str] = []
        way = source.recorded.track
        self._at_s: FloatArray = np.array([one.timestamp() for one in way.measured_at])
        self._view = _View.around(way.position_ned, source.site.domain)
        depth_m = way.position_ned[:, 2]
        deepest_m = float(np.nanmax(depth_m)) if np.isfinite(depth_m).any() else 0.0
        self._deep_m = max(1.1 * deepest_m, _LEAST_M)
        self._map = self._map_drawn_once()
        self._empty = self._drawn_once()

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the ZIP."""
        self._archive.close()

    def take(self, moment: Moment) -> None:
        """Draw the next moment."""
        picture = self._empty.copy()
        draw = ImageDraw.Draw(picture)
        picture.paste(self._seen(moment), _MAP)
        self._draw_depth(draw, moment)
        self._write_words(draw, moment)
        name = f"{len(self._times) + 1:05d}.png"
        content = io.BytesIO()
        picture.save(content, "PNG")
        self._archive.writestr(name, content.getvalue())
        self._times.append(f"{name},{moment.at.isoformat()}\n")

    def finish(self) -> None:
        """Add which moment each picture is of."""
        text = f"# {self._order.words}\npicture,at\n{''.join(self._times)}"
        self._archive.writestr("pictures.csv", text)

    def _drawn_once(self) -> Image.Image:
        """Return what is the same in every picture."""
        picture = Image.new("RGB", (WIDTH, HEIGHT), _GROUND)
        draw = ImageDraw.Draw(picture)
        draw.text((40, 24), self._order.words, _TEXT, font(20))
        draw.rectangle(_CHART, _PANEL)
        left, top, right, bottom = _CHART
        for depth_m in ticks(0.0, self._deep_m):
            y = self._depth_y(depth_m)
            draw.line(((left, y), (right, y)), _GRID)
            draw.text((left - 8, y), f"{depth_m:g}", _MUTED, font(14), anchor="rm")
        draw.text((left, top - 12), "Depth, m", _MUTED, font(14), anchor="lb")
        for at, anchor in ((self._order.first, "la"), (self._order.last, "ra")):
            x = left if anchor == "la" else right
            draw.text((x, bottom + 8), f"{at:%H:%M:%S}Z", _MUTED, font(14), anchor=anchor)
        return picture

    def _map_drawn_once(self) -> Image.Image:
        picture = Image.new("RGB", (_MAP_WIDTH, _MAP_HEIGHT), _PANEL)
        _draw_ground(ImageDraw.Draw(picture), self._view, self._source.site.domain)
        return picture

    def _seen(self, moment: Moment) -> Image.Image:
        """Return the moment from above."""
        picture = self._map.copy()
        draw = ImageDraw.Draw(picture)
        plan, pose = self._source.plan(), moment.pose
        for area in self._source.keep_outs():
            corners = [self._view.pixel(*corner) for corner in area.corners_m]
            draw.polygon(corners, outline=KEEP_OUT, width=2)
        if plan is not None:
            points = [plan.legs[0].start_ned, *plan.points[:, 1:4].tolist()]
            draw.line([self._view.pixel(one[0], one[1]) for one in points], _PLAN, 2)
        way = self._source.recorded.track.position_ned[self._source.known()]
        known = way[np.isfinite(way[:, :2]).all(axis=1)]
        if len(known) > 1:
            pixels = [self._view.pixel(north, east) for north, east in known[:, :2].tolist()]
            draw.line(pixels, _TRACK, 2, joint="curve")
        if pose is not None and isfinite(sum(pose.position_ned[:2])):
            draw.polygon(_arrow(self._view.pixel(*pose.position_ned[:2]), pose.heading_rad), ROBOT)
        return picture

    def _draw_depth(self, draw: ImageDraw.ImageDraw, moment: Moment) -> None:
        known = self._source.known()
        at_s, depth_m = self._at_s[known], self._source.recorded.track.position_ned[known, 2]
        gap_s = _SILENT * (self._order.last - self._order.first).total_seconds()
        told = np.flatnonzero(np.isfinite(depth_m))
        for part in np.split(told, np.flatnonzero(np.diff(at_s[told]) > gap_s) + 1):
            if len(part) > 1:
                pairs = zip(at_s[part].tolist(), depth_m[part].tolist(), strict=True)
                draw.line([self._chart_pixel(*one) for one in pairs], _TRACK, 2)
        x = self._chart_pixel(moment.at.timestamp(), 0.0)[0]
        draw.line(((x, _CHART[1]), (x, _CHART[3])), ROBOT)

    def _write_words(self, draw: ImageDraw.ImageDraw, moment: Moment) -> None:
        pose = moment.pose
        lines = [(f"{moment.at:%Y-%m-%d}", 20), (f"{moment.at:%H:%M:%S}Z", 44)]
        lines += [(part, 20) for part in caption(moment).split(", ")[1:]]
        if pose is not None:
            north_m, east_m = pose.position_ned[:2]
            lines.append((f"{north_m:.1f} m N, {east_m:.1f} m E", 20))
        if moment.plan is not None:
            leg = "" if moment.leg is None else f", leg {moment.leg + 1}"
            lines.append((f"{moment.plan.plan_id}, {moment.plan.state}{leg}", 20))
        y = 84
        for text, size in lines:
            draw.text((740, y), text, _TEXT, font(size))
            y += size + 12

    def _chart_pixel(self, at_s: float, depth_m: float) -> Pixel:
        first_s = self._order.first.timestamp()
        share = (at_s - first_s) / (self._order.last.timestamp() - first_s)
        return _CHART[0] + share * (_CHART[2] - _CHART[0]), self._depth_y(depth_m)

    def _depth_y(self, depth_m: float) -> float:
        return _CHART[1] + (_CHART[3] - _CHART[1]) * max(depth_m, 0.0) / self._deep_m


class _View:
    """Puts places of the water onto the picture, north up, both ways in one scale."""

    def __init__(self, middle_ne_m: tuple[float, float], span_m: float) -> None:
        self._middle = middle_ne_m
        self._per_m = min(_MAP_WIDTH, _MAP_HEIGHT) / span_m
        self._half_m = (_MAP_HEIGHT / 2 / self._per_m, _MAP_WIDTH / 2 / self._per_m)

    @classmethod
    def around(cls, way_ned: FloatArray, domain: Box) -> Self:
        """Return a view of a way; of the box that is explored where nothing was flown."""
        places = way_ned[np.isfinite(way_ned[:, :2]).all(axis=1), :2]
        if len(places) == 0:
            places = np.array([(domain.x_min_m, domain.y_min_m), (domain.x_max_m, domain.y_max_m)])
        low, high = places.min(axis=0), places.max(axis=0)
        span_m = max(float((high - low).max()) * (1 + 2 * _ROOM), _LEAST_M)
        north_m, east_m = ((low + high) / 2).tolist()
        return cls((north_m, east_m), span_m)

    @property
    def edges_m(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """North and east of the lower and the upper ends, m."""
        (north_m, east_m), (half_n, half_e) = self._middle, self._half_m
        return (north_m - half_n, north_m + half_n), (east_m - half_e, east_m + half_e)

    def pixel(self, north_m: float, east_m: float) -> Pixel:
        """Return where a place is drawn."""
        x = _MAP_WIDTH / 2 + (east_m - self._middle[1]) * self._per_m
        y = _MAP_HEIGHT / 2 - (north_m - self._middle[0]) * self._per_m
        return x, y


def _draw_ground(draw: ImageDraw.ImageDraw, view: _View, domain: Box) -> None:
    """Draw a grid in metres, and the box that is explored."""
    norths, easts = view.edges_m
    for north_m in ticks(*norths):
        y = view.pixel(north_m, 0.0)[1]
        draw.line(((0, y), (_MAP_WIDTH, y)), _GRID)
        if y < _MAP_HEIGHT - 24:  # below stand those of the other way
            draw.text((_MAP_WIDTH - 4, y - 2), f"{north_m:g} m N", _MUTED, font(12), anchor="rb")
    for east_m in ticks(*easts):
        x = view.pixel(0.0, east_m)[0]
        draw.line(((x, 0), (x, _MAP_HEIGHT)), _GRID)
        draw.text((x + 4, _MAP_HEIGHT - 2), f"{east_m:g} m E", _MUTED, font(12), anchor="lb")
    corner = view.pixel(domain.x_max_m, domain.y_min_m)
    draw.rectangle((corner, view.pixel(domain.x_min_m, domain.y_max_m)), outline=DOMAIN)
    draw.text((8, 8), "North is up", _TEXT, font(14))


def _arrow(at: Pixel, heading_rad: float) -> Sequence[Pixel]:
    """Return a mark that points where a robot does; 0 is up."""
    ahead, aside = (sin(heading_rad), -cos(heading_rad)), (cos(heading_rad), sin(heading_rad))
    x, y = at
    return [
        (x + f * ahead[0] + s * aside[0], y + f * ahead[1] + s * aside[1])
        for f, s in ((16.0, 0.0), (-9.0, 8.0), (-5.0, 0.0), (-9.0, -8.0))
    ]


def ticks(low: float, high: float) -> list[float]:
    """Return some round numbers between two."""
    step = 10.0 ** floor(log10((high - low) / _TICKS))
    step *= next(
        (one for one in (1.0, 2.0, 5.0) if (high - low) / (one * step) <= _TICKS + 1), 10.0
    )
    return [step * n for n in range(ceil(low / step), floor(high / step) + 1)]


@cache
def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return Pillow's own letters of a size."""
    return ImageFont.load_default(size)
