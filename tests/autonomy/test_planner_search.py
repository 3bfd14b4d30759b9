import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from autonomy.field.mask import water_mask
from autonomy.planner import graph
from autonomy.planner.belief import sample_noise
from autonomy.planner.check.check import violations
from autonomy.planner.leg.waterway import depth_at, waterway_of
from autonomy.planner.objective import (
    MutualInformation,
    objective,
)
from autonomy.planner.plan import PlanStatus
from autonomy.planner.reference import literal
from autonomy.planner.search import search
from autonomy.site import LAKE, TANK
from tests.autonomy.planner_problem import (
    START,
    THESIS_TANK,
    TOLD,
    belief_over,
    independent_worth,
    plain_worth_of_best,
    run,
    with_search,
)

QUICK = with_search(THESIS_TANK, iterations_max=30)
OBJECTIVES = ("information_gain", "ergodic", "weighted")
WORLDS = {
    "thesis": (THESIS_TANK, TANK),
    "miniglider": (TOLD["miniglider"], TANK),
    "grace3": (TOLD["grace3"], LAKE),
}


def for_objective(config, name):
    return config.model_copy(update={"objective": name})


def lengths_of(config):
    """Length scales in proportion to the domain."""
    return (2.41, 2.46, 2.40) if config.domain.depth_max_m < 1.0 else (202.0, 293.0, 6.3)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_every_offer_is_worth_what_independent_points_say(name):
    config = for_objective(QUICK, name)
    belief = belief_over(config.domain)
    result = run(search.plan, config, belief)
    worth = independent_worth(config, belief)
    assert len(result.runners_up) > 0
    for offer in (result.best, *result.runners_up):
        assert offer.objective == pytest.approx(worth(offer.points), abs=1e-6)
        assert (offer.searched is None) == (name == "ergodic")


def drawn(seed):
    """A small planning problem in the tank or the lake: kernel, samples and start by chance."""
    rng = np.random.default_rng([seed, 7])
    world = ("thesis", "miniglider", "grace3")[seed % 3]
    config, site = WORLDS[world]
    lengths = np.array(lengths_of(config)) * np.exp(0.3 * rng.standard_normal(3))
    belief = belief_over(config.domain, past=int(rng.integers(60)), lengths=tuple(lengths))
    belief = replace(belief, noise_variance=0.0025 * float(np.exp(rng.standard_normal())))
    return with_search(config, iterations_max=60), site, belief, open_water(config, site, rng)


@pytest.mark.parametrize("seed", range(3))
def test_what_is_offered_is_worth_as_much_on_fresh_random_points(seed):
    config, site, belief, start = drawn(seed)
    best = run(search.plan, config, belief, seed=seed, start=start, site=site).best
    rng = np.random.default_rng([seed, 8])
    domain = config.domain
    high = (domain.x_max_m, domain.y_max_m, domain.depth_max_m)
    fresh = rng.uniform((domain.x_min_m, domain.y_min_m, 0.0), high, size=(4000, 3))
    fresh = fresh[water_mask(site, fresh)][:1000]
    value = MutualInformation(belief.at(fresh), sample_noise(config, belief))(best.points)
    assert best.objective == pytest.approx(value, rel=0.05)


def searched_and_plain(config, belief, iterations):
    """What a search takes its best trajectory to be worth, and what the plain formulas say."""
    one = search.Search(config, belief, START, np.random.default_rng(0), 20.0)
    for _ in range(iterations):
        one.iterate()
    return one.best, plain_worth_of_best(one, config, belief)


@pytest.mark.parametrize("name", OBJECTIVES)
@pytest.mark.parametrize("past", [0, 40])
def test_single_precision_in_the_search_is_good_to_a_hundredth(name, past):
    config = with_search(for_objective(QUICK, name), points_per_edge_max=64)
    searched, plain = searched_and_plain(config, belief_over(config.domain, past=past), 30)
    assert searched == pytest.approx(plain, abs=0.01)


@pytest.mark.parametrize("shape", ["matern12", "matern52", "squared_exponential"])
@pytest.mark.parametrize("counts", ["noise", "levels"])
def test_every_kernel_and_way_of_counting_is_searched_as_the_reference_says(shape, counts):
    config = with_search(QUICK, points_per_edge_max=64, iterations_max=15)
    config = config.model_copy(
        update={"fidelity_counts": True, "fidelity_thresholds_m": (0.02, 0.05)}
    )
    ahead = belief_over(config.domain, past=12)
    belief = replace(
        belief_over(config.domain),
        shape=shape,
        counts=counts,
        planned_points=ahead.sample_points[:, [0, 1, 2]] * (1.0, 0.7, 0.5),
        planned_std=np.full(12, 0.04),
    )
    searched, plain = searched_and_plain(config, belief, 15)
    assert searched == pytest.approx(plain, rel=1e-4)


