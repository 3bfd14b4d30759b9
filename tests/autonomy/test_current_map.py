"""The map of a current: its kernel, what dives teach it, and its table."""

import numpy as np
import pytest

from autonomy.current.config import CURRENT_PRESETS, CurrentMapConfig, current_preset
from autonomy.current.kernel import (
    Functionals,
    at_points,
    cross_gram,
    gram_of,
    packed,
)
from autonomy.current.learning import learn
from autonomy.current.model import (
    CurrentMap,
    Observation,
    Taking,
    integral_along,
    tabulate,
)
from autonomy.current.reference.flow import displacement_along, flow_covariance
from autonomy.current.table import (
    FlowRecord,
    flow_at,
    table_of,
    uniform_table,
)
from autonomy.site import LAKE, TANK, Box

TIDAL = CURRENT_PRESETS["sea"].model_copy(update={"inertial": True})


def observation(
    start_s: float = 0.0,
    displacement: tuple[float, float] = (12.0, -5.0),
    place: tuple[float, float] = (0.0, 0.0),
    robot: str = "grace-1",
    duration_s: float = 400.0,
    walk_std_m: float = 6.0,
    way_m: float = 40.0,
    is_surface: bool = False,
) -> Observation:
    """Make a dive that goes north and down and up again."""
    share = np.linspace(0.0, 1.0, 31)
    depth = np.zeros(31) if is_surface else 16.0 * (1.0 - np.abs(2.0 * share - 1.0))
    north = place[0] + way_m * share * (not is_surface)
    track = np.stack([north, np.full(31, place[1]), depth], axis=1)
    return Observation(
        robot=robot,
        time_s=start_s + duration_s * share,
        position_ned=track,
        displacement_ne_m=displacement,
        walk_std_m=walk_std_m,
        fix_std_m=1.5,
        is_surface=is_surface,
    )


def random_functionals(count: int, rng: np.random.Generator) -> Functionals:
    points = rng.uniform(-1.0, 1.0, (count, 3, 4)) * np.array([8000.0, 8000.0, 100.0, 2e5])
    return Functionals(points, rng.uniform(-1.0, 1.0, (count, 3)))


@pytest.mark.parametrize("config", [CurrentMapConfig(), TIDAL])
def test_covariance_of_random_functionals_is_symmetric_and_positive(
    config: CurrentMapConfig,
) -> None:
    functionals = random_functionals(1000, np.random.default_rng(3))
    found = gram_of(functionals, packed(config, 43.0))
    assert np.abs(found - found.T).max() == 0.0
    assert np.linalg.eigvalsh(found)[0] >= -1e-9 * np.trace(found)


@pytest.mark.parametrize("incompressible", [True, False])
def test_compiled_covariance_is_the_readable_one(incompressible: bool) -> None:
    rng = np.random.default_rng(5)
    config = TIDAL.model_copy(update={"incompressible": incompressible})
    parameters = packed(config, 43.0)
    a, b = random_functionals(7, rng), random_functionals(5, rng)
    expected = np.zeros((7, 5, 2, 2))
    for i in range(7):
        for j in range(5):
            points = flow_covariance(a.points[i], b.points[j], parameters)
            expected[i, j] = np.einsum("k,l,klab->ab", a.weights[i], b.weights[j], points)
    flat = expected.transpose(0, 2, 1, 3).reshape(14, 10)
    np.testing.assert_allclose(cross_gram(a, b, parameters), flat, rtol=1e-12, atol=1e-15)
    itself = cross_gram(a, a, parameters)
    np.testing.assert_allclose(gram_of(a, parameters), itself, rtol=1e-12, atol=1e-15)


