r"""Prior covariance of a current, between places and between integrals of it along tracks.

The current :math:`u(p)` at :math:`p = (x, y, z, t)` has mean 0 and, with :math:`D` the horizontal
offset, :math:`r = |D|` and :math:`T = |\delta t|`, the covariance

.. math::
    K = \sigma_u^2 e^{-T/\tau_u} I
      + \sigma_e^2 e^{-r^2/2l^2 - T/\tau_e} \big[(1 - r^2/l^2) I + D D^T/l^2\big]
      + \sigma_f^2 e^{-T/\tau_f - r^2/2L^2} \mathrm{Rot}(f \delta t)
      + \sigma_z^2 e^{-\delta z^2/2l_z^2 - r^2/2L^2 - T/\tau_u} I
      + \sum_k \sigma_k^2 \cos(2\pi \delta t/P_k) e^{-r^2/2L^2} I .

The second term is the covariance of a flow whose stream function has a squared exponential kernel
of variance :math:`\sigma_e^2 l^2`: it has no divergence.

Source:
    Lee, Zhang and others 2019 (incompressible flow from glider drift); Wahlstrom and others 2013
    (divergence-free kernels).
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, kernel
from autonomy.current.config import CurrentMapConfig

(
    BASIN_STD,
    BASIN_MEMORY,
    EDDY_STD,
    EDDY_LENGTH,
    EDDY_MEMORY,
    INCOMPRESSIBLE,
    CHANGING_STD,
    CHANGING_MEMORY,
    TURN_RATE,
    SHEAR_STD,
    SHEAR_LENGTH,
    REACH,
    TIDES,
) = range(13)
"""Places of the packed settings; from ``TIDES`` on, a standard deviation and a period, s, each."""
EARTH_RATE_RAD_S = 7.2921159e-5
_S_IN_H = 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class Functionals:
    """Integrals of the current over time along tracks, as weighted sums over points."""

    points: FloatArray
    """North, east, depth, m, and time, s, shape ``(n, m, 4)``."""
    weights: FloatArray
    """Weight of each point, shape ``(n, m)``: s for a displacement, 1 for a current."""

    def __len__(self) -> int:
        """Return how many there are; each has a north and an east component."""
        return len(self.points)


def at_points(points: FloatArray) -> Functionals:
    """Return the functionals that are the current itself at points of shape ``(n, 4)``."""
    return Functionals(np.ascontiguousarray(points[:, None, :]), np.ones((len(points), 1)))


def joined(functionals: list[Functionals]) -> Functionals:
    """Return functionals of equally many points one after the other."""
    return Functionals(
        np.concatenate([one.points for one in functionals]),
        np.concatenate([one.weights for one in functionals]),
    )


def packed(config: CurrentMapConfig, latitude_deg: float = 0.0) -> FloatArray:
    """Return the settings as compiled code takes them."""
    turn = 2.0 * EARTH_RATE_RAD_S * math.sin(math.radians(latitude_deg)) if config.inertial else 0.0
    tides = zip(config.tide_std_m_s, config.tide_periods_h, strict=True)
    return np.array(
        [
            config.basin_std_m_s,
            config.basin_memory_s,
            config.eddy_std_m_s,
            config.eddy_length_m,
            config.eddy_memory_s,
            float(config.incompressible),
            config.changing_std_m_s,
            config.changing_memory_s,
            turn,
            config.shear_std_m_s,
            config.shear_length_m,
            config.reach_m,
            *(number for std, period in tides for number in (std, _S_IN_H * period)),
        ]
    )


def flow_covariance(a: FloatArray, b: FloatArray, parameters: FloatArray) -> FloatArray:
    """Return the covariance of the current between points; the readable form of ``gram``.

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


@inlined_kernel
def _covariance(
    x: float, y: float, z: float, t: float, p: FloatArray
) -> tuple[float, float, float, float]:
    """Return north-north, east-east, the even and the odd part of north-east at an offset."""
    r2 = x * x + y * y
    T = abs(t)
    scalar = 0.0
    if p[BASIN_STD] > 0.0 or p[SHEAR_STD] > 0.0:
        slow = math.exp(-T / p[BASIN_MEMORY])
        scalar += p[BASIN_STD] ** 2 * slow
    else:
        slow = 0.0
    near = math.exp(-r2 / (2.0 * p[REACH] ** 2))
    if p[SHEAR_STD] > 0.0:
        layer = math.exp(-z * z / (2.0 * p[SHEAR_LENGTH] ** 2))
        scalar += p[SHEAR_STD] ** 2 * slow * near * layer
    for k in range(TIDES, len(p), 2):
        if p[k] > 0.0:
            scalar += p[k] ** 2 * math.cos(2.0 * math.pi * t / p[k + 1]) * near
    odd = 0.0
    if p[CHANGING_STD] > 0.0:
        changing = p[CHANGING_STD] ** 2 * math.exp(-T / p[CHANGING_MEMORY]) * near
        if p[TURN_RATE] != 0.0:
            odd = changing * math.sin(p[TURN_RATE] * t)
            changing *= math.cos(p[TURN_RATE] * t)
        scalar += changing
    north, east, even = scalar, scalar, 0.0
    if p[EDDY_STD] > 0.0:
        l2 = p[EDDY_LENGTH] ** 2
        eddy = p[EDDY_STD] ** 2 * math.exp(-r2 / (2.0 * l2) - T / p[EDDY_MEMORY])
        if p[INCOMPRESSIBLE] > 0.0:
            north += eddy * (1.0 - y * y / l2)
            east += eddy * (1.0 - x * x / l2)
            even = eddy * x * y / l2
        else:
            north += eddy
            east += eddy
    return north, east, even, odd


