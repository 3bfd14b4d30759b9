import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.field.reckoning import position_error_covariance
from autonomy.field.samples import FieldSamples, checked, joined


def some_samples(std_m: list[float]) -> FieldSamples:
    n = len(std_m)
    return FieldSamples.of(np.arange(3.0 * n).reshape(n, 3), np.arange(n), std_m)


def test_a_new_dive_begins_where_the_stated_uncertainty_falls() -> None:
    samples = some_samples([0.01, 0.02, 0.02, 0.05, 0.01, 0.03, 0.02])
    assert samples.dive.tolist() == [0, 0, 0, 0, 1, 1, 2]


def test_samples_that_follow_others_go_on_with_their_dive_or_begin_the_next() -> None:
    first = some_samples([0.01, 0.02])
    goes_on = FieldSamples.of(np.zeros((2, 3)), [1.0, 1.0], [0.03, 0.01], after=first)
    assert goes_on.dive.tolist() == [0, 1]
    surfaced = FieldSamples.of(np.zeros((1, 3)), [1.0], [0.01], after=first)
    assert surfaced.dive.tolist() == [1]
    assert FieldSamples.of(np.zeros((1, 3)), [1.0], [0.01], after=FieldSamples.none()).dive == [0]


def test_parts_of_samples_join_to_the_whole() -> None:
    samples = some_samples([0.01, 0.02, 0.03, 0.01, 0.05])
    whole = joined(samples[:2], samples[2:])
    for name in ("points", "values", "position_std_m", "filtered_std_m", "dive", "time_s"):
        assert np.array_equal(getattr(whole, name), getattr(samples, name))
    assert len(samples[samples.values > 1.0]) == 3
    assert samples[np.array([4, 0])].values.tolist() == [4.0, 0.0]
    assert len(checked(FieldSamples.none())) == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": np.zeros((2, 2))}, "samples need points"),
        ({"values": np.zeros((2, 1))}, "samples need points"),
        ({"position_std_m": [0.1]}, "position_std_m for 2 values"),
        ({"time_s": [[0.0, 1.0]]}, "time_s for 2 values"),
        ({"points": [[0.0, 0.0, 0.0], [0.0, np.inf, 0.0]]}, "points of sample 1 is not finite"),
        ({"values": [np.nan, 1.0]}, "values of sample 0 is not finite"),
        ({"time_s": [0.0, np.nan]}, "time_s of sample 1 is not finite"),
        ({"position_std_m": [0.1, -0.1]}, "must not be negative"),
        ({"filtered_std_m": [0.1, 0.05]}, "must not exceed filtered_std_m"),
    ],
)
def test_samples_that_no_model_can_use_are_refused_with_a_sentence(
    change: dict[str, object], message: str
) -> None:
    good = {"points": np.zeros((2, 3)), "values": [1.0, 2.0], "position_std_m": [0.1, 0.1]}
    with pytest.raises(ValueError, match=message):
        FieldSamples.of(**(good | change))


def test_errors_of_a_smoothed_dive_covary_as_a_random_walk_seen_at_its_end() -> None:
    steps = np.array([0.01, 0.002, 0.004, 0.001, 0.006])
    walk = np.minimum.outer(np.cumsum(steps), np.cumsum(steps))  # covariance at each step
    fix_variance = 0.0004
    gain = walk[:, -1] / (walk[-1, -1] + fix_variance)
    smoothed = walk - np.outer(gain, walk[-1])
    samples = FieldSamples.of(
        np.zeros((5, 3)),
        np.zeros(5),
        np.sqrt(np.diagonal(smoothed)),
        filtered_std_m=np.sqrt(np.diagonal(walk)),
    )
    assert position_error_covariance(samples, samples) == pytest.approx(smoothed, abs=1e-15)
    stated = FieldSamples.of(np.zeros((5, 3)), np.zeros(5), np.sqrt(np.diagonal(walk)))
    assert position_error_covariance(stated, stated) == pytest.approx(walk, abs=1e-15)


def test_errors_of_different_dives_are_independent() -> None:
    samples = some_samples([0.1, 0.2, 0.1, 0.2])
    covariance = position_error_covariance(samples, samples)
    assert np.all(covariance[:2, 2:] == 0.0)
    assert np.all(covariance[:2, :2] > 0.0)


@settings(max_examples=50, deadline=None)
@given(
    stds=st.lists(st.tuples(st.floats(0.0, 10.0), st.floats(0.0, 1.0)), min_size=1, max_size=20),
    dives=st.integers(1, 3),
)
def test_whatever_a_robot_states_is_a_covariance(
    stds: list[tuple[float, float]], dives: int
) -> None:
    filtered = np.array([std for std, _ in stds])
    smoothed = filtered * [share for _, share in stds]
    n = len(stds)
    samples = FieldSamples.of(
        np.zeros((n, 3)), np.zeros(n), smoothed, filtered_std_m=filtered, dive=np.arange(n) % dives
    )
    covariance = position_error_covariance(samples, samples)
    assert np.array_equal(covariance, covariance.T)
    assert np.diagonal(covariance) == pytest.approx(smoothed**2)
    assert np.linalg.eigvalsh(covariance)[0] >= -1e-12 * max(1.0, float(np.trace(covariance)))
