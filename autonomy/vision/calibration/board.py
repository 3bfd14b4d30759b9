"""The board in front of a camera: its corners, and which views of it are missing yet."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.vision.lens import Lens
from autonomy.vision.rigid import Pose, nearest_rotation

FEWEST_CORNERS = 20
"""A view with fewer is left out."""
WANTED_VIEWS = 20
CELLS_ACROSS, CELLS_DOWN = 4, 3
"""Parts of the picture in each of which some corner should have been."""
_TILTED = 0.17
"""Sine of the tilt from which on a board is tilted."""


@dataclass(frozen=True, slots=True)
class Board:
    """A ChArUco board: squares with markers in the white ones, whose inner corners are found."""

    squares_across: int = 11
    squares_down: int = 8
    square_m: float = 0.050

    def points_m(self, ids: npt.ArrayLike) -> FloatArray:
        """Return inner corners in the board's plane, by rows from the top left, ``(n, 3)``, m.

        Raises:
            ValueError: If there is no corner of an id.
        """
        numbers = np.asarray(ids, dtype=np.int64)
        across = self.squares_across - 1
        if ((numbers < 0) | (numbers >= across * (self.squares_down - 1))).any():
            raise ValueError("ids: the board has no such corner")
        x, y = numbers % across + 1, numbers // across + 1
        points: FloatArray = np.zeros((len(numbers), 3))
        points[:, 0], points[:, 1] = self.square_m * x, self.square_m * y
        return points


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """One picture of a board."""

    name: str
    points_m: FloatArray
    """Corners that were found, in the board's plane, shape ``(n, 3)``."""
    pixels: FloatArray
    """Where, shape ``(n, 2)``."""


def pose_of_board(view: BoardView, lens: Lens) -> Pose | None:
    """Return the pose of a board before a camera, if the lens has a ray for every corner.

    The map from the plane to the slopes of the rays has it in closed form.

    Source:
        Zhang, IEEE Trans. Pattern Analysis 22 (11), 2000, section 3.1.
    """
    rays = lens.rays(view.pixels)
    if not np.isfinite(rays).all():
        return None
    slopes, plane = rays[:, :2] / rays[:, 2:], view.points_m[:, :2]
    middle, size = plane.mean(axis=0), float(plane.std()) or 1.0
    flat = np.column_stack([(plane - middle) / size, np.ones(len(plane))])
    nothing = np.zeros_like(flat)
    rows = np.vstack(
        [
            np.hstack([flat, nothing, -slopes[:, :1] * flat]),
            np.hstack([nothing, flat, -slopes[:, 1:] * flat]),
        ]
    )
    of_flat = np.linalg.eigh(rows.T @ rows)[1][:, 0].reshape(3, 3)
    to_flat = np.array(
        [[1.0 / size, 0.0, -middle[0] / size], [0.0, 1.0 / size, -middle[1] / size], [0, 0, 1]]
    )
    unscaled = of_flat @ to_flat
    norms = np.linalg.norm(unscaled[:, :2], axis=0)
    if not (norms > 0.0).all():
        return None
    ahead = np.sign(float(unscaled[2] @ np.append(middle, 1.0)))
    H = unscaled / (ahead * norms.mean())
    rotation = nearest_rotation(np.column_stack([H[:, 0], H[:, 1], np.cross(H[:, 0], H[:, 1])]))
    return Pose(rotation, H[:, 2])


def missing_views(views: Sequence[BoardView], lens: Lens) -> tuple[str, ...]:
    """Return what pictures of the board are missing yet, in words; nothing if there are enough.

    Args:
        views: Taken until now.
        lens: About the lens, even without distortion; its size is that of the pictures.
    """
    taken = [view for view in views if len(view.pixels) >= FEWEST_CORNERS]
    if not taken:
        return (f"{WANTED_VIEWS} pictures of the board",)
    said: list[str] = []
    if len(taken) < WANTED_VIEWS:
        said.append(f"{WANTED_VIEWS - len(taken)} more pictures")
    pixels = np.vstack([view.pixels for view in taken])
    across = np.clip(pixels[:, 0] / lens.width_px * CELLS_ACROSS, 0, CELLS_ACROSS - 1).astype(int)
    down = np.clip(pixels[:, 1] / lens.height_px * CELLS_DOWN, 0, CELLS_DOWN - 1).astype(int)
    seen = np.zeros((CELLS_DOWN, CELLS_ACROSS), dtype=np.bool_)
    seen[down, across] = True
    rows, columns = ("top", "middle", "bottom"), ("far left", "left", "right", "far right")
    for i, j in np.argwhere(~seen).tolist():
        said.append(f"the board in the {rows[i]} {columns[j]} of the picture")
    poses = [pose for view in taken if (pose := pose_of_board(view, lens)) is not None]
    normals = np.array([pose.rotation[:, 2] for pose in poses]).reshape(-1, 3)
    for axis, words in enumerate(("to the left and to the right", "up and down")):
        tilts = normals[:, axis]
        if not ((tilts > _TILTED).any() and (tilts < -_TILTED).any()):
            said.append(f"the board tilted {words}")
    return tuple(said)