@kernel
def gram(
    a: FloatArray,
    a_weights: FloatArray,
    b: FloatArray,
    b_weights: FloatArray,
    parameters: FloatArray,
    is_same: bool,
) -> FloatArray:
    """Return the covariance between functionals (``Functionals``).

    Args:
        a: Points, shape ``(n, k, 4)``.
        a_weights: Their weights, shape ``(n, k)``.
        b: Points, shape ``(m, l, 4)``.
        b_weights: Their weights, shape ``(m, l)``.
        parameters: Settings as ``packed`` returns them; a part of standard deviation 0 is left out.
        is_same: Whether both are the same; then half of the work is saved.

    Returns:
        Shape ``(2n, 2m)``; rows and columns are north and east of the first, of the second, ...
    """
    n, m = len(a), len(b)
    found = np.empty((2 * n, 2 * m))
    for i in range(n):
        for j in range(i + 1 if is_same else m):
            north, east, even, odd = 0.0, 0.0, 0.0, 0.0
            for k in range(a.shape[1]):
                for q in range(b.shape[1]):
                    w = a_weights[i, k] * b_weights[j, q]
                    nn, ee, ne, turned = _covariance(
                        a[i, k, 0] - b[j, q, 0],
                        a[i, k, 1] - b[j, q, 1],
                        a[i, k, 2] - b[j, q, 2],
                        a[i, k, 3] - b[j, q, 3],
                        parameters,
                    )
                    north += w * nn
                    east += w * ee
                    even += w * ne
                    odd += w * turned
            if is_same and i == j:
                odd = 0.0  # but for rounding
            found[2 * i, 2 * j] = north
            found[2 * i + 1, 2 * j + 1] = east
            found[2 * i, 2 * j + 1] = even - odd
            found[2 * i + 1, 2 * j] = even + odd
            if is_same and i != j:
                found[2 * j, 2 * i] = north
                found[2 * j + 1, 2 * i + 1] = east
                found[2 * j + 1, 2 * i] = even - odd
                found[2 * j, 2 * i + 1] = even + odd
    return found


def gram_of(functionals: Functionals, parameters: FloatArray) -> FloatArray:
    """Return the covariance of functionals with each other, shape ``(2n, 2n)``."""
    points, weights = functionals.points, functionals.weights
    return gram(points, weights, points, weights, parameters, True)


def cross_gram(a: Functionals, b: Functionals, parameters: FloatArray) -> FloatArray:
    """Return the covariance of functionals with others, shape ``(2n, 2m)``."""
    return gram(a.points, a.weights, b.points, b.weights, parameters, False)


def prior_blocks(functionals: Functionals, parameters: FloatArray) -> FloatArray:
    """Return the prior covariance of each functional with itself, shape ``(n, 2, 2)``."""
    return own_covariances(functionals.points, functionals.weights, parameters)


@kernel
def own_covariances(points: FloatArray, weights: FloatArray, parameters: FloatArray) -> FloatArray:
    """Return the diagonal blocks of ``gram``, shape ``(n, 2, 2)``."""
    n, m = weights.shape
    found = np.empty((n, 2, 2))
    for i in range(n):
        north, east, both = 0.0, 0.0, 0.0
        for k in range(m):
            for q in range(m):
                nn, ee, ne, _ = _covariance(
                    points[i, k, 0] - points[i, q, 0],
                    points[i, k, 1] - points[i, q, 1],
                    points[i, k, 2] - points[i, q, 2],
                    points[i, k, 3] - points[i, q, 3],
                    parameters,
                )
                w = weights[i, k] * weights[i, q]
                north += w * nn
                east += w * ee
                both += w * ne
        found[i, 0, 0] = north
        found[i, 1, 1] = east
        found[i, 0, 1] = both
        found[i, 1, 0] = both
    return found


def warm_up() -> None:
    """Compile what the station calls."""
    points = np.zeros((1, 2, 4))
    weights = np.ones((1, 2))
    parameters = packed(CurrentMapConfig())
    gram(points, weights, points, weights, parameters, True)
    own_covariances(points, weights, parameters)
