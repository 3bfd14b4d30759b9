"""Tables and figures of the thesis: files, command line, and what is claimed of the controllers."""

import csv
import json
import sys

import numpy as np
import pytest

from reproduction import catalogue, claims, verb
from reproduction.catalogue import REPRODUCTIONS
from reproduction.result import Figure, Hue, Mark, Panel, Reproduction, Row, Series
from reproduction.writer import document, write
from server.cli.main import main

PNG = b"\x89PNG\r\n\x1a\n"


def small_result(ours=0.25):
    seconds = np.linspace(0.0, 10.0, 50)
    lines = (
        Series("proposed", seconds, np.cos(seconds), Hue.PROPOSED, band=(seconds - 1, seconds)),
        Series("reference", seconds, np.sin(seconds), Hue.REFERENCE, Mark.DASHED),
    )
    dots = (
        Series("ours", np.ones(2), np.arange(2.0), Hue.PID, Mark.FILLED, (np.ones(2), np.ones(2))),
        Series("thesis", np.array([0.2, 1.0]), np.arange(2.0), Hue.PID, Mark.HOLLOW),
    )
    panels = (
        Panel("track", "north (m)", "depth (m)", lines, is_plane=True),
        Panel("RMS", "error", "", dots, names=("depth", "pitch"), logarithmic="x"),
        Panel("share", "time (s)", "share (%)", lines[1:], y_range=(-2.0, 2.0)),
    )
    return Reproduction(
        name="table-0.0",
        title="A small table",
        scenario={"duration_s": 10.0, "start": "at rest"},
        rows=(Row("depth, RMS", "proposed", ours, 0.2, "m"), Row("a, b", "PID", 1.0, None, "")),
        figure=Figure(panels, columns=2, caption="Dots and lines."),
        notes=("It is small.",),
    )


@pytest.fixture
def only_small(monkeypatch):
    """Let ``table-0.0`` be the one reproduction, and tell which seeds it was worked out with."""
    seeds = []

    def reproduce(name, seed, report):
        assert name == "table-0.0"
        report(0.5, "half way")
        seeds.append(seed)
        return small_result()

    monkeypatch.setattr(verb, "REPRODUCTIONS", {"table-0.0": "a small table"})
    monkeypatch.setattr(verb, "reproduce", reproduce)
    return seeds


def test_files_carry_scenario_rows_and_figure(tmp_path):
    folder = tmp_path / "made" / "for it"
    files = write(small_result(), folder)
    assert [file.name for file in files] == ["table-0.0.json", "table-0.0.csv", "table-0.0.png"]
    read = json.loads(files[0].read_text())
    assert read == document(small_result())
    assert list(read) == ["name", "title", "scenario", "rows", "notes"]
    assert read["rows"][0] == {
        "row": "depth, RMS",
        "column": "proposed",
        "ours": 0.25,
        "thesis": 0.2,
        "unit": "m",
    }
    assert read["rows"][1]["thesis"] is None
    with files[1].open(newline="") as opened:
        lines = list(csv.reader(opened))
    assert lines == [
        ["row", "column", "ours", "thesis", "unit"],
        ["depth, RMS", "proposed", "0.25", "0.2", "m"],
        ["a, b", "PID", "1.0", "", ""],
    ]
    image = files[2].read_bytes()
    assert image[:8] == PNG
    assert int.from_bytes(image[16:20], "big") == 1200


def test_writing_again_replaces_the_files_and_leaves_nothing_else(tmp_path):
    first = [file.read_bytes() for file in write(small_result(), tmp_path)]
    again = [file.read_bytes() for file in write(small_result(), tmp_path)]
    assert first == again
    changed = write(small_result(ours=0.75), tmp_path)
    assert json.loads(changed[0].read_text())["rows"][0]["ours"] == 0.75
    assert sorted(tmp_path.iterdir()) == sorted(changed)


def test_a_number_that_is_not_finite_is_never_written(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write(small_result(ours=float("nan")), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_without_a_folder_the_table_is_printed_beside_the_thesis(only_small, capsys):
    assert main(["reproduce", "table-0.0"]) == 0
    told = capsys.readouterr()
    assert "A small table" in told.out
    assert "0.25 (0.2)" in told.out
    assert "It is small." in told.out
    assert "half way" not in told.out
    assert only_small == [verb.DEFAULT_SEED]


def test_with_a_folder_the_files_are_named_last_and_the_seed_is_taken(only_small, tmp_path, capsys):
    folder = tmp_path / "results"
    assert main(["reproduce", "table-0.0", "--out", str(folder), "--seed", "7"]) == 0
    told = capsys.readouterr().out.split()
    assert told[-3:] == [str(folder / f"table-0.0.{end}") for end in ("json", "csv", "png")]
    assert only_small == [7]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("table-9.9",), "There is no 'table-9.9'. There are: table-0.0."),
        ((), "Say which to reproduce: table-0.0."),
        (("table-0.0", "--seed", "-1"), "The seed must be 0 or greater."),
        (("table-0.0", "--out", __file__), "is a file; name a folder."),
    ],
)
def test_what_cannot_be_reproduced_is_refused_in_words(only_small, words, sentence, capsys):
    assert main(["reproduce", *words]) == 2
    assert sentence in capsys.readouterr().err
    assert only_small == []


def test_the_list_names_every_reproduction_and_each_has_a_module(capsys):
    assert main(["reproduce", "--list"]) == 0
    listed = capsys.readouterr().out
    for name, title in REPRODUCTIONS.items():
        assert name in listed
        assert title in listed
        assert callable(catalogue.module_of(name).reproduce)


def test_a_break_ends_cleanly(only_small, monkeypatch, tmp_path):
    def interrupted(name, seed, report):
        raise KeyboardInterrupt

    monkeypatch.setattr(verb, "reproduce", interrupted)
    assert main(["reproduce", "table-0.0", "--out", str(tmp_path / "none")]) == 130
    assert not (tmp_path / "none").exists()


def test_the_drawing_library_is_loaded_only_to_draw(only_small, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["reproduce", "table-0.0"]) == 0
    assert "A small table" in capsys.readouterr().out


def test_on_the_linear_glide_the_proposed_controller_is_closest_from_any_start():
    starts = claims.random_starts(10, np.random.default_rng(3))
    race = claims.race("linear_glide", starts)
    assert race.rms_m.shape == (10, 3, 5)
    assert (race.share_by_rms() == 1.0).all()
    assert (race.share_by_end() == 1.0).all()


def test_on_the_sawtooth_the_proposed_controller_ends_closest_but_only_in_the_long_run():
    starts = claims.random_starts(20, np.random.default_rng(3))
    race = claims.race("sawtooth", starts, (100.0, 400.0))
    short, long = race.share_by_end()
    assert short < 0.8
    assert long >= 0.95
    assert race.share_by_rms()[0] < 0.5


def test_random_starts_fill_their_ranges_and_depend_on_the_seed_alone():
    starts = claims.random_starts(500, np.random.default_rng(5))
    assert np.array_equal(starts, claims.random_starts(500, np.random.default_rng(5)))
    used = starts[:, [0, 1, 2, 4, 5, 6]]
    assert used.min(axis=0) == pytest.approx([-1, -1, 0, -0.5, -np.pi, 0.001], abs=0.05)
    assert used.max(axis=0) == pytest.approx([1, 1, 0.5, 0.5, np.pi, 0.06], abs=0.05)
    assert not starts[:, [3, 7, 8, 9, 10, 11]].any()
