r"""Calibration of a lens from pictures of a board, by Levenberg-Marquardt.

The pose of the board in each picture is another six unknowns. Each stands in the equations of its
own picture alone, so they are eliminated picture by picture and nine or fewer unknowns remain:

.. math:: (\sum_v L_v' L_v - L_v' B_v (B_v' B_v)^{-1} B_v' L_v) \, d = -\sum_v ...

with the derivatives L of the corners by the lens and B by the pose. The inverse of the same matrix,
scaled by the residuals, is the covariance.

A few corners of a board that is tilted much are found pixels away from where they are. They are
left out once all others have told the lens; a picture of which many corners do not fit is refused.

Source:
    Triggs and others, "Bundle adjustment - a modern synthesis", LNCS 1883, 2000, section 6.1.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.calibration.board import FEWEST_CORNERS, BoardView, pose_of_board
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.lens import PARAMETERS, Lens, LensKind
from autonomy.vision.rigid import Pose, skew

FEWEST_VIEWS = 10
GREATEST_RMS_PX = 1.0
GREATEST_FOCAL_SHARE = 0.005
"""Standard deviation of the focal length, over it, up to which a calibration is taken."""
GREATEST_VIEW_SHARE = 3.0
"""Residual of one picture over the median of all, from which on it is wrong."""
LEAST_TILT_RAD = math.radians(10.0)
"""The boards of some two pictures must be turned against each other by so much."""
FARTHEST_OFF = 5.0
"""Of the median residual, from which on a corner is not believed."""
LEAST_OFF_PX = 0.4
"""No corner that is nearer is left out."""
MOST_LEFT_OUT = 0.25
"""Part of a picture's corners that may be left out; where it is more, the picture is wrong."""
_LEAST_RMS_PX = 0.05
_FARTHEST_PIXEL = 1e5
_MOST_STEPS = 60
_FOCAL_TRIES = np.geomspace(0.25, 4.0, 33)
"""Focal lengths to begin with, in widths of the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class LensCalibration:
    """A lens, and how well it is known."""

    lens: Lens
    covariance: FloatArray
    """Of ``Lens.parameters``, shape ``(9, 9)``; zero where this kind of lens has none."""
    rms_px: float
    """Root mean square of the residuals, both coordinates taken alone."""
    views: tuple[str, ...]
    """Pictures that were used."""
    view_rms_px: tuple[float, ...]

    @property
    def focal_std_share(self) -> float:
        """Standard deviation of the focal length over it, the worse of both."""
        stds = np.sqrt(np.diag(self.covariance)[:2])
        return float(np.max(stds / self.lens.focal_px))


def calibrate_lens(
    kind: LensKind, width_px: int, height_px: int, views: Sequence[BoardView]
) -> LensCalibration | Refusal:
    """Calibrate a lens.

    Args:
        kind: Model of the lens.
        width_px: Of the pictures.
        height_px: Of the pictures.
        views: Boards in air; those with fewer than 20 corners are left out.
    """
    usable = [
        view
        for view in views
        if len(view.pixels) >= FEWEST_CORNERS and (np.abs(view.pixels) <= _FARTHEST_PIXEL).all()
    ]
    if len(usable) < FEWEST_VIEWS:
        return Refusal(
            f"only {len(usable)} pictures show {FEWEST_CORNERS} corners or more; "
            f"{FEWEST_VIEWS} are needed"
        )
    begun = _start(kind, width_px, height_px, usable)
    if begun is None:
        return Refusal(
            "no focal length explains the pictures: is the board flat and its size right?"
        )
    lens, poses = begun
    fit = _Fit(lens, poses, usable)
    fit.run()
    believed = _believed(fit)
    if believed is not None:
        fit = _Fit(fit.lens, fit.poses, believed)
        fit.run()
    return _judged(fit)


class _Fit:
    """A lens and the boards' poses while they are improved."""

    def __init__(self, lens: Lens, poses: list[Pose], views: Sequence[BoardView]) -> None:
        self.lens, self.poses, self.views = lens, poses, views
        self.cost = _cost(lens, poses, views)

    def run(self) -> None:
        """Improve until nothing more is gained."""
        damping = 1e-3
        for _ in range(_MOST_STEPS):
            lens, poses, step = self._step(damping)
            cost = math.inf if lens is None else _cost(lens, poses, self.views)
            if lens is not None and cost <= self.cost:
                gain, self.lens, self.poses = self.cost - cost, lens, poses
                self.cost, damping = cost, max(0.1 * damping, 1e-12)
                if gain < 1e-10 * (1e-6 + cost) or step < 1e-12:
                    break
            else:
                damping *= 10.0
                if damping > 1e10:
                    break

    def _step(self, damping: float) -> tuple[Lens | None, list[Pose], float]:
        free = self.lens.is_free
        H, g, parts = self.normal_equations(damping)
        plain = H[np.ix_(free, free)]
        A = plain + damping * np.diag(np.diag(plain))
        change = np.zeros(PARAMETERS)
        try:
            change[free] = -np.linalg.solve(A, g[free])
            kind, size = self.lens.kind, (self.lens.width_px, self.lens.height_px)
            lens = Lens.of_parameters(kind, *size, self.lens.parameters + change)
        except (np.linalg.LinAlgError, ValueError):
            return None, self.poses, math.inf
        poses: list[Pose] = []
        for pose, (inverse, right, cross) in zip(self.poses, parts, strict=True):
            move = -inverse @ (right + cross @ change)
            poses.append(pose.moved(move[:3], move[3:]))
        return lens, poses, float(np.abs(change / (1.0 + np.abs(self.lens.parameters))).max())

    def normal_equations(
        self, damping: float
    ) -> tuple[FloatArray, FloatArray, list[tuple[FloatArray, FloatArray, FloatArray]]]:
        """Return the equations of the lens, and what gives each pose's move from the lens's."""
        total, right_side = np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS)
        parts: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        for pose, view in zip(self.poses, self.views, strict=True):
            pixels, by_point, by_lens = self.lens.project_with_slopes(pose.of_points(view.points_m))
            off = (pixels - view.pixels).ravel()
            L = by_lens.reshape(-1, PARAMETERS)
            turn = -by_point @ pose.rotation @ skew(view.points_m)
            B = np.concatenate([by_point, turn], axis=2).reshape(-1, 6)
            square = B.T @ B
            held = square + damping * np.diag(np.diag(square))
            inverse = np.linalg.inv(held).astype(np.float64)
            cross, right = B.T @ L, B.T @ off
            total += L.T @ L - cross.T @ inverse @ cross
            right_side += L.T @ off - cross.T @ inverse @ right
            parts.append((inverse, right, cross))
        return total, right_side, parts