def test_eddies_of_a_map_have_no_divergence() -> None:
    config = CurrentMapConfig(basin_std_m_s=0.0, changing_std_m_s=0.0, shear_std_m_s=0.0)
    known = CurrentMap(config)
    rng = np.random.default_rng(1)
    for i in range(12):
        place = (float(rng.uniform(0, 300)), float(rng.uniform(0, 300)))
        displacement = (float(rng.normal(0, 12)), float(rng.normal(0, 12)))
        known.append(observation(600.0 * i, displacement, place))
    step = 0.1
    for _ in range(20):
        here = np.array([*rng.uniform(0, 300, 2), 5.0, rng.uniform(0, 7000)])
        around = np.array([here, here, here, here])
        around[[0, 1], 0] += (step, -step)
        around[[2, 3], 1] += (step, -step)
        u = known.flow(around).mean_ne_m_s
        slopes = np.array([u[0] - u[1], u[2] - u[3]]) / (2.0 * step)  # d/dx, d/dy of (u, v)
        assert abs(slopes[0, 0] + slopes[1, 1]) <= 1e-6 * np.abs(slopes).max()


def test_one_dive_in_a_uniform_current_gives_the_shrunk_average() -> None:
    config = CurrentMapConfig(
        basin_memory_s=1e8, eddy_std_m_s=0.0, changing_std_m_s=0.0, shear_std_m_s=0.0
    )
    known = CurrentMap(config)
    dive = observation(start_s=1.7e9)
    known.append(dive)
    T, R = 400.0, 6.0**2 + 1.5**2
    flow = known.flow(np.array([[50.0, 70.0, 3.0, 1.7e9 + 200.0]])).mean_ne_m_s[0]
    shrunk = np.array([12.0, -5.0]) * 0.03**2 * T / (0.03**2 * T**2 + R)
    # times within the dive cost at most T / tu = 4e-6 of it
    np.testing.assert_allclose(flow, shrunk, rtol=5e-6)
    still = CurrentMap(config.model_copy(update={"basin_memory_s": 1e8}))
    still.append(observation(start_s=0.0))
    ratio = still.flow(np.array([[0.0, 0.0, 0.0, 200.0]])).mean_ne_m_s[0] / shrunk
    np.testing.assert_allclose(ratio, 1.0, rtol=5e-6)


def test_flow_of_one_instant_dive_is_exactly_the_shrunk_average() -> None:
    config = CurrentMapConfig(
        basin_memory_s=1e8, eddy_std_m_s=0.0, changing_std_m_s=0.0, shear_std_m_s=0.0
    )
    parameters = packed(config)
    dive = observation()
    functional = dive.functional()
    functional.points[..., 3] = 200.0  # without time there is nothing to forget
    T, R = 400.0, 6.0**2 + 1.5**2
    G = gram_of(functional, parameters) + R * np.eye(2)
    row = cross_gram(at_points(np.array([[9.0, 9.0, 9.0, 200.0]])), functional, parameters)
    flow = row @ np.linalg.solve(G, np.array(dive.displacement_ne_m))
    shrunk = np.array([12.0, -5.0]) * 0.03**2 * T / (0.03**2 * T**2 + R)
    np.testing.assert_allclose(flow, shrunk, rtol=1e-9)


def test_dive_to_be_flown_and_carried_water_follow_a_known_current() -> None:
    known = CurrentMap(CurrentMapConfig())
    for i in range(30):
        known.append(observation(500.0 * i, (12.0, -8.0), walk_std_m=0.5))
    ahead = observation(15_000.0)
    drifted = known.displacement(ahead.time_s, ahead.position_ned)
    np.testing.assert_allclose(drifted.mean_ne_m, [12.0, -8.0], atol=1.0)
    assert drifted.std_m < 3.0
    noisy = known.displacement(ahead.time_s, ahead.position_ned, 25.0)
    np.testing.assert_allclose(noisy.cov_m2 - drifted.cov_m2, 25.0 * np.eye(2))
    on = known.carriage((10.0, 0.0, 5.0), 14_000.0, 15_000.0)
    np.testing.assert_allclose(on.mean_ne_m, [30.0, -20.0], atol=2.5)
    back = known.carriage((10.0 + on.mean_ne_m[0], on.mean_ne_m[1], 5.0), 15_000.0, 14_000.0)
    np.testing.assert_allclose(back.mean_ne_m, -on.mean_ne_m, atol=0.1)
    nothing = known.carriage((0.0, 0.0, 0.0), 9.0, 9.0)
    assert not nothing.mean_ne_m.any()
    assert nothing.std_m == 0.0


