"""What is wrong with a recording is said, and never integrated over."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.identification.config import SegmentRules
from autonomy.identification.recording import Recording, segments


def recording(n: int = 600, period_s: float = 0.2, *, noisy: bool = True) -> Recording:
    """A robot that sinks and rises slowly between 20 and 60 cm, for two minutes."""
    generator = np.random.default_rng(5)
    time_s = np.arange(n) * period_s
    noise = 1.0 if noisy else 0.0
    depth = 0.4 + 0.2 * np.sin(time_s / 10.0) + 0.003 * noise * generator.standard_normal(n)
    pitch = 0.4 * np.cos(time_s / 10.0)
    attitude = np.column_stack([0.01 * np.sin(time_s), pitch, time_s / 100.0])
    return Recording(
        time_s,
        np.column_stack([np.zeros(n), np.zeros(n), depth]),
        np.full(n, 0.05),
        np.ones(n, dtype=np.bool_),
        attitude + 0.01 * noise * generator.standard_normal((n, 3)),
        np.full(n, 0.01),
        np.full(n, 0.02),
        np.zeros(n),
    )


def kinds(given: Recording, rules: SegmentRules | None = None) -> list[str]:
    return [reason.kind for reason in segments(given, rules).left_out]


def with_column(given: Recording, name: str, rows, values) -> Recording:
    column = getattr(given, name).copy()
    column[rows] = values
    return replace(given, **{name: column})


def covered(given: Recording) -> np.ndarray:
    parts = segments(given).segments
    return np.concatenate([part.rows for part in parts]) if parts else np.array([], dtype=int)


def test_sound_recording_is_used_whole():
    given = recording()
    report = segments(given)
    assert report.left_out == ()
    assert np.array_equal(np.unique(covered(given)), np.arange(given.time_s.size))
    assert max(part.duration_s for part in report.segments) <= 80.0


def test_stamps_ascend_strictly_in_every_segment():
    given = recording()
    messy = with_column(given, "time_s", [50, 51, 300], given.time_s[[49, 49, 290]])
    for part in segments(messy).segments:
        assert (np.diff(messy.time_s[part.rows]) > 0.0).all()


def test_gap_cuts_the_recording_and_is_told():
    given = recording()
    kept = np.r_[0:200, 260:600]
    report = segments(given.taken(kept))
    (gap,) = (reason for reason in report.left_out if reason.kind == "gap")
    assert gap.start_s == pytest.approx(39.8)
    assert gap.end_s == pytest.approx(52.0)
    assert not any(part.start_s < 39.9 < part.end_s for part in report.segments)


def test_repeated_stamp_loses_its_second_row_only():
    given = recording()
    messy = with_column(given, "time_s", 50, given.time_s[49])
    assert kinds(messy) == ["repeated"]
    assert 50 not in covered(messy)
    assert {49, 51} <= set(covered(messy).tolist())


def test_one_stray_stamp_is_skipped():
    given = recording()
    messy = with_column(given, "time_s", 50, given.time_s[40])
    assert kinds(messy) == ["backward"]
    assert 50 not in covered(messy)


def test_clock_that_was_set_back_cuts_the_recording():
    given = recording()
    messy = replace(given, time_s=np.where(np.arange(600) < 300, given.time_s, given.time_s - 30.0))
    assert "backward" in kinds(messy)
    for part in segments(messy).segments:
        assert not (part.rows[0] < 300 <= part.rows[-1])


def test_rows_without_numbers_are_skipped_and_named():
    given = recording()
    attitude = given.attitude_rad.copy()
    attitude[100:104, 1] = np.nan
    messy = replace(given, attitude_rad=attitude)
    (reason,) = segments(messy).left_out
    assert reason.kind == "not_a_number"
    assert "4 rows" in reason.message
    assert "pitch" in reason.message
    assert not np.isin([100, 101, 102, 103], covered(messy)).any()


def test_row_without_a_stamp_is_skipped():
    messy = with_column(recording(), "time_s", 77, np.nan)
    assert kinds(messy) == ["not_a_number"]
    assert 77 not in covered(messy)


def test_stuck_depth_is_left_out():
    given = recording()
    position = given.position_ned.copy()
    position[200:260, 2] = position[200, 2]
    messy = replace(given, position_ned=position)
    (reason,) = segments(messy).left_out
    assert reason.kind == "stuck"
    assert "depth" in reason.message
    assert not np.isin(np.arange(201, 260), covered(messy)).any()


def test_depth_that_never_moves_is_stuck():
    given = recording(noisy=False)
    position = given.position_ned.copy()
    position[:, 2] = 0.3
    report = segments(replace(given, position_ned=position))
    assert report.segments == ()
    assert [reason.kind for reason in report.left_out][:1] == ["stuck"]


def test_actuator_that_rests_is_not_stuck():
    given = recording()
    ramp = np.clip(np.arange(600) - 300, 0, 50) / 50.0 * 0.01
    assert kinds(replace(given, net_buoyancy_kg=ramp)) == []


def test_noisy_feedback_that_freezes_is_stuck():
    noise = 5e-5 * np.random.default_rng(1).standard_normal(600)
    frozen = 0.01 + np.where(np.arange(600) < 400, noise, noise[400])
    report = segments(replace(recording(), net_buoyancy_kg=frozen))
    assert [reason.kind for reason in report.left_out] == ["stuck"]
    assert "net buoyancy" in report.left_out[0].message


def test_flapping_tail_is_left_out():
    given = recording()
    flaps = (given.time_s > 40.0) & (given.time_s < 60.0)
    tail = np.where(flaps, 0.4 * np.sin(2.0 * np.pi * 0.4 * given.time_s), 0.0)
    report = segments(replace(given, tail_rad=tail))
    (reason,) = report.left_out
    assert reason.kind == "flapping"
    assert reason.start_s == pytest.approx(40.0, abs=0.5)
    assert reason.end_s == pytest.approx(60.0, abs=0.5)


def test_single_beat_of_the_tail_is_flapping():
    given = recording()
    beat = (given.time_s >= 40.0) & (given.time_s <= 42.5)
    tail = np.where(beat, 0.4 * np.sin(2.0 * np.pi * 0.4 * (given.time_s - 40.0)), 0.0)
    assert kinds(replace(given, tail_rad=tail)) == ["flapping"]


def test_steering_is_not_flapping():
    given = recording()
    tail = np.where(np.floor(given.time_s / 10.0) % 2 == 0, 0.6, -0.6)
    assert kinds(replace(given, tail_rad=tail)) == []


def test_time_at_the_surface_is_left_out():
    given = recording()
    position = given.position_ned.copy()
    position[250:300, 2] = 0.01 * np.random.default_rng(0).random(50)
    report = segments(replace(given, position_ned=position))
    (reason,) = report.left_out
    assert reason.kind == "surface"
    assert not any(part.start_s < 55.0 < part.end_s for part in report.segments)


def test_short_piece_is_left_out_and_told():
    given = recording()
    kept = np.r_[0:20, 100:600]
    assert kinds(given.taken(kept)) == ["short", "gap"]


def test_empty_recording_has_no_segments():
    report = segments(recording().taken(np.array([], dtype=np.int64)))
    assert report.segments == ()
    assert report.left_out == ()


def test_columns_of_different_length_are_refused():
    given = recording()
    with pytest.raises(ValueError, match="tail_rad"):
        replace(given, tail_rad=given.tail_rad[:-1])


def test_reason_has_a_document():
    messy = with_column(recording(), "time_s", 50, recording().time_s[49])
    (reason,) = segments(messy).left_out
    assert reason.kind == "repeated"


def test_positions_that_cameras_saw_take_the_place_of_its_own():
    given = recording(50)
    seen_s = np.array([0.9, 1.4, 1.8, 3.9, 4.3])
    places = np.column_stack([seen_s, -seen_s])
    stds = np.array([0.002, 0.003, 0.002, 0.001, 0.004])
    seen = given.seen_from_outside(seen_s, places, stds)
    inside = ((given.time_s >= 0.9) & (given.time_s <= 1.8)) | (
        (given.time_s >= 3.9) & (given.time_s <= 4.3)
    )
    assert np.array_equal(seen.has_fix, inside)
    assert seen.position_ned[inside, 0] == pytest.approx(given.time_s[inside])
    assert seen.position_ned[inside, 1] == pytest.approx(-given.time_s[inside])
    assert np.array_equal(seen.position_ned[:, 2], given.position_ned[:, 2])
    assert np.nanmax(seen.position_std_m) == 0.004
    assert np.isnan(seen.position_std_m[~inside]).all()


def test_a_robot_that_cameras_saw_once_has_no_position():
    seen = recording(50).seen_from_outside(np.array([1.0]), np.zeros((1, 2)), np.array([0.002]))
    assert not seen.has_fix.any()
