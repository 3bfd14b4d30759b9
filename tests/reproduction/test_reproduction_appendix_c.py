"""Appendix C: what of the thesis's sentences the orbits show, and another program's figures."""

import pytest

from reproduction.appendix_c import (
    CHOICES,
    FAR_START_M,
    INDEPENDENT,
    LAST_S,
    NEAR_M,
    NEAR_START_M,
    detour_share,
    run,
)
from reproduction.catalogue import reproduce
from reproduction.writer import document, write

BY_TITLE = {choice.title: choice for choice in CHOICES}


def silent(done, doing):
    assert 0.0 <= done <= 1.0
    assert doing


@pytest.fixture(scope="module")
def result():
    return reproduce("appendix-c", 1, silent)


def cell(result, row, column="det^2, 5 m"):
    return next(each for each in result.rows if (each.row, each.column) == (row, column)).ours


@pytest.mark.parametrize("title", list(INDEPENDENT))
def test_orbits_are_those_of_another_program(title):
    radius, arrival, observability, share = INDEPENDENT[title]
    orbit = run(BY_TITLE[title], NEAR_START_M)
    if radius is not None:
        assert orbit.radius_m(LAST_S) == pytest.approx(radius, rel=0.02)
    if arrival is None:
        assert orbit.arrival_s(NEAR_M) is None
    else:
        assert orbit.arrival_s(NEAR_M) == pytest.approx(arrival, abs=0.6)
    assert orbit.observability_s() == pytest.approx(observability, rel=0.02)
    if share is not None:
        assert orbit.fallback_share == pytest.approx(share, abs=0.005)


def test_class_k_functions_go_straight_in_and_orbit_as_tightly_as_the_level_allows():
    for title in ("B", "B^3"):
        assert detour_share(run(BY_TITLE[title], NEAR_START_M)) < 0.02
    assert run(BY_TITLE["B"], FAR_START_M).radius_m(LAST_S) == pytest.approx(0.505, rel=0.01)


def test_a_way_that_never_arrives_has_no_detour():
    assert detour_share(run(BY_TITLE["-0.1 B"], NEAR_START_M)) is None


def test_every_function_has_its_numbers_and_the_figure_its_four_panels(result):
    titles = {row.row.split(": ")[0] for row in result.rows}
    assert titles == set(BY_TITLE)
    assert [panel.title for panel in result.figure.panels][2:] == ["distance", "observability"]
    assert cell(result, "B: radius, last 100 s") == pytest.approx(0.505, rel=0.01)
    assert cell(result, "-B: share of steps without a solution") > 0.4


def test_what_pushes_inward_observes_better_on_the_way_and_worse_afterwards(result):
    for name, is_better in (("same, first 10 s", True), ("same, first 60 s", False)):
        assert (cell(result, f"-B: {name}") > cell(result, f"B: {name}")) is is_better


def test_the_notes_say_what_is_confirmed_and_what_is_not(result):
    words = [note.split(":")[0] for note in result.notes]
    assert words[:4] == ["Confirmed"] * 3 + ["Confirmed on the way in only"]
    assert result.notes[3].endswith("-B leads for 23 s.")
    assert any(note.endswith("within 3 % on the same scenario.") for note in result.notes)


def test_the_same_numbers_come_from_any_seed_and_are_written_as_three_files(result, tmp_path):
    again = reproduce("appendix-c", 2, silent)
    assert document(again) == document(result)
    files = write(result, tmp_path)
    assert sorted(each.suffix for each in files) == [".csv", ".json", ".png"]
    assert all(each.stat().st_size > 1000 for each in files)
