"""Plans that may leave the water only so often, flown by other draws than chose them.

The pond has no walls: a robot that is carried away leaves it. In its middle is a keep-out, drawn
anew each time, as are the start, the search and what every flight meets.
"""

import asyncio
import sys
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from autonomy.field.config import FieldConfig
from autonomy.field.samples import FieldSamples
from autonomy.planner.config import AdaptiveConfig
from autonomy.planner.leg.waterway import closed_areas
from autonomy.planner.plan import Candidate
from autonomy.planner.preset import MINIGLIDER
from autonomy.site import LAKE, Area, Box
from autonomy.vehicle.trim import TrimConfig
from robot_link.dry_run import DryRunProblem
from robot_link.mission import Mission, MissionSettings
from server.plan.chance import chance_of, too_likely, with_margin
from server.plan.document import dry_run_view
from server.plan.margin_search import Tried, safest
from server.plan.search import task
from server.plan.task import SurveyProblem
from simulator.ahead import ensemble
from simulator.fleet import MINI_1

SEED = int(np.random.SeedSequence().generate_state(1)[0])
"""Drawn anew each time; a failure names it."""
ALLOWED = 0.1
POND = Box(x_min_m=0.0, x_max_m=5.0, y_min_m=0.0, y_max_m=4.0, depth_max_m=0.6)
SITE = LAKE.model_copy(
    update={
        "water": POND,
        "domain": POND,
        "shoreline": None,
        "bathymetry": None,
        "islands": (),
        "keep_outs": (),
    }
)


def settings(generator: np.random.Generator):
    """Return settings for the pond, with a keep-out somewhere in its middle."""
    north, east = generator.uniform(1.8, 3.2), generator.uniform(1.5, 2.5)
    sides = ((-0.3, -0.3), (-0.3, 0.3), (0.3, 0.3), (0.3, -0.3))
    reeds = Area(name="reeds", corners_m=tuple((north + n, east + e) for n, e in sides))
    search = MINIGLIDER.search.model_copy(update={"iterations_max": 60})
    return MINIGLIDER.model_copy(
        update={
            "domain": POND,
            "keep_outs": (reeds,),
            "seed": int(generator.integers(2**31)),
            "planning_time_s": 60.0,
            "search": search,
            "adaptive": AdaptiveConfig(greatest_chance=ALLOWED),
        }
    )


def dry_run_problem(config, best: Candidate, seed: int, runs: int = 200) -> DryRunProblem:
    start = best.legs[0].start_ned
    mission_settings = MissionSettings.of(config, TrimConfig(), start, best.duration_s)
    return DryRunProblem(
        mission=Mission.from_legs(mission_settings, best.legs),
        planned_points=best.points,
        vehicle=MINI_1.vehicle,
        site=SITE,
        start_ne_m=start[:2],
        heading_rad=0.0,
        drift_m_sqrt_s=config.position_filter.drift_m_sqrt_s,
        unknown_current_std_m_s=0.004,
        runs=runs,
        seed=seed,
        keep_outs=closed_areas(config, SITE),
        greatest_chance=config.adaptive.greatest_chance,
    )


def flown(problem):
    return ensemble.run(problem, lambda _: None, lambda: False)


def constrained(config, generator: np.random.Generator) -> tuple[Tried, Tried]:
    """Plan as the station does; returns the first try and the safest."""
    start = (float(generator.uniform(0.5, 1.2)), float(generator.uniform(0.5, 3.5)))

    async def search(added_m: float) -> Tried | None:
        problem = SurveyProblem(
            planner=with_margin(config, SITE, added_m),
            field=FieldConfig(),
            samples=FieldSamples.none(),
            start_xy=start,
            budget=14.0,
            round_number=1,
            site=SITE,
        )
        best = task.run(problem, lambda _: None, lambda: False).best
        if best is None:
            return None
        found = flown(dry_run_problem(config, best, int(generator.integers(2**31))))
        view = dry_run_view({"state": "done", **found.document()})
        return Tried(best, {}, cast("Any", None), view)

    first = asyncio.run(search(0.0))
    assert first is not None, SEED
    return first, asyncio.run(safest(first, config, search))[0]


@pytest.mark.timeout(900)  # the kernels may have to be compiled first
def test_plans_leave_the_water_no_oftener_than_was_set_when_others_fly_them():
    generator = np.random.default_rng(SEED)
    out, free, flights = 0, 0, 0
    for number in range(12):
        if number >= 4 and flights:  # a keep-out may lie so that no plan keeps the limit
            break
        config = settings(generator)
        first, chosen = constrained(config, generator)
        assert chance_of(chosen.dry_run) <= chance_of(first.dry_run), SEED
        if too_likely(chosen.dry_run, config):
            assert "breaks it" in too_likely(chosen.dry_run, config)
            continue
        again = flown(dry_run_problem(config, chosen.best, int(generator.integers(2**31))))
        at_first = flown(dry_run_problem(config, first.best, int(generator.integers(2**31))))
        out, flights = out + again.safety.out, flights + again.safety.flights
        free += at_first.safety.out
        counts = f"chosen {again.safety.out}, first {at_first.safety.out} of {again.runs}"
        sys.stdout.write(f"{counts}\n")
    assert flights > 0, SEED
    # the flights of a plan are independent, so their number scatters as a binomial one; so does
    # that of the flights that it was chosen by, or compared with, of which there are as many
    scatter = (2.0 * ALLOWED * (1.0 - ALLOWED) * flights) ** 0.5
    assert out <= ALLOWED * flights + 4.5 * scatter, (SEED, out, flights)
    assert out <= free + 4.5 * scatter, (SEED, out, free)


def test_a_limit_that_few_flights_cannot_promise_is_not_met_by_luck():
    config = settings(np.random.default_rng(SEED))
    strict = config.model_copy(update={"adaptive": AdaptiveConfig(greatest_chance=0.01)})
    safe = {"flights": 24, "out": 0, "legs": [], "short_m": 0.0}
    view = dry_run_view({"state": "done", "safety": safe})
    assert chance_of(view) == pytest.approx(1.0 / 26.0)
    assert "Rehearse it once more" in too_likely(view, strict)
    many = replace(view, safety=replace(view.safety, flights=200))
    assert too_likely(many, strict) == ""
    assert too_likely(None, config).endswith("at most 10 % are allowed.")
    assert too_likely(None, MINIGLIDER) == ""


def test_margins_grow_from_walls_and_keep_outs_alike():
    config = settings(np.random.default_rng(SEED))
    wide = with_margin(config, SITE, 0.3)
    assert wide.margin_m == pytest.approx(config.margin_m + 0.3)
    assert wide.domain.x_min_m == pytest.approx(wide.margin_m)
    assert wide.domain.y_max_m == pytest.approx(POND.y_max_m - wide.margin_m)
    narrow = with_margin(config, SITE, 30.0).domain
    assert narrow.x_max_m - narrow.x_min_m == pytest.approx(0.2 * 5.0)
    assert with_margin(config, SITE, 0.0) == config
