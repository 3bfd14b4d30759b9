"""Where most flights of a dry run were: a tube along the track, and ellipses where they come up."""

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray, IntArray, evenly_spread
from autonomy.frames import ned_to_enu
from webui.scene.colour import BAND
from webui.scene.source import BandView
from webui.scene.stage import Stage

TUBE, SURFACINGS, FILLS = "plan/band", "plan/surfacings", "plan/surfacing_fills"
NODES = (TUBE, SURFACINGS, FILLS)
"""Nodes of the view that a band is drawn as."""
_CORNERS = 16
"""Corners of each ring of the tube."""
_RING_CORNERS = 40
"""Corners of the ellipse of a surfacing."""
_RINGS_MAX = 320
_OPACITY = 0.14
_FILL_OPACITY = 0.22
_RING_PX = 1.2
_SUNK = 0.02
"""So far below the surface an ellipse is drawn, as a part of its longer half axis, so that it does
not flicker with the surface."""


def draw_band(stage: Stage, band: BandView) -> None:
    """Draw the tube that holds ``band.level`` of the flights, and their surfacings' ellipses."""
    vertices, faces = tube(band)
    if len(faces) > 0:
        stage.mesh(TUBE, ned_to_enu(vertices), faces, BAND, _OPACITY)
    rings = surfacing_rings(band)
    if len(rings) > 0:
        segments = np.stack([rings, np.roll(rings, -1, axis=1)], axis=2).reshape(-1, 2, 3)
        stage.lines(SURFACINGS, ned_to_enu(segments), BAND, _RING_PX)
        stage.mesh(FILLS, ned_to_enu(rings.reshape(-1, 3)), _fans(len(rings)), BAND, _FILL_OPACITY)


def tube(band: BandView) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Span a surface around the stations of a band, each leg for itself.

    A station is an ellipsoid; a ring of the tube is where it is widest across the track.

    Returns:
        Vertices, shape ``(v, 3)``, NED m, and triangles between them, shape ``(f, 3)``.
    """
    vertices: list[FloatArray] = []
    faces: list[npt.NDArray[np.int64]] = []
    legs = np.unique(band.leg)
    each = max(2, _RINGS_MAX // max(1, len(legs)))
    for leg in legs:
        here = np.flatnonzero(band.leg == leg)
        if len(here) < 2:
            continue
        here = here[evenly_spread(len(here), each)]
        faces.append(_skin(len(here)) + _CORNERS * sum(map(len, vertices)))
        vertices.append(_rings(band, here))
    if not vertices:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    return np.concatenate(vertices).reshape(-1, 3), np.concatenate(faces)


def _rings(band: BandView, stations: IntArray) -> FloatArray:
    """Return the ring about each of these stations of one leg, shape ``(n, corners, 3)``, NED m."""
    centres = band.centre_ned[stations]
    along = np.gradient(centres, axis=0)
    level = np.column_stack([-along[:, 1], along[:, 0], np.zeros(len(along))])
    level = _units(level, np.array([0.0, 1.0, 0.0]))
    upright = _units(np.cross(along, level), np.array([0.0, 0.0, 1.0]))
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)[:, None]
    across = np.cos(angle) * level[:, None, :] + np.sin(angle) * upright[:, None, :]
    # an ellipsoid of the matrix E reaches to E u / sqrt(u' E u) in the direction u
    reach = np.einsum("nij,ncj->nci", _ellipsoids(band, stations), across)
    far = np.sqrt(np.maximum(np.einsum("nci,nci->nc", reach, across), 1e-12))
    rings = centres[:, None, :] + reach / far[..., None]
    rings[..., 2] = np.maximum(rings[..., 2], 0.0)
    return rings


def _ellipsoids(band: BandView, stations: IntArray) -> FloatArray:
    """Return the matrix of the ellipsoid at each station, shape ``(n, 3, 3)``, m2."""
    cos, sin = np.cos(band.direction_rad[stations]), np.sin(band.direction_rad[stations])
    zero, one = np.zeros_like(cos), np.ones_like(cos)
    turn = np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]]).transpose(2, 0, 1)
    return np.einsum("nij,nj,nkj->nik", turn, band.half_axes_m[stations] ** 2, turn)


def _units(vectors: FloatArray, otherwise: FloatArray) -> FloatArray:
    """Return vectors of length 1, shape ``(n, 3)``; ``otherwise`` where one has no direction."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), otherwise)


def _skin(rings: int) -> npt.NDArray[np.int64]:
    """Return the triangles between so many rings, one behind the other."""
    here = np.arange((rings - 1) * _CORNERS).reshape(-1, _CORNERS)
    beside = np.roll(here, -1, axis=1)
    near = np.stack([here, beside, here + _CORNERS], axis=-1)
    far = np.stack([beside, beside + _CORNERS, here + _CORNERS], axis=-1)
    return np.concatenate([near, far], axis=1).reshape(-1, 3)


def surfacing_rings(band: BandView) -> FloatArray:
    """Return the outline of each surfacing's ellipse, shape ``(k, corners, 3)``, NED m."""
    angle = np.linspace(0.0, 2.0 * np.pi, _RING_CORNERS, endpoint=False)
    long, short = band.surfacing_axes_m.T[:, :, None]
    cos, sin = np.cos(band.surfacing_rad)[:, None], np.sin(band.surfacing_rad)[:, None]
    along, across = long * np.cos(angle), short * np.sin(angle)
    north = band.surfacing_ne_m[:, :1] + along * cos - across * sin
    east = band.surfacing_ne_m[:, 1:] + along * sin + across * cos
    down = np.broadcast_to(_SUNK * long, north.shape)
    return np.stack([north, east, down], axis=-1)


def _fans(count: int) -> npt.NDArray[np.int64]:
    """Return the triangles that fill so many outlines."""
    second = np.arange(1, _RING_CORNERS - 1)
    fan = np.stack([np.zeros_like(second), second, second + 1], axis=-1)
    return (fan + _RING_CORNERS * np.arange(count)[:, None, None]).reshape(-1, 3)
