"""How the camera sits on its robot, from a turn of the robot in front of wall tags.

The robot turns about at one place. In each picture the tags tell where the camera is and how it is
turned; the robot's own sensors tell its tilt, its depth and, but for an unknown part that stays,
its heading. What differs is the mount. The drawing is kept as a row for each of its numbers, so
that what a turn cannot tell stays as it was drawn.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.fix import DEPTH_STD_M, TILT_STD_RAD, Fix
from autonomy.vision.onboard.own_camera import Mount
from autonomy.vision.rigid import Pose

FEWEST_VIEWS = 10
LEAST_TURN_RAD = math.radians(40.0)
"""By less than this nothing is told of where the camera is."""
WANDER_STD_M = 0.02
"""How far the robot strays from its place while it turns, per axis."""
HEADING_STD_RAD = math.radians(2.0)
COMPASS_STD_RAD = math.radians(3.0)
"""The part of the heading's error that stays."""
GREATEST_RMS = 3.0
_SHIFT, _TURN, _PLACE, _COMPASS, _UNKNOWNS = 0, 3, 6, 8, 9
_STEPS, _DIFFERENCE = 8, 1e-6
_SURE = 1e-12
"""Variance of what a drawing calls exact."""


@dataclass(frozen=True, slots=True, eq=False)
class TurnView:
    """One picture of the turn."""

    camera: Fix
    """Where the tags say that the camera is (``own_fix.find_eye``)."""
    roll_rad: float
    """What the robot's own sensors say at that time, and so the next three."""
    pitch_rad: float
    heading_rad: float
    depth_m: float


@dataclass(frozen=True, slots=True, eq=False)
class FittedMount:
    """The mount, and how well the turn fits it."""

    mount: Mount
    rms: float
    """Root mean square of the residuals, in standard deviations."""


def fit_mount(drawn: Mount, views: Sequence[TurnView]) -> FittedMount | Refusal:
    """Refine a mount by a turn on the spot.

    Args:
        drawn: From the drawing, with how unsure that is.
        views: Of the turn, at least ``FEWEST_VIEWS``.
    """
    if len(views) < FEWEST_VIEWS:
        return Refusal(f"only {len(views)} pictures show a tag; {FEWEST_VIEWS} are needed")
    turned = _turned_rad(views)
    if turned < LEAST_TURN_RAD:
        return Refusal(
            f"the robot turned by {math.degrees(turned):.0f} deg only; "
            f"{math.degrees(LEAST_TURN_RAD):.0f} are needed"
        )
    places = [(view.camera.pose @ drawn.pose).position_m[:2] for view in views]
    middle = np.mean(places, axis=0)
    sure = drawn.covariance + _SURE * np.eye(_PLACE)
    root = np.linalg.cholesky(np.linalg.inv(sure)).T.astype(np.float64)

    def residuals(x: FloatArray) -> FloatArray:
        return _residuals(x, drawn, root, views, middle)

    x = np.zeros(_UNKNOWNS)
    for _ in range(_STEPS):
        slopes = _slopes(residuals, x)
        x = x - np.linalg.solve(slopes.T @ slopes, slopes.T @ residuals(x))
    rms = float(np.sqrt(np.mean(residuals(x) ** 2)))
    if not rms <= GREATEST_RMS:
        return Refusal(
            f"the turn does not fit (rms {rms:.1f}): did the robot stay at its place, "
            "and is the drawing of this robot?"
        )
    slopes = _slopes(residuals, x)
    covariance = np.linalg.inv(slopes.T @ slopes)[:_PLACE, :_PLACE]
    pose = drawn.pose.moved(x[_SHIFT:_TURN], x[_TURN:_PLACE])
    return FittedMount(Mount(pose, covariance + _left_by_tags(pose, views)), rms)


def _slopes(residuals: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Return derivatives by differences, a column for each unknown."""
    steps = _DIFFERENCE * np.eye(len(x))
    columns = [(residuals(x + step) - residuals(x - step)) / (2.0 * _DIFFERENCE) for step in steps]
    return np.column_stack(columns)


def _left_by_tags(mount: Pose, views: Sequence[TurnView]) -> FloatArray:
    """Return what the errors do that all views have in common, such as the tags' survey."""
    total = np.zeros((_PLACE, _PLACE))
    for view in views:
        move = np.zeros((_PLACE, _PLACE))
        move[:_TURN, :_TURN] = view.camera.pose.rotation.T
        move[_TURN:, _TURN:] = mount.rotation.T
        total += move @ view.camera.tank_considered_covariance @ move.T
    return total / len(views)


def _residuals(
    x: FloatArray, drawn: Mount, root: FloatArray, views: Sequence[TurnView], middle: FloatArray
) -> FloatArray:
    """Return all residuals over their standard deviations."""
    mount = drawn.pose.moved(x[_SHIFT:_TURN], x[_TURN:_PLACE])
    rows = [root @ x[:_PLACE], x[_COMPASS:] / COMPASS_STD_RAD]
    for view in views:
        body = view.camera.pose @ mount
        said = Pose.of_angles(np.zeros(3), view.roll_rad, view.pitch_rad, 0.0)
        down = (body.rotation[2] - said.rotation[2]) / TILT_STD_RAD
        heading = math.remainder(
            body.angles_rad[2] - view.heading_rad - float(x[_COMPASS]), math.tau
        )
        deep = body.position_m[2] - view.camera.level_m - view.depth_m
        stray = (body.position_m[:2] - middle - x[_PLACE:_COMPASS]) / WANDER_STD_M
        rows += [down, stray, np.array([heading / HEADING_STD_RAD, deep / DEPTH_STD_M])]
    return np.concatenate(rows)


def _turned_rad(views: Sequence[TurnView]) -> float:
    """Return the angle over which the headings are spread."""
    headings = np.sort(np.mod([view.heading_rad for view in views], math.tau))
    gaps = np.diff(np.append(headings, headings[0] + math.tau))
    return math.tau - float(gaps.max())