def test_map_of_no_dives_is_its_prior() -> None:
    known = CurrentMap(CurrentMapConfig())
    flow = known.flow(np.zeros((2, 4)))
    assert not flow.mean_ne_m_s.any()
    assert flow.cov_m2_s2[0, 0, 0] == pytest.approx(known.prior_std_m_s() ** 2)


def test_what_cannot_be_is_refused_what_is_strange_is_doubted() -> None:
    known = CurrentMap(CurrentMapConfig())
    for i in range(6):
        assert known.append(observation(500.0 * i)).taking is Taking.TAKEN
    assert known.append(observation(500.0)).taking is Taking.REPEATED
    before = known.flow(np.zeros((1, 4))).mean_ne_m_s[0]
    for wrong in ((5000.0, 0.0), (float("nan"), 0.0)):
        refused = known.append(observation(9000.0, wrong))
        assert refused.taking is Taking.REFUSED
        assert refused.text
    strange = known.append(observation(3000.0, (-200.0, 150.0)))
    assert strange.taking is Taking.DOUBTED
    assert "drifted 2" in strange.text
    after = known.flow(np.zeros((1, 4))).mean_ne_m_s[0]
    assert np.abs(after - before).max() < 0.01
    assert len(known.observations) == 7


def test_map_keeps_the_newest_and_order_of_arrival_does_not_matter() -> None:
    config = CurrentMapConfig(dives_max=10, gate=1e6)
    dives = [observation(500.0 * i, (float(i), 2.0)) for i in range(14)]
    forwards, shuffled = CurrentMap(config), CurrentMap(config)
    for one in dives:
        forwards.append(one)
    for i in (4, 3, 7, 5, 8, 6, 9, 11, 10, 13, 12):
        shuffled.append(dives[i])
    assert [one.key for one in forwards.observations] == [one.key for one in dives[4:]]
    assert [one.key for one in shuffled.observations] == [one.key for one in dives[4:]]
    there = np.array([[30.0, 10.0, 5.0, 8000.0]])
    a, b = forwards.flow(there), shuffled.flow(there)
    np.testing.assert_allclose(a.mean_ne_m_s, b.mean_ne_m_s, atol=1e-12)
    np.testing.assert_allclose(a.cov_m2_s2, b.cov_m2_s2, atol=1e-12)
    forwards.append(observation(1e8))
    assert len(forwards.observations) == 1  # all others are older than what the water remembers


def test_learning_finds_a_strong_current_and_shear_only_from_the_surface() -> None:
    rng = np.random.default_rng(2)
    config = CurrentMapConfig()
    dives = [
        observation(
            700.0 * i,
            (40.0 + float(rng.normal(0, 4)), float(rng.normal(0, 4))),
            (float(rng.uniform(0, 400)), float(rng.uniform(0, 400))),
            walk_std_m=4.0,
        )
        for i in range(24)
    ]
    learned = learn(config, dives)
    assert learned.basin_std_m_s > 1.3 * config.basin_std_m_s
    assert learned.shear_std_m_s == config.shear_std_m_s
    stays = [
        observation(700.0 * i + 450.0, (20.0, 0.0), duration_s=120.0, is_surface=True)
        for i in range(24)
    ]
    sheared = learn(config, [*dives, *stays])
    assert sheared.shear_std_m_s != config.shear_std_m_s
    known = CurrentMap(config)
    for one in dives:
        known.append(one)
    prior = known.prior_std_m_s()
    known.relearned(learned)
    assert known.prior_std_m_s() > prior
    fresh = CurrentMap(config, learned=learned)
    for one in known.observations:
        fresh.append(one)
    there = np.array([[30.0, 10.0, 5.0, 8000.0]])
    found = fresh.flow(there).mean_ne_m_s
    np.testing.assert_allclose(found, known.flow(there).mean_ne_m_s, atol=1e-12)