@pytest.mark.parametrize("counts", [False, True])
def test_averaged_points_compare_almost_like_all_of_them(counts):
    config = with_search(QUICK, points_per_edge_max=12, past_samples_max=20)
    config = config.model_copy(update={"fidelity_counts": counts})
    searched, plain = searched_and_plain(config, belief_over(config.domain, past=40), 30)
    assert searched == pytest.approx(plain, rel=0.1)


def test_better_half_of_the_starts_goes_on():
    config = with_search(QUICK, iterations_max=240)
    belief = belief_over(config.domain)
    one = search.Search(config, belief, START, np.random.default_rng(0), 20.0)
    seen = []
    for done in range(240):
        one.go_to(done / 240)
        seen.append(one._start)
        one.iterate()
        if done == 80:
            best = [one._group(start).max() for start in range(4)]
    assert list(dict.fromkeys(seen[:80])) == [0, 1, 2, 3]
    assert sorted(dict.fromkeys(seen[80:160])) == sorted(np.argsort(best)[2:])
    assert len(set(seen[160:])) == 1
    assert one._group(seen[-1]).max() == one.best


def test_gaps_get_proposals_enough_in_the_lake_where_few_dives_can_be_flown():
    config, site = WORLDS["grace3"]
    belief = belief_over(config.domain, lengths=lengths_of(config))
    start, rng = open_water(config, site, np.random.default_rng(0)), np.random.default_rng(0)
    one = search.Search(config, belief, start, rng, 40.0, site)
    one.begin_with(())
    proposals = 0
    for _ in range(30):
        search.stage_refinement(one.graph, rng)
        proposals += int(one.graph.tally[graph.PROPOSALS])
    assert proposals > 30 * 40


def test_transects_are_laid_once_for_all_starts():
    config, site = WORLDS["grace3"]
    config = with_search(config, iterations_max=240)
    belief = belief_over(config.domain, lengths=lengths_of(config))
    start = open_water(config, site, np.random.default_rng(0))
    with mock.patch.object(search, "transects", wraps=search.transects) as laid:
        one = search.Search(config, belief, start, np.random.default_rng(0), 40.0, site)
        one.begin_with(())
        for part in (0.0, 0.1, 0.2, 0.3):
            one.go_to(part)
    assert laid.call_count == 1
    assert (one.graph.elite_worth.reshape(4, -1).max(axis=1) > 0.0).all()


@pytest.mark.parametrize(
    ("seconds", "iterations", "starts"), [(5.0, 0, 4), (1.0, 0, 2), (0.2, 0, 1), (5.0, 100, 1)]
)
def test_short_search_starts_less_often(seconds, iterations, starts):
    config = with_search(THESIS_TANK, iterations_max=iterations)
    assert search.starts_of(config.model_copy(update={"planning_time_s": seconds})) == starts


def test_fidelity_changes_what_a_trajectory_is_worth():
    trusting, wary = (
        QUICK.model_copy(update={"fidelity_counts": counts, "fidelity_thresholds_m": (0.02, 0.05)})
        for counts in (False, True)
    )
    belief = belief_over(QUICK.domain)
    best = run(search.plan, wary, belief).best
    assert best.objective < independent_worth(trusting, belief)(best.points)


