"""Tags: which detections are doubtful, and where a tag rests."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.tag.config import TagConfig
from autonomy.tag.doubtful import doubtful
from autonomy.tag.resting import CELLS, Extent, heard_share, resting_place
from benchmarks.field.tags import CERTAIN, TRUTH, found, survey

_WATER = Extent(0.0, 1000.0, 0.0, 1000.0)


def test_half_of_what_is_heard_beside_the_tag_is_heard_at_the_half_range() -> None:
    shares = heard_share(np.array([0.0, 300.0, 2000.0]), TagConfig())
    assert shares[1] == pytest.approx(0.45)
    assert shares[0] == pytest.approx(0.9, abs=0.01)
    assert shares[2] < 1e-10


def test_a_detection_that_stands_alone_is_doubtful() -> None:
    alone = doubtful(
        ["a", "a", "b", "a", "a"],
        ["r", "r", "r", "s", "r"],
        np.array([0.0, 3600.0, 10.0, 20.0, 7201.0]),
        3600.0,
    )
    assert alone.tolist() == [False, False, True, True, True]


def test_nothing_heard_is_nothing_doubtful() -> None:
    assert doubtful([], [], np.zeros(0), 3600.0).size == 0


@given(
    st.lists(
        st.tuples(st.sampled_from("ab"), st.sampled_from("rs"), st.integers(0, 30)), max_size=12
    )
)
def test_doubt_is_what_its_definition_says(heard: list[tuple[str, str, int]]) -> None:
    said = doubtful(
        [tag for tag, _, _ in heard],
        [receiver for _, receiver, _ in heard],
        np.array([at for _, _, at in heard], dtype=float),
        5.0,
    )
    wanted = [
        not any(
            mine != index and other[:2] == one[:2] and abs(other[2] - one[2]) <= 5
            for mine, other in enumerate(heard)
        )
        for index, one in enumerate(heard)
    ]
    assert said.tolist() == wanted


def test_regions_grow_with_their_share_and_hold_it() -> None:
    track = np.column_stack([np.linspace(100.0, 900.0, 80), np.full(80, 500.0)])
    place = resting_place(track[30:40], track, np.full(80, 60.0), TagConfig(), _WATER)
    half, most = place.region(0.5), place.region(0.9)
    assert place.probability.shape == (CELLS, CELLS)
    assert place.probability.sum() == pytest.approx(1.0)
    assert not (half & ~most).any()
    assert 0.5 <= place.probability[half].sum() < 0.6
    assert 0.9 <= place.probability[most].sum() < 0.95


def test_silence_pushes_the_tag_away_from_where_nothing_was_heard() -> None:
    heard_at = np.array([[500.0, 500.0]])
    short = resting_place(heard_at, heard_at, np.array([60.0]), CERTAIN, _WATER)
    track = np.column_stack([np.linspace(500.0, 900.0, 100), np.full(100, 500.0)])
    long = resting_place(heard_at, track, np.full(100, 120.0), CERTAIN, _WATER)
    assert short.mean_ne_m == pytest.approx((500.0, 500.0), abs=1.0)
    assert long.mean_ne_m[0] < 400.0


def test_a_tag_is_only_where_water_is() -> None:
    inside = np.zeros((CELLS, CELLS), dtype=bool)
    inside[:20] = True
    here = np.array([[500.0, 500.0]])
    place = resting_place(here, here, np.array([60.0]), TagConfig(), _WATER, inside)
    assert place.probability[~inside].sum() == 0.0


def test_what_cannot_be_placed_is_refused() -> None:
    here = np.array([[500.0, 500.0]])
    with pytest.raises(ValueError, match="never heard"):
        resting_place(np.zeros((0, 2)), here, np.ones(1), TagConfig(), _WATER)
    nowhere = np.zeros((CELLS, CELLS), dtype=bool)
    with pytest.raises(ValueError, match="water"):
        resting_place(here, here, np.ones(1), TagConfig(), _WATER, nowhere)
    with pytest.raises(ValueError, match="area"):
        Extent(0.0, 0.0, 0.0, 1.0)


def test_the_grid_around_detections_holds_what_is_in_range() -> None:
    around = Extent.around(np.array([[0.0, 0.0], [100.0, 0.0]]), TagConfig())
    assert around.north_min_m < -400.0
    assert around.north_max_m > 500.0
    assert around.east_max_m - around.east_min_m == pytest.approx(
        around.north_max_m - around.north_min_m
    )


def test_a_resting_tag_is_found_within_six_hours() -> None:
    rng = np.random.default_rng(11)
    surveys = [survey(rng, 6.0) for _ in range(40)]
    known, doubted = found(surveys, CERTAIN), found(surveys[:20], TRUTH)
    assert known.median_m <= 50.0
    assert known.holds_90 >= 0.85
    assert doubted.holds_90 >= 0.85


def test_a_doubted_range_that_is_told_wrong_still_holds_the_tag() -> None:
    rng = np.random.default_rng(12)
    surveys = [survey(rng, 6.0) for _ in range(12)]
    wrong = {"half_range_m": 420.0, "width_m": 84.0}
    certain = found(surveys, CERTAIN.model_copy(update=wrong))
    doubted = found(surveys, TRUTH.model_copy(update=wrong))
    assert certain.holds_90 < 0.5
    assert doubted.holds_90 >= 0.75
