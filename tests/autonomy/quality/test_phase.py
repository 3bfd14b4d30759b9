"""Phases of flight: by mode, by depth alone, and the profiles that follow from them."""

import csv
from pathlib import Path

import numpy as np
import pytest

from autonomy.quality.phase import (
    ASCENT,
    DESCENT,
    INFLECTION,
    NO_MODE,
    PROPELLED,
    SURFACING,
    UNKNOWN,
    phase_by_depth,
    phase_by_mode,
    profiles,
    segments,
)

FILE = Path(__file__).parents[4] / "shared" / "data" / "eva035_chl_temp.csv"
IDLE, GLIDING, SWIMMING, ABORTING = 0, 2, 4, 7


def by_mode(mode, depth_m, times_s):
    return phase_by_mode(
        np.array(mode),
        np.array(depth_m, dtype=np.float64),
        np.array(times_s, dtype=np.float64),
        diving=(GLIDING,),
        surfaced=(IDLE,),
        propelled=(SWIMMING,),
        aborting=ABORTING,
    ).tolist()


def test_the_glider_file_has_the_phases_that_it_is_known_for():
    if not FILE.exists():
        pytest.skip(f"{FILE.name} is not at hand")
    with FILE.open() as file:
        rows = list(csv.DictReader(file))
    depth_m, times_s = (np.array([float(row[key]) for row in rows]) for key in ("depth", "time"))
    phase = phase_by_depth(depth_m, times_s)
    counts = {one: int(np.count_nonzero(phase == one)) for one in np.unique(phase).tolist()}
    assert counts == {DESCENT: 2007, ASCENT: 1397, INFLECTION: 1370, SURFACING: 270}
    assert profiles(phase)[0].max() == 29


def test_a_gliding_robot_descends_turns_and_ascends():
    depth_m = [*np.linspace(1, 5, 20), *np.full(20, 5.0), *np.linspace(5, 1, 20)]
    phase = by_mode([GLIDING] * 60, depth_m, range(60))
    assert (phase[5], phase[30], phase[54]) == (DESCENT, INFLECTION, ASCENT)
    number, direction = profiles(np.array(phase, dtype=np.int8))
    assert (number[5], number[30], number[54]) == (1, 0, 2)
    assert (direction[5], direction[30], direction[54]) == (1, 0, -1)


def test_other_modes_say_what_they_are_above_and_below():
    below, above = [2.0] * 4, [0.1] * 4
    assert by_mode([IDLE] * 4, below, range(4)) == [SURFACING] * 4
    assert by_mode([SWIMMING] * 4, below, range(4)) == [PROPELLED] * 4
    assert by_mode([SWIMMING] * 4, above, range(4)) == [SURFACING] * 4
    assert by_mode([ABORTING] * 4, below, range(4)) == [ASCENT] * 4
    assert by_mode([ABORTING] * 4, above, range(4)) == [SURFACING] * 4


def test_a_mode_holds_for_a_minute_and_none_before_the_first():
    mode = [NO_MODE, IDLE, NO_MODE, NO_MODE]
    assert by_mode(mode, [0.0] * 4, [0, 10, 70, 71]) == [UNKNOWN, SURFACING, SURFACING, UNKNOWN]


def test_depths_that_nobody_told_have_no_phase():
    depth_m = np.array([2.0, np.nan, 3.0, 4.0])
    assert phase_by_depth(depth_m, np.arange(4.0))[1] == UNKNOWN
    assert phase_by_depth(np.full(3, np.nan), np.arange(3.0)).tolist() == [UNKNOWN] * 3
    assert phase_by_depth(np.array([]), np.array([])).tolist() == []


def test_fixes_in_a_row_begin_one_segment():
    fix = np.array([False, True, True, False, False, True])
    assert segments(fix).tolist() == [1, 2, 2, 2, 2, 3]
    assert segments(fix[1:]).tolist() == [1, 1, 1, 1, 2]
    assert segments(np.zeros(3, dtype=bool)).tolist() == [1, 1, 1]