def open_water(config, site, rng):
    """A random place of the domain that is not shallow."""
    domain, waterway = config.domain, waterway_of(config, site)
    while True:
        x = float(rng.uniform(domain.x_min_m, domain.x_max_m))
        y = float(rng.uniform(domain.y_min_m, domain.y_max_m))
        if depth_at(waterway, x, y) > 0.9 * domain.depth_max_m:
            return x, y


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("name", OBJECTIVES)
@pytest.mark.parametrize("seed", range(3))
def test_every_offer_keeps_every_limit(world, name, seed):
    config, site = WORLDS[world]
    config = with_search(for_objective(config, name), iterations_max=60)
    domain = config.domain
    rng = np.random.default_rng(seed)
    start = open_water(config, site, rng)
    budget = float(rng.uniform(10.0, 20.0))
    belief = belief_over(domain, lengths=lengths_of(config))
    result = run(search.plan, config, belief, seed=seed, start=start, budget=budget, site=site)
    assert result.status is PlanStatus.FOUND
    assert "spends" in result.message
    for offer in (result.best, *result.runners_up):
        assert violations(offer.legs, config, site) == ()
        assert offer.legs[0].start_ned == (*start, 0.0)
        assert offer.legs[-1].end_ned[2] == 0.0
        assert offer.points[-1, 3] == pytest.approx(0.0, abs=1e-12)
        assert offer.energy <= budget + 1e-9
        dives = sum(leg.start_ned[2] == 0.0 for leg in offer.legs)
        turning_s = dives * config.mission.turn_time_s
        assert offer.energy == pytest.approx(
            sum(leg.energy for leg in offer.legs) + config.energy.time_factor * turning_s
        )
        assert offer.duration_s == pytest.approx(
            sum(leg.duration_s for leg in offer.legs) + turning_s
        )
        assert offer.worst_std_m == offer.points[:, 4].max() <= config.max_uncertainty_m
        assert (np.diff(offer.points[:, 0]) > 0).all()
        assert np.diff(offer.points[:, 0]).max() <= config.primitives.point_interval_s + 1e-9
        assert all(domain.contains(*point, margin_m=1e-6) for point in offer.points[:, 1:4])


def test_the_same_seed_gives_the_same_result():
    belief = belief_over(QUICK.domain)
    one, two, other = (run(search.plan, QUICK, belief, seed=seed) for seed in (5, 5, 6))
    assert one.best.legs == two.best.legs
    assert one.candidates == two.candidates
    assert [point.objective for point in one.history] == [point.objective for point in two.history]
    assert one.best.legs != other.best.legs


def test_alternatives_are_worse_and_elsewhere():
    result = run(search.plan, with_search(QUICK, iterations_max=80), belief_over(QUICK.domain))
    offers = (result.best, *result.runners_up)
    assert len(offers) > 1
    assert all(a.objective >= b.objective for a, b in pairwise(offers))
    surfacings = [
        {leg.end_ned[:2] for leg in offer.legs if leg.end_ned[2] == 0.0} for offer in offers
    ]
    for one, two in pairwise(surfacings):
        near = [a for a in one if min(math.dist(a, b) for b in two) < 1e-6]
        assert len(near) <= len(one) / 2


@pytest.mark.parametrize("name", OBJECTIVES)
def test_the_search_beats_the_letter(name):
    config = for_objective(THESIS_TANK, name)
    belief = belief_over(config.domain)
    letter = run(literal.plan, with_search(config, iterations_max=10), belief)
    fast = run(search.plan, with_search(config, iterations_max=60), belief)
    assert letter.status is PlanStatus.FOUND
    assert letter.best.objective == pytest.approx(
        objective(config, belief, START)(letter.best.points), abs=1e-9
    )
    assert violations(letter.best.legs, config, TANK) == ()
    worth = independent_worth(config, belief)
    assert worth(fast.best.points) > worth(letter.best.points)


@pytest.mark.parametrize("planner", [search.plan, literal.plan])
def test_a_cancelled_search_offers_its_best(planner):
    asked = iter(range(10_000))
    result = run(
        planner, THESIS_TANK, belief_over(THESIS_TANK.domain), is_cancelled=lambda: next(asked) > 80
    )
    assert result.status is PlanStatus.CANCELLED
    assert result.message.startswith("Stopped early; the best trajectory so far spends")
    assert result.best is not None


@pytest.mark.parametrize("planner", [search.plan, literal.plan])
def test_a_search_cancelled_at_once_has_nothing_and_says_so(planner):
    result = run(planner, THESIS_TANK, belief_over(THESIS_TANK.domain), is_cancelled=lambda: True)
    assert result.status is PlanStatus.CANCELLED
    assert result.best is None
    assert "stopped before any trajectory was found" in result.message


@pytest.mark.parametrize("planner", [search.plan, literal.plan])
@pytest.mark.parametrize(
    ("start", "budget", "reason"),
    [
        ((-1.0, 0.3), 20.0, "outside the domain"),
        ((math.nan, 0.3), 20.0, "start position is unknown"),
        (START, 0.5, "below the cheapest way"),
    ],
)
def test_what_cannot_be_planned_is_refused_with_the_reason(planner, start, budget, reason):
    result = run(planner, QUICK, belief_over(QUICK.domain), start=start, budget=budget)
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert reason in result.message
    assert result.best is None


@pytest.mark.parametrize("planner", [search.plan, literal.plan])
def test_limits_that_nothing_meets_are_named(planner):
    config = with_search(THESIS_TANK, iterations_max=5)
    config = config.model_copy(update={"max_uncertainty_m": 1e-4})
    result = run(planner, config, belief_over(config.domain))
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "0.0001 m of position uncertainty" in result.message