def test_slope_of_the_evidence_is_that_of_its_differences() -> None:
    from autonomy.current import learning

    rng = np.random.default_rng(4)
    dives = [
        observation(
            3000.0 * i, (float(rng.normal(0, 300)), float(rng.normal(0, 300))), duration_s=2400.0
        )
        for i in range(6)
    ]
    evidence = learning._evidence_of(TIDAL, dives, 40.0)
    cost = learning._Components(evidence).cost
    theta = rng.normal(0.0, 0.2, len(evidence.places))
    _, slope = cost(theta)
    for i in range(len(theta)):
        step = np.zeros(len(theta))
        step[i] = 1e-5
        difference = (cost(theta + step)[0] - cost(theta - step)[0]) / 2e-5
        assert slope[i] == pytest.approx(difference, rel=2e-3, abs=1e-3)


def test_table_is_the_map_at_its_points_and_keeps_to_its_ends() -> None:
    known = CurrentMap(CurrentMapConfig())
    for i in range(8):
        known.append(observation(500.0 * i, (12.0 + i, -5.0), (30.0 * i, 200.0)))
    domain = Box(x_min_m=0.0, x_max_m=420.0, y_min_m=0.0, y_max_m=400.0, depth_max_m=16.0)
    record = tabulate(known, domain, 4000.0, 9000.0, (5, 4, 3, 6))
    table = table_of(FlowRecord.model_validate_json(record.model_dump_json()))
    at = np.array([[105.0, 400.0, 8.0, 5000.0]])
    expected = known.mean_flow(at)[0]
    np.testing.assert_allclose(flow_at(table, 105.0, 400.0, 8.0, 1000.0), expected, atol=1e-8)
    beyond = flow_at(table, 105.0, 1e5, 8.0, 1000.0)
    np.testing.assert_allclose(beyond, expected, atol=1e-8)
    dive = observation(0.0, place=(100.0, 200.0))
    fine = table_of(tabulate(known, domain, 4000.0, 9000.0))
    along = displacement_along(fine, dive.time_s, dive.position_ned)
    exact = known.displacement(dive.time_s + 4000.0, dive.position_ned).mean_ne_m
    np.testing.assert_allclose(along, exact, atol=1.0)
    with pytest.raises(ValueError, match="not those of the shape"):
        FlowRecord.model_validate(record.model_dump() | {"shape": (5, 4, 3, 7)})
    steady = uniform_table(0.03, -0.02)
    assert flow_at(steady, 5.0, 6.0, 7.0, 8.0) == (0.03, -0.02)


def test_settings_are_those_of_the_water_and_refuse_like_periods() -> None:
    assert not current_preset(TANK).enabled
    assert current_preset(LAKE) == CurrentMapConfig()
    coast = Box(x_max_m=20_000.0, y_max_m=20_000.0, depth_max_m=200.0)
    sea = LAKE.model_copy(update={"kind": "sea", "domain": coast})
    assert current_preset(sea) == CURRENT_PRESETS["sea"]
    with pytest.raises(ValueError, match="differ by too little"):
        CurrentMapConfig(tide_std_m_s=(0.1, 0.1), tide_periods_h=(12.42, 12.43))
    with pytest.raises(ValueError, match="as many entries"):
        CurrentMapConfig(tide_std_m_s=(0.1, 0.1))


def test_integral_of_a_linear_current_is_exact() -> None:
    dive = observation()
    functional = integral_along(dive.time_s, dive.position_ned)
    assert functional.weights.sum() == pytest.approx(dive.duration_s)
    np.testing.assert_allclose(
        functional.weights @ functional.points[0, :, 0], 20.0 * 400.0, rtol=1e-12
    )
