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
_JITTER = 1e-9
_JITTER_TRIES = 2
_BLOCK = 40_000
"""Pairs of points that are worked on at once, so that they stay in the processor's cache."""


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


def _parts(
    x: FloatArray, y: FloatArray, z: FloatArray, t: FloatArray, p: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray | None, FloatArray | None]:
    """Return north-north, east-east, the even and the odd part of north-east at offsets.

    What is ``None`` is 0 everywhere; a part of standard deviation 0 is not worked out.
    """
    r2 = x * x + y * y
    T = np.abs(t)
    scalar = np.zeros_like(r2)
    near = np.exp(r2 * (-0.5 / p[REACH] ** 2))
    if p[BASIN_STD] > 0.0 or p[SHEAR_STD] > 0.0:
        slow = np.exp(T * (-1.0 / p[BASIN_MEMORY]))
        if p[SHEAR_STD] > 0.0:
            layer = np.exp(z * z * (-0.5 / p[SHEAR_LENGTH] ** 2))
            layer *= near
            layer *= p[SHEAR_STD] ** 2
            layer += p[BASIN_STD] ** 2
            slow *= layer
        else:
            slow *= p[BASIN_STD] ** 2
        scalar += slow
    odd: FloatArray | None = None
    for std, period in p[TIDES:].reshape(-1, 2).tolist():
        if std > 0.0:
            scalar += std**2 * np.cos(t * (2.0 * math.pi / period)) * near
    if p[CHANGING_STD] > 0.0:
        changing = p[CHANGING_STD] ** 2 * np.exp(T * (-1.0 / p[CHANGING_MEMORY])) * near
        if p[TURN_RATE] != 0.0:
            odd = changing * np.sin(p[TURN_RATE] * t)
            changing *= np.cos(p[TURN_RATE] * t)
        scalar += changing
    if p[EDDY_STD] == 0.0:
        return scalar, scalar, None, odd
    l2 = float(p[EDDY_LENGTH]) ** 2
    eddy = p[EDDY_STD] ** 2 * np.exp(r2 * (-0.5 / l2) + T * (-1.0 / p[EDDY_MEMORY]))
    if p[INCOMPRESSIBLE] == 0.0:
        scalar += eddy
        return scalar, scalar, None, odd
    scalar += eddy
    eddy *= 1.0 / l2
    return scalar - eddy * y * y, scalar - eddy * x * x, eddy * x * y, odd


def cross_gram(a: Functionals, b: Functionals, parameters: FloatArray) -> FloatArray:
    """Return the covariance of functionals with others.

    Args:
        a: Functionals.
        b: Functionals.
        parameters: Settings as ``packed`` returns them.

    Returns:
        Shape ``(2n, 2m)``; rows and columns are north and east of the first, of the second, ...
    """
    n, m = len(a), len(b)
    found = np.empty((n, 2, m, 2))
    columns = b.points.reshape(-1, 4).T  # (4, m q)
    rows = max(_BLOCK // max(columns.shape[1] * a.points.shape[1], 1), 1)
    for begin in range(0, n, rows):
        block = slice(begin, begin + rows)
        points = a.points[block].reshape(-1, 4).T  # (4, r k)
        x, y, z, t = (points[i][:, None] - columns[i][None, :] for i in range(4))
        north, east, even, odd = _parts(x, y, z, t, parameters)

        def summed(part: FloatArray | None, weights: FloatArray = a.weights[block]) -> FloatArray:
            """Return the weighted sums over the points of each pair, shape ``(r, m)``."""
            if part is None:
                return np.zeros((len(weights), m))
            by_column = part.reshape(-1, m, b.weights.shape[1])
            one = np.einsum("amq,mq->am", by_column, b.weights)
            return np.einsum("rk,rkm->rm", weights, one.reshape(*weights.shape, m))

        both, turned = summed(even), summed(odd)
        found[block, 0, :, 0] = summed(north)
        found[block, 1, :, 1] = found[block, 0, :, 0] if east is north else summed(east)
        found[block, 0, :, 1] = both - turned
        found[block, 1, :, 0] = both + turned
    return found.reshape(2 * n, 2 * m)


def gram_of(functionals: Functionals, parameters: FloatArray) -> FloatArray:
    """Return the covariance of functionals with each other, symmetric, shape ``(2n, 2n)``."""
    found = cross_gram(functionals, functionals, parameters)
    return 0.5 * (found + found.T)


def prior_blocks(functionals: Functionals, parameters: FloatArray) -> FloatArray:
    """Return the prior covariance of each functional with itself, shape ``(n, 2, 2)``."""
    points, weights = functionals.points, functionals.weights
    between = points[:, :, None, :] - points[:, None, :, :]  # (n, k, k, 4)
    x, y, z, t = (between[..., i] for i in range(4))
    north, east, even, _ = _parts(x, y, z, t, parameters)
    found = np.zeros((len(points), 2, 2))
    for row, column, part in ((0, 0, north), (1, 1, east), (0, 1, even), (1, 0, even)):
        if part is not None:
            found[:, row, column] = np.einsum("nk,nkq,nq->n", weights, part, weights)
    return found


def factor_of(covariance: FloatArray) -> FloatArray | None:
    """Return the lower Cholesky factor of a covariance, helped twice if need be; None without."""
    if not len(covariance):
        return covariance
    help_m2 = _JITTER * float(np.trace(covariance)) / len(covariance)
    for tries in range(_JITTER_TRIES + 1):
        try:
            helped = covariance + tries * help_m2 * np.eye(len(covariance))
            return np.asarray(np.linalg.cholesky(helped), dtype=np.float64)
        except np.linalg.LinAlgError:
            continue
    return None