def _believed(fit: _Fit) -> list[BoardView] | None:
    """Return the pictures without corners that do not fit; none where all corners do."""
    off = [
        np.linalg.norm(fit.lens.project(pose.of_points(view.points_m)) - view.pixels, axis=1)
        for pose, view in zip(fit.poses, fit.views, strict=True)
    ]
    limit_px = max(LEAST_OFF_PX, FARTHEST_OFF * float(np.median(np.concatenate(off))))
    views: list[BoardView] = []
    for view, away in zip(fit.views, off, strict=True):
        fits = away <= limit_px
        few = fits.sum() >= max(FEWEST_CORNERS, (1.0 - MOST_LEFT_OUT) * len(fits))
        views.append(
            replace(view, points_m=view.points_m[fits], pixels=view.pixels[fits]) if few else view
        )
    left_out = sum(map(_corners, fit.views)) - sum(map(_corners, views))
    return views if left_out else None


def _corners(view: BoardView) -> int:
    return len(view.pixels)


def _cost(lens: Lens, poses: Sequence[Pose], views: Sequence[BoardView]) -> float:
    """Return the sum of squares; infinite where a corner is not seen."""
    total = 0.0
    for pose, view in zip(poses, views, strict=True):
        off = lens.project(pose.of_points(view.points_m)) - view.pixels
        total += float((off * off).sum())
    return total if math.isfinite(total) else math.inf


def _start(
    kind: LensKind, width_px: int, height_px: int, views: Sequence[BoardView]
) -> tuple[Lens, list[Pose]] | None:
    """Return the lens without distortion that explains the views best, and their poses."""
    best: tuple[float, Lens, list[Pose]] | None = None
    centre = (0.5 * (width_px - 1), 0.5 * (height_px - 1))
    for share in _FOCAL_TRIES.tolist():
        lens = Lens(kind, width_px, height_px, (share * width_px, share * width_px), centre)
        poses = [pose_of_board(view, lens) for view in views]
        found = [pose for pose in poses if pose is not None]
        if len(found) < len(views):
            continue
        cost = _cost(lens, found, views)
        if math.isfinite(cost) and (best is None or cost < best[0]):
            best = cost, lens, found
    return None if best is None else best[1:]


def _judged(fit: _Fit) -> LensCalibration | Refusal:
    lens, free = fit.lens, fit.lens.is_free
    count = sum(2 * len(view.pixels) for view in fit.views)
    rms = math.sqrt(fit.cost / count)
    view_rms = np.array(
        [
            math.sqrt(_cost(lens, [pose], [view]) / (2 * len(view.pixels)))
            for pose, view in zip(fit.poses, fit.views, strict=True)
        ]
    )
    usual = max(float(np.median(view_rms)), _LEAST_RMS_PX)
    worst = int(view_rms.argmax())
    if view_rms[worst] > GREATEST_VIEW_SHARE * usual:
        return Refusal(
            f"picture {fit.views[worst].name} does not fit the others "
            f"({view_rms[worst]:.2f} px, usual is {usual:.2f}): leave it out"
        )
    if not rms <= GREATEST_RMS_PX:
        return Refusal(
            f"the corners are {rms:.1f} px off: is the board flat, and the lens a {lens.kind}?"
        )
    normals = np.array([pose.rotation[:, 2] for pose in fit.poses])
    if float(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0)).max()) < LEAST_TILT_RAD:
        return Refusal("the pictures do not tell the lens: tilt the board in more directions")
    unknowns = int(free.sum()) + 6 * len(fit.views)
    H = fit.normal_equations(0.0)[0][np.ix_(free, free)]
    scale = np.sqrt(np.diag(H))
    inverse = np.linalg.pinv(H / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
    covariance = np.zeros((PARAMETERS, PARAMETERS))
    covariance[np.ix_(free, free)] = inverse * fit.cost / max(count - unknowns, 1)
    found = LensCalibration(
        lens, covariance, rms, tuple(view.name for view in fit.views), tuple(view_rms.tolist())
    )
    if not found.focal_std_share <= GREATEST_FOCAL_SHARE:
        return Refusal(
            f"the focal length is known to {100.0 * found.focal_std_share:.1f} % only: "
            "tilt the board in more directions, and fill the picture"
        )
    return found
