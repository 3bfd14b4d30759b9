"""Whatever is told, the answer is a fix or a sentence, never an exception."""

import math

import numpy as np
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from autonomy.vision.calibration.adjustment import adjust, averaged
from autonomy.vision.calibration.board import BoardView
from autonomy.vision.calibration.lens_fit import LensCalibration, calibrate_lens
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.camera import Rig
from autonomy.vision.corner import fit_corners
from autonomy.vision.fix import Fix, NoFix, Sighting, Telemetry, find_camera, find_robot
from autonomy.vision.quality import judge
from autonomy.vision.tag import bundle_of, layout_of
from tests.autonomy.vision.tank import ROBOT, overhead_cameras, tank_layout

CAMERAS = overhead_cameras()
RIG = Rig(CAMERAS)
LAYOUT = tank_layout()
ANY = st.floats(allow_nan=True, allow_infinity=True, width=64)
PIXEL = st.floats(-3000.0, 4000.0)
PHASES = (Phase.explicit, Phase.generate)  # to shrink arrays of corners takes minutes
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@st.composite
def corners(draw):
    if draw(st.booleans()):
        return np.array(draw(st.lists(st.tuples(ANY, ANY), min_size=4, max_size=4)))
    size = draw(st.floats(1.0, 2000.0))
    bend = np.array(draw(st.lists(st.tuples(*[st.floats(-1.2, 1.2)] * 2), min_size=4, max_size=4)))
    return size * (SQUARE + bend) + [draw(PIXEL), draw(PIXEL)]


def sightings(ids):
    return st.lists(
        st.builds(
            Sighting,
            st.sampled_from(["tank-1", "tank-2", "tank-3", "other"]),
            st.sampled_from(ids),
            corners(),
            st.one_of(st.floats(0.02, 3.0), ANY),
            st.one_of(st.just(0.0), ANY),
        ),
        max_size=6,
    )


@given(sightings([0, 1, 2, 7]), st.tuples(ANY, ANY, ANY), ANY)
@settings(max_examples=60, deadline=None, phases=PHASES)
def test_a_robot_is_found_or_not(seen, down, depth):
    telemetry = Telemetry(down, depth)
    for answer in (
        find_robot(RIG, ROBOT.tags, seen),
        find_robot(RIG, ROBOT.tags, seen, telemetry=telemetry),
    ):
        assert isinstance(answer, Fix | NoFix)
        if isinstance(answer, Fix):
            assert np.isfinite(answer.covariance).all()
            assert np.isfinite(answer.pose.position_m).all()
            assert all(math.isfinite(std) for std in answer.angle_stds_rad)
            assert judge(answer).quality in {"good", "position_only", "refused"}


@given(sightings([100, 101, 102, 120, 121]))
@settings(max_examples=40, deadline=None, phases=PHASES)
def test_a_camera_is_found_or_not(seen):
    answer = find_camera(Rig(CAMERAS[:1]), LAYOUT.tags, seen)
    assert isinstance(answer, Fix | NoFix)


@given(sightings([100, 101, 102, 103, 120, 121]))
@settings(max_examples=30, deadline=None, phases=PHASES)
def test_a_tank_is_adjusted_or_refused(seen):
    one = [s for s in seen if s.camera == "tank-1"]
    answer = adjust(CAMERAS[:1], [np.zeros((9, 9))], LAYOUT, averaged(one))
    assert isinstance(answer, Refusal)
    assert answer.reason


@given(st.lists(st.lists(st.tuples(ANY, ANY), min_size=20, max_size=22), max_size=12))
@settings(max_examples=10, deadline=None, phases=PHASES)
def test_a_lens_is_calibrated_or_refused(drawn):
    points = np.column_stack([np.arange(22) % 5, np.arange(22) // 5, np.zeros(22)]) * 0.05
    views = [BoardView(str(i), points[: len(p)], np.array(p)) for i, p in enumerate(drawn)]
    answer = calibrate_lens("pinhole", 1280, 720, views)
    assert isinstance(answer, LensCalibration | Refusal)


@given(corners(), st.integers(0, 40), st.integers(0, 40), st.integers(0, 255))
@settings(max_examples=60, deadline=None, phases=PHASES)
def test_corners_are_fitted_or_kept(start, rows, columns, seed):
    rng = np.random.default_rng(seed)
    picture = rng.integers(0, 256, (rows, columns)).astype(np.uint8)
    fit = fit_corners(picture, start)
    assert fit.corners_px.shape == (4, 2)
    assert fit.is_fitted or np.array_equal(fit.corners_px, start, equal_nan=True)


JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), ANY, st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(
            st.sampled_from(["tags", "robot", "id", "size_m", "position_m", "roll_deg", "x"]), inner
        ),
    ),
    max_leaves=20,
)


@given(st.dictionaries(st.sampled_from(["tags", "robot"]), JSON))
@settings(max_examples=40, deadline=None, phases=PHASES)
def test_a_document_is_read_or_refused_with_its_path(document):
    for read in (bundle_of, layout_of):
        try:
            read(document)
        except ValueError as refused:
            assert ": " in str(refused)  # noqa: PT017 - most documents are refused