@pytest.mark.parametrize("planner", [search.plan, literal.plan])
def test_a_shorter_trajectory_is_offered_when_none_spends_enough(planner):
    config = with_search(THESIS_TANK, iterations_max=3, min_budget_fraction=0.99999)
    result = run(planner, config, belief_over(config.domain), seed=2)
    assert result.status is PlanStatus.FOUND
    assert result.message.startswith("No trajectory spends more than 20 energy units; the best")
    assert 0.0 < result.best.energy <= 20.0


def test_time_ends_the_search_and_progress_is_told():
    clock = iter(np.arange(0.0, 100.0, 0.01))
    told = []
    config = THESIS_TANK.model_copy(update={"planning_time_s": 1.5})
    result = run(
        search.plan,
        config,
        belief_over(config.domain),
        on_progress=told.append,
        elapsed_s=lambda: float(next(clock)),
    )
    assert result.status is PlanStatus.FOUND
    assert 4 <= len(told) <= 8
    for before, after in pairwise(told):
        assert after.elapsed_s - before.elapsed_s >= 0.2
        assert after.objective >= before.objective
        assert after.candidates >= before.candidates
    assert result.candidates >= told[-1].candidates


def test_a_search_that_the_clock_ended_is_repeated_without_one():
    config = with_search(THESIS_TANK, iterations_max=0).model_copy(update={"planning_time_s": 2.0})
    belief = belief_over(config.domain)
    rng = np.random.default_rng(3)

    def by_clock(seconds):
        # A machine that is busy for a while, and idle for another.
        clock = iter(np.cumsum(rng.exponential(seconds, 10_000)))
        return run(search.plan, config, belief, elapsed_s=lambda: float(next(clock)))

    first, other = by_clock(0.02), by_clock(0.03)
    assert first.pace.turns, "it went on from more than one start"
    again = run(search.plan, config, belief, pace=first.pace, elapsed_s=lambda: 0.0)
    assert (again.best.legs, again.candidates) == (first.best.legs, first.candidates)
    assert again.pace == first.pace
    assert other.pace != first.pace
    assert other.candidates != first.candidates


def test_the_result_says_when_paths_were_left_out():
    belief = belief_over(QUICK.domain)
    few = run(search.plan, with_search(QUICK, iterations_max=60, paths_per_node=20), belief)
    assert few.reservoir_full
    assert "Not every path was kept: the limit is 20 a surfacing" in few.message
    many = run(search.plan, with_search(QUICK, iterations_max=2, paths_per_node=2000), belief)
    assert not many.reservoir_full
    assert "Not every path" not in many.message


def test_full_tables_end_growth_but_not_the_search():
    config = with_search(THESIS_TANK, iterations_max=600, memory_mb=32)
    belief = belief_over(config.domain)
    one = search.Search(config, belief, START, np.random.default_rng(0), 20.0)
    while one._grows:
        one.iterate()
    at_end_of_growth = one.best
    for _ in range(60):
        one.iterate()
    assert one.best > at_end_of_growth
    assert not one.is_exhausted


def test_a_map_without_samples_can_be_planned_for():
    belief = belief_over(QUICK.domain, past=0)
    assert run(search.plan, QUICK, belief).best.objective > 0.0


def few_iterations(name):
    """What a short search finds, as numbers; also run by the interpreter alone."""
    with mock.patch.object(graph, "STAGED_MIN", 24):
        return few_iterations_of_few_edges(name)


def few_iterations_of_few_edges(name):
    config = with_search(for_objective(THESIS_TANK, name), iterations_max=12)
    result = run(search.plan, config, belief_over(config.domain, past=5), seed=1)
    ends = [leg.end_ned for leg in result.best.legs]
    return [result.candidates, result.best.objective, ends]


@pytest.mark.parametrize("name", OBJECTIVES)
def test_compiled_code_does_what_the_plain_source_says(name):
    code = (
        "import json; from tests.autonomy.test_planner_search import few_iterations;"
        f"print(json.dumps(few_iterations({name!r})))"
    )
    plain = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=280,
        cwd=Path(__file__).parents[2],
        check=True,
    )
    candidates, value, ends = json.loads(plain.stdout)
    compiled = few_iterations(name)
    assert compiled[0] == candidates
    assert compiled[1] == pytest.approx(value, rel=1e-9)
    np.testing.assert_allclose(compiled[2], ends, atol=1e-9)
