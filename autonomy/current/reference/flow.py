"""Covariance of a current and the way along a table of it, as they are written."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.kernel import (
    BASIN_MEMORY,
    BASIN_STD,
    CHANGING_MEMORY,
    CHANGING_STD,
    EDDY_LENGTH,
    EDDY_MEMORY,
    EDDY_STD,
    INCOMPRESSIBLE,
    REACH,
    SHEAR_LENGTH,
    SHEAR_STD,
    TIDES,
    TURN_RATE,
)
from autonomy.current.table import FlowTable, flow_at


def flow_covariance(a: FloatArray, b: FloatArray, parameters: FloatArray) -> FloatArray:
    """Return the covariance of the current between points; the readable form of ``cross_gram``.

    Args:
        a: Points, shape ``(n, 4)``: north, east, depth, m, and time, s.
        b: Points, shape ``(m, 4)``.
        parameters: Settings as ``packed`` returns them.

    Returns:
        Shape ``(n, m, 2, 2)``, m²/s².
    """
    p = parameters
    offset = a[:, None, :] - b[None, :, :]  # (n, m, 4)
    D, dz, dt = offset[..., :2], offset[..., 2], offset[..., 3]
    r2, T = np.sum(D**2, axis=-1), np.abs(dt)
    eye = np.eye(2)
    near = np.exp(-r2 / (2.0 * p[REACH] ** 2))
    scalar = p[BASIN_STD] ** 2 * np.exp(-T / p[BASIN_MEMORY])
    layers = np.exp(-(dz**2) / (2.0 * p[SHEAR_LENGTH] ** 2) - T / p[BASIN_MEMORY])
    scalar = scalar + p[SHEAR_STD] ** 2 * near * layers
    for std, period in p[TIDES:].reshape(-1, 2):
        scalar = scalar + std**2 * np.cos(2.0 * np.pi * dt / period) * near
    l2 = p[EDDY_LENGTH] ** 2
    eddy = p[EDDY_STD] ** 2 * np.exp(-r2 / (2.0 * l2) - T / p[EDDY_MEMORY])
    shape = np.broadcast_to(eye, (*r2.shape, 2, 2))
    if p[INCOMPRESSIBLE]:
        outer = D[..., :, None] * D[..., None, :] / l2
        shape = (1.0 - r2 / l2)[..., None, None] * eye + outer
    changing = p[CHANGING_STD] ** 2 * np.exp(-T / p[CHANGING_MEMORY]) * near
    cos, sin = np.cos(p[TURN_RATE] * dt), np.sin(p[TURN_RATE] * dt)
    turned = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)
    return (
        scalar[..., None, None] * eye
        + eddy[..., None, None] * shape
        + changing[..., None, None] * turned
    )


def displacement_along(
    table: FlowTable, time_s: FloatArray, position_ned: FloatArray
) -> tuple[float, float]:
    """Return how far a table's current carries a robot along a believed track; readable form."""
    carried = np.zeros(2)
    for i in range(len(time_s) - 1):
        middle = 0.5 * (position_ned[i] + position_ned[i + 1])
        at_s = 0.5 * (time_s[i] + time_s[i + 1])
        place = (middle[0] + carried[0], middle[1] + carried[1], middle[2])
        u = np.array(flow_at(table, place[0], place[1], place[2], at_s))
        carried += u * (time_s[i + 1] - time_s[i])
    return float(carried[0]), float(carried[1])
