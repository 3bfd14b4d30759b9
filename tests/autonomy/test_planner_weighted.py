import numpy as np
import pytest

from autonomy.planner.belief import sample_noise
from autonomy.planner.objective import (
    ErgodicMeasure,
    InformationGain,
    MutualInformation,
    objective,
    weighted_sum,
)
from autonomy.planner.search import search
from tests.autonomy.planner_problem import (
    START,
    THESIS_TANK,
    belief_over,
    independent_worth,
    run,
    with_search,
)

CONFIG = with_search(THESIS_TANK, iterations_max=25).model_copy(update={"objective": "weighted"})
STAY = np.array([[0.0, *START, 0.0, 0.0]])


def with_weight(weight):
    return CONFIG.model_copy(update={"information_weight": weight})


def test_staying_at_the_start_is_worth_nothing_in_the_ergodic_term():
    belief = belief_over(CONFIG.domain)
    assert weighted_sum(with_weight(0.0), belief, START)(STAY) == pytest.approx(0.0, abs=1e-12)


def test_what_is_left_to_gain_is_what_a_sample_at_every_test_point_brings():
    belief = belief_over(CONFIG.domain)
    noise = sample_noise(THESIS_TANK, belief)
    everywhere = np.zeros((len(belief.test_points), 5))
    everywhere[:, 1:4] = belief.test_points
    left = MutualInformation(belief, noise).left_to_gain()
    assert InformationGain(belief, noise)(everywhere) == pytest.approx(left, rel=2e-3)
    assert weighted_sum(with_weight(1.0), belief, START)(everywhere) == pytest.approx(1.0, rel=2e-3)


def test_the_sum_is_the_formula_written_out():
    belief = belief_over(CONFIG.domain)
    points = run(search.plan, CONFIG, belief).best.points
    noise = sample_noise(CONFIG, belief)
    gain = InformationGain(belief, noise)(points)
    measure = ErgodicMeasure(belief, CONFIG.ergodic)
    left = MutualInformation(belief, noise).left_to_gain()
    expected = 0.3 * gain / left + 0.7 * (1.0 - measure(points) / measure(STAY))
    worth = objective(with_weight(0.3), belief, START)(points)
    assert worth == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("weight", "name"), [(1.0, "information_gain"), (0.0, "ergodic")])
def test_a_weight_at_its_end_orders_trajectories_like_one_objective(weight, name):
    belief = belief_over(CONFIG.domain)
    offers = run(search.plan, CONFIG, belief)
    sides = [offers.best, *offers.runners_up]
    pure = objective(CONFIG.model_copy(update={"objective": name}), belief, START)
    both = objective(with_weight(weight), belief, START)
    order = [sorted(sides, key=lambda offer, f=f: f(offer.points)) for f in (pure, both)]
    assert len(sides) > 1
    assert order[0] == order[1]


def test_more_weight_on_information_brings_more_of_it():
    belief = belief_over(CONFIG.domain)
    gain = independent_worth(CONFIG.model_copy(update={"objective": "information_gain"}), belief)
    little, much = (
        run(search.plan, with_search(with_weight(w), iterations_max=100), belief).best.points
        for w in (0.0, 1.0)
    )
    assert gain(little) < gain(much)
