"""Boards before a camera, drawn as their corners with stated noise."""

import numpy as np

from autonomy.vision.calibration.board import Board, BoardView
from autonomy.vision.lens import Lens
from autonomy.vision.rigid import Pose, rotation_of

BOARD = Board()


def drawn_views(
    lens: Lens, count: int, seed: int, noise_px: float = 0.1, most_tilt_deg: float = 45.0
) -> list[BoardView]:
    """Return views of boards anywhere in the picture, tilted at random, with normal noise."""
    rng = np.random.default_rng(seed)
    points = BOARD.points_m(np.arange(70))
    views: list[BoardView] = []
    while len(views) < count:
        pixel = rng.uniform([0.1, 0.1], [0.9, 0.9]) * [lens.width_px, lens.height_px]
        ray = lens.rays(pixel)
        axis = rng.normal(size=2)
        tilt = np.radians(rng.uniform(0.0, most_tilt_deg)) * axis / np.linalg.norm(axis)
        turn = np.array([0.0, 0.0, rng.uniform(-0.4, 0.4)])
        facing = rotation_of(np.array([-ray[1], ray[0], 0.0]))
        rotation = facing @ rotation_of(np.append(tilt, 0.0)) @ rotation_of(turn)
        middle = ray * rng.uniform(0.4, 1.0)
        pose = Pose(rotation, middle - rotation @ points.mean(axis=0))
        pixels = lens.project(pose.of_points(points))
        shown = lens.shows(pixels, 2.0) & np.isfinite(pixels).all(axis=1)
        if shown.sum() >= 20:
            noise = rng.normal(0.0, noise_px, (int(shown.sum()), 2))
            views.append(BoardView(f"view {len(views)}", points[shown], pixels[shown] + noise))
    return views
