"""What a robot draws, learned: against worlds with hidden powers drawn about the model's."""

import numpy as np
import pytest

from autonomy.estimation.energy_use import EnergyUse, Use, lasts_h

PRIOR_W = np.array([3.0, 3.6, 3.7, 3.9, 5.1])
QUANTUM_WH = 48.0 * 1e-4
READING_STD_WH = QUANTUM_WH / np.sqrt(6.0)
WORLDS = 500


def hidden_powers(rng: np.random.Generator) -> np.ndarray:
    """Return powers about the model's: electronics and each use's own part off by 40 and 70 %."""
    hotel = PRIOR_W[0] * rng.lognormal(0.0, 0.4)
    return hotel + np.maximum(PRIOR_W - PRIOR_W[0], 0.05 * PRIOR_W) * rng.lognormal(0.0, 0.7, 5)


def dive(rng: np.random.Generator) -> np.ndarray:
    """Return hours of a dive: mostly glides, sometimes spirals or flat dives, a turn, a wait."""
    glide, spiral, flat = rng.dirichlet((3.0, 0.6, 0.6)) * rng.uniform(0.05, 0.3)
    return np.array([rng.uniform(0.002, 0.02), glide, spiral, flat, rng.uniform(0.004, 0.02)])


def drawn(rng: np.random.Generator, hours: np.ndarray, power_w: np.ndarray, scatter: float):
    return float(hours @ power_w) * (1.0 + scatter * rng.standard_normal())


def flown(rng, power_w, *, dives: int, scatter: float = 0.08, outliers: float = 0.0) -> EnergyUse:
    use = EnergyUse.of_model(PRIOR_W)
    for _ in range(dives):
        hours = dive(rng)
        energy = drawn(rng, hours, power_w, scatter)
        if rng.random() < outliers:
            energy *= rng.uniform(2.0, 6.0)
        read = QUANTUM_WH * (np.floor(energy / QUANTUM_WH + rng.random()))
        use = use.taken(hours, read, READING_STD_WH)
    return use


@pytest.mark.parametrize(("dives", "outliers"), [(0, 0.0), (3, 0.0), (15, 0.0), (15, 0.1)])
def test_interval_of_the_next_plan_holds_it_in_nine_of_ten_worlds(dives, outliers):
    rng = np.random.default_rng([7, dives, round(100 * outliers)])
    held = 0
    for _ in range(WORLDS):
        power_w = hidden_powers(rng)
        use = flown(rng, power_w, dives=dives, outliers=outliers)
        plan = [dive(rng) for _ in range(4)]
        truth = sum(drawn(rng, one, power_w, 0.08) for one in plan)
        said = use.energy(np.sum(plan, axis=0), pieces=len(plan))
        held += said.low_wh <= truth <= said.high_wh
    assert 0.85 <= held / WORLDS <= 0.95, held / WORLDS


def test_learned_energy_is_nearer_than_the_models():
    rng = np.random.default_rng(11)
    errors = []
    for _ in range(100):
        power_w = hidden_powers(rng)
        hours = dive(rng)
        truth = float(hours @ power_w)
        learned = flown(rng, power_w, dives=15, outliers=0.1).energy(hours).mean_wh
        errors.append((abs(learned - truth) / truth, abs(float(hours @ PRIOR_W) - truth) / truth))
    learned, model = np.mean(errors, axis=0)
    assert learned < 0.25 * model
    assert learned < 0.06


def test_rows_without_outliers_are_those_of_the_batch_regression():
    rng = np.random.default_rng(3)
    prior = EnergyUse.of_model(PRIOR_W)
    use, precision = prior, np.linalg.inv(prior.covariance_w2)
    vector = precision @ PRIOR_W
    for _ in range(20):
        hours = dive(rng)
        energy = float(hours @ PRIOR_W) * 1.02
        noise = (use.scatter * float(hours @ PRIOR_W)) ** 2 + READING_STD_WH**2
        use = use.taken(hours, energy, READING_STD_WH)
        precision = precision + np.outer(hours, hours) / noise
        vector = vector + hours * energy / noise
    assert use.outliers == 0
    np.testing.assert_allclose(use.power_w, np.linalg.solve(precision, vector), rtol=1e-8)
    np.testing.assert_allclose(use.covariance_w2, np.linalg.inv(precision), rtol=1e-7)


def test_robot_that_changed_is_believed_after_a_few_flights():
    rng = np.random.default_rng(5)
    use = flown(rng, PRIOR_W, dives=30, scatter=0.03)
    doubled = 2.0 * PRIOR_W
    for _ in range(12):
        hours = dive(rng)
        use = use.taken(hours, drawn(rng, hours, doubled, 0.03), READING_STD_WH)
    hours = dive(rng)
    assert use.energy(hours).mean_wh == pytest.approx(float(hours @ doubled), rel=0.1)


def test_one_wrong_reading_hardly_counts():
    rng = np.random.default_rng(6)
    use = flown(rng, PRIOR_W, dives=20, scatter=0.03)
    hours = dive(rng)
    before = use.energy(hours).mean_wh
    after = use.taken(hours, 10.0 * before, READING_STD_WH)
    assert after.outliers == use.outliers + 1
    assert after.energy(hours).mean_wh == pytest.approx(before, rel=0.03)


def test_use_is_learned_only_where_it_was_flown():
    use = EnergyUse.of_model(PRIOR_W)
    hours = np.zeros(len(Use))
    hours[Use.GLIDE] = 0.2
    assert not use.is_learned(hours)
    use = use.taken(hours, 0.7, READING_STD_WH)
    assert use.is_learned(hours)
    swim = np.zeros(len(Use))
    swim[Use.SWIM] = 0.2
    assert not use.is_learned(swim)
    again = EnergyUse.of_document(use.document())
    np.testing.assert_array_equal(again.power_w, use.power_w)
    assert (again.rows, again.scatter) == (use.rows, use.scatter)


def test_charge_lasts_for_what_is_left_by_the_rate():
    rate = EnergyUse.of_model(PRIOR_W).power(Use.AFLOAT)
    expected, least, most = lasts_h(6.0, rate)
    assert expected == pytest.approx(2.0)
    assert least < expected < most
    assert lasts_h(-1.0, rate) == (0.0, 0.0, 0.0)
