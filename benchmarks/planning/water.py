"""A water of 100 km with 20,000 corners of shore and 2,000 x 2,000 depths beside a plain box.

The shore is drawn at run time, with islands; the survey lies where a headland comes into its
domain, so that searches and checks meet it. Seconds are the processor's.
"""

import math
import secrets
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.chart import CHARTS, Chart, DepthGrid, keep_chart
from autonomy.field.config import GridShape
from autonomy.field.grid import Grid
from autonomy.field.mask import water_mask
from autonomy.planner.belief import FieldBelief
from autonomy.planner.check.check import violations
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.waterway import depth_at, waterway_of
from autonomy.planner.plan import PlanResult
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.planner.search import kernel, search
from autonomy.site import LAKE, Area, Box, ChartSummary, Site
from server.water.simple_shore import simpler_floor, simpler_shore

CORNERS, ISLANDS, ISLAND_CORNERS, LINES = 20_000, 30, 100, 2_000
RADIUS_M = 45_000.0
DOMAIN_M = 1_500.0
SEEDS = (0, 1, 2)
FAST_S = 2.0
CHECK_S, LEAST_SHARE = 0.2, 0.5
PAIRS = 1_000


def measure() -> list[dict[str, Any]]:
    """Search and check in the bay and in its box; takes a minute."""
    kernel.warm_up()
    drawn_from = secrets.randbits(32)
    with tempfile.TemporaryDirectory() as folder:
        bay = _bay(np.random.default_rng(drawn_from), Path(folder))
        return [*_planning(bay, drawn_from), *_looking(bay, drawn_from)]


def _planning(bay: Site, drawn_from: int) -> list[dict[str, Any]]:
    box = bay.model_copy(
        update={"chart": None, "shoreline": None, "bathymetry": None, "islands": ()}
    )
    config = _config(bay)
    began = time.process_time()
    waterway = waterway_of(config, bay)
    raster_s = time.process_time() - began
    start = _start(config, bay, np.random.default_rng(drawn_from))
    rates: dict[str, float] = {}
    plans: list[PlanResult] = []
    for name, site in (("bay", bay), ("box", box)):
        results = [_search(config, site, start, seed) for seed in SEEDS]
        spent_s = sum(one.history[-1].elapsed_s for one in results)
        rates[name] = sum(one.candidates for one in results) / spent_s
        plans = plans or results
    took, flaws = [], 0
    for plan in plans:
        legs = () if plan.best is None else plan.best.legs
        began = time.process_time()
        flaws += len(violations(legs, config, bay))
        took.append(time.process_time() - began)
    legs = sum(len(plan.best.legs) for plan in plans if plan.best) / len(plans)
    share = rates["bay"] / rates["box"]
    closed = float((waterway.depth < 0.0).mean()) if waterway.depth.size else 0.0
    return [
        _row(f"plan check, slowest of {len(plans)}, {legs:.0f} legs each", max(took), "s", CHECK_S),
        _row("violations of what the search offers there", flaws, "", 0),
        _row(
            f"candidates a second as a share of the box's ({rates['box']:.0f}/s);"
            f" {closed:.0%} of the domain is land, seed {drawn_from}",
            share,
            "1",
            LEAST_SHARE,
            at_least=True,
        ),
        _row("laying the raster of a search over the domain", raster_s, "s", None),
    ]


def _looking(bay: Site, drawn_from: int) -> list[dict[str, Any]]:
    generator = np.random.default_rng(drawn_from)
    places = generator.uniform(-0.7 * RADIUS_M, 0.7 * RADIUS_M, (PAIRS, 2)).tolist()

    def each(look: Callable[[float, float], object]) -> float:
        began = time.process_time()
        for north, east in places:
            look(north, east)
        return (time.process_time() - began) / len(places)

    short = bay.model_copy(update={"chart": None})
    return [
        _row("distance to shore and islands of one place", each(bay.clearance_m), "s", None),
        _row("depth of the floor at one place", each(bay.floor_m), "s", None),
        _row("distance to shore on board, without the chart", each(short.clearance_m), "s", None),
    ]


def _bay(generator: np.random.Generator, folder: Path) -> Site:
    """Return a water of islands and headlands with its chart."""
    angle = np.linspace(0.0, math.tau, CORNERS - ISLANDS * ISLAND_CORNERS, endpoint=False)
    radius = np.full(angle.shape, RADIUS_M)
    for waves in (3, 7, 23, 91, 313, 1201):
        phase, size = generator.uniform(0.0, math.tau), 0.25 * RADIUS_M / waves
        radius += size * np.sin(waves * angle + phase)
    shore = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    rings = [shore]
    turn = np.linspace(0.0, math.tau, ISLAND_CORNERS, endpoint=False)[::-1]
    for number in range(ISLANDS):
        away = RADIUS_M * 0.6 * math.sqrt((number + 1) / ISLANDS)
        at = away * np.array([math.cos(2.4 * number), math.sin(2.4 * number)])
        size = generator.uniform(200.0, 800.0) * (1.0 + 0.2 * np.sin(7.0 * turn))
        rings.append(at + np.stack([size * np.cos(turn), size * np.sin(turn)], axis=1))
    axis = np.linspace(-1.4 * RADIUS_M, 1.4 * RADIUS_M, LINES)
    north, east = np.meshgrid(axis, axis, indexing="ij")
    depth = 40.0 * (1.0 - np.hypot(north, east) / (1.3 * RADIUS_M))
    depth += 8.0 * np.sin(north / 300.0) * np.sin(east / 400.0)
    grid = DepthGrid(axis, axis, depth.astype(np.float32))
    chart = Chart(tuple(rings), grid)
    sha256 = keep_chart(folder, chart)
    CHARTS.open(folder)
    short, floor = simpler_shore(chart.rings), simpler_floor(grid)
    (x0, y0), (x1, y1) = shore.min(axis=0).tolist(), shore.max(axis=0).tolist()
    water = Box(x_min_m=x0, x_max_m=x1, y_min_m=y0, y_max_m=y1, depth_max_m=50.0)
    document = {
        **dict(LAKE),
        "name": "Bay",
        "kind": "sea",
        "water": water,
        "domain": water,
        "shoreline": Area(name="Shore", corners_m=_corners(short[0])),
        "islands": [
            Area(name=f"Island {number}", corners_m=_corners(ring))
            for number, ring in enumerate(short[1:], start=1)
        ],
        "bathymetry": {
            "north_m": floor.north_m.tolist(),
            "east_m": floor.east_m.tolist(),
            "depth_m": floor.depth_m.astype(float).tolist(),
        },
        "chart": ChartSummary(
            sha256=sha256,
            corners=CORNERS,
            islands=ISLANDS,
            rows=LINES,
            columns=LINES,
            spacing_m=float(axis[1] - axis[0]),
        ),
    }
    return Site.model_validate(document)


def _corners(ring: FloatArray) -> tuple[tuple[float, float], ...]:
    return tuple((north, east) for north, east in ring.tolist())


def _config(bay: Site) -> PlannerConfig:
    """Return a survey about the southern end of the bay, half of whose domain is land."""
    shore = bay.shore.rings[0]
    north, east = shore[np.argmin(np.abs(shore[:, 1]) - 1e6 * (shore[:, 0] < 0.0))].tolist()
    half = 0.5 * DOMAIN_M
    preset = PLANNER_PRESETS["grace3"]
    domain = Box(
        x_min_m=north - 0.3 * half,
        x_max_m=north + 1.7 * half,
        y_min_m=east - half,
        y_max_m=east + half,
        depth_max_m=min(preset.domain.depth_max_m, 12.0),
    )
    return preset.model_copy(update={"domain": domain})


def _start(config: PlannerConfig, bay: Site, generator: np.random.Generator) -> tuple[float, float]:
    waterway, domain = waterway_of(config, bay), config.domain
    while True:
        place = (
            float(generator.uniform(domain.x_min_m, domain.x_max_m)),
            float(generator.uniform(domain.y_min_m, domain.y_max_m)),
        )
        if depth_at(waterway, *place) >= 0.6 * domain.depth_max_m:
            return place


def _search(config: PlannerConfig, site: Site, start: tuple[float, float], seed: int) -> PlanResult:
    grid = Grid.over(config.domain, GridShape(x=12, y=12, z=4)).points
    points = grid[water_mask(site, grid)]
    belief = FieldBelief(
        signal_variance=4.0,
        length_scales_m=(200.0, 200.0, 6.0),
        noise_variance=0.05,
        sample_points=np.empty((0, 3)),
        test_points=points,
        mean=np.zeros(len(points)),
        std=np.ones(len(points)),
    )
    began = time.process_time()
    return search.plan(
        config.model_copy(update={"planning_time_s": FAST_S}),
        belief,
        start,
        rng=np.random.default_rng(seed),
        budget=config.round_budget,
        on_progress=lambda _: None,
        is_cancelled=lambda: False,
        elapsed_s=lambda: time.process_time() - began,
        site=site,
    )


def _row(
    name: str, value: float, unit: str, bar: float | None, *, at_least: bool = False
) -> dict[str, Any]:
    met = None if bar is None else (value >= bar if at_least else value <= bar)
    digits = 6 if value < 1e-2 else 3
    return {
        "area": "water",
        "name": name,
        "value": round(value, digits),
        "unit": unit,
        "bar": bar,
        "met": met,
    }
