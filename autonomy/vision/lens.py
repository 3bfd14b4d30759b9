r"""Lenses: which pixel shows a point, and along which ray a pixel looks.

Camera axes are x right and y down in the picture, z forward. The centre of the first pixel is
(0, 0). With :math:`x = X/Z, y = Y/Z, r^2 = x^2 + y^2` a *pinhole* lens bends to

.. math::

    x' = x (1 + k_1 r^2 + k_2 r^4 + k_3 r^6) + 2 p_1 x y + p_2 (r^2 + 2 x^2), \\
    y' = y (1 + k_1 r^2 + k_2 r^4 + k_3 r^6) + p_1 (r^2 + 2 y^2) + 2 p_2 x y

and a *fisheye* lens, with :math:`t = \arctan r`, to :math:`(x', y') = (x, y) t'/r`,
:math:`t' = t (1 + k_1 t^2 + k_2 t^4 + k_3 t^6 + k_4 t^8)`. The pixel is
:math:`u = f_x x' + c_x, v = f_y y' + c_y`.

Beyond some distance from the axis a polynomial may fall again: the model folds over there, and says
nothing of the lens. What lies beyond has no pixel, and a pixel beyond has no ray.

Source:
    Brown, Photogrammetric Engineering 37 (8), 1971; Kannala and Brandt, IEEE Trans. Pattern
    Analysis 28 (8), 2006. Names and order of the coefficients are those of OpenCV.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from autonomy.arrays import BoolArray, FloatArray
from autonomy.vision import lens_kernel as kernel

LensKind = Literal["pinhole", "fisheye"]
COEFFICIENTS = {"pinhole": ("k1", "k2", "p1", "p2", "k3"), "fisheye": ("k1", "k2", "k3", "k4")}
"""Names of the distortion's coefficients, in order."""
PARAMETERS = kernel.PARAMETERS
_SMALLEST_PX, _LARGEST_PX = 64, 4096


@dataclass(frozen=True, slots=True)
class Lens:
    """One camera's lens, for pictures of one size.

    Raises:
        ValueError: If a number is not finite, a focal length is not positive, or a size is not one
            that cameras have.
    """

    kind: LensKind
    width_px: int
    height_px: int
    focal_px: tuple[float, float]
    """Focal lengths across and down."""
    principal_px: tuple[float, float]
    """Where the optical axis meets the picture."""
    distortion: tuple[float, ...] = ()
    """Coefficients in the order of ``COEFFICIENTS``; those that are left out are 0."""
    packed: FloatArray = field(init=False, repr=False, compare=False)
    """The same for the kernels (``lens_kernel``), shape ``(11,)``."""

    def __post_init__(self) -> None:
        if self.kind not in COEFFICIENTS:
            raise ValueError(f"lens: kind is {self.kind!r}, not pinhole or fisheye")
        for name, size in (("width_px", self.width_px), ("height_px", self.height_px)):
            if not _SMALLEST_PX <= size <= _LARGEST_PX:
                raise ValueError(f"lens: {name} is {size}, not {_SMALLEST_PX} to {_LARGEST_PX}")
        if not np.isfinite((*self.focal_px, *self.principal_px, *self.distortion)).all():
            raise ValueError("lens: a number is not finite")
        if min(self.focal_px) <= 0.0:
            raise ValueError(f"lens: focal_px is {self.focal_px}, not positive")
        names = COEFFICIENTS[self.kind]
        if len(self.distortion) > len(names):
            raise ValueError(f"lens: distortion has more coefficients than {', '.join(names)}")
        rest = (0.0,) * (5 - len(self.distortion))
        kind = kernel.PINHOLE if self.kind == "pinhole" else kernel.FISHEYE
        numbers = (kind, *self.focal_px, *self.principal_px, *self.distortion, *rest)
        packed = np.array([*numbers, 0.0])
        packed[kernel.FOLD] = fold(packed)
        object.__setattr__(self, "packed", packed)

    @classmethod
    def of_parameters(
        cls, kind: LensKind, width_px: int, height_px: int, parameters: FloatArray
    ) -> "Lens":
        """Return the lens of a parameter vector (``parameters``), shape ``(9,)``."""
        fx, fy, cx, cy, *distortion = parameters.tolist()
        coefficients = tuple(distortion[: len(COEFFICIENTS[kind])])
        return cls(kind, width_px, height_px, (fx, fy), (cx, cy), coefficients)

    @property
    def parameters(self) -> FloatArray:
        """Focal lengths, principal point and five coefficients, shape ``(9,)``."""
        return self.packed[kernel.FX : kernel.FOLD].copy()

    @property
    def is_free(self) -> BoolArray:
        """Which of ``parameters`` this kind of lens has, shape ``(9,)``."""
        return np.arange(PARAMETERS) < 4 + len(COEFFICIENTS[self.kind])

    def project(self, points_camera_m: npt.ArrayLike) -> FloatArray:
        """Return the pixels of points.

        Args:
            points_camera_m: In camera axes, shape ``(..., 3)``, m.

        Returns:
            Pixels, shape ``(..., 2)``, inside the picture or not; NaN for a point that is not
            before the camera or lies beyond the fold.
        """
        return self.project_with_slopes(points_camera_m)[0]

    def project_with_slopes(
        self, points_camera_m: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the pixels of points and how they change.

        Args:
            points_camera_m: In camera axes, shape ``(..., 3)``, m.

        Returns:
            Pixels ``(..., 2)``; their derivatives by the point ``(..., 2, 3)``, px/m; and by
            ``parameters`` ``(..., 2, 9)``.
        """
        points = np.asarray(points_camera_m, dtype=np.float64)
        flat = np.ascontiguousarray(points.reshape(-1, 3))
        pixels, slopes = np.empty((len(flat), 2)), np.empty((len(flat), 2, 12))
        kernel.project(self.packed, flat, pixels, slopes)
        shape = points.shape[:-1]
        return (
            pixels.reshape(*shape, 2),
            slopes[:, :, :3].reshape(*shape, 2, 3),
            slopes[:, :, 3:].reshape(*shape, 2, PARAMETERS),
        )

    def rays(self, pixels: npt.ArrayLike) -> FloatArray:
        """Return the rays along which pixels look, to 1e-9 px.

        Args:
            pixels: Shape ``(..., 2)``, px from the centre of the first pixel.

        Returns:
            Directions of length 1 in camera axes, shape ``(..., 3)``; NaN where the model folds
            over.
        """
        asked = np.asarray(pixels, dtype=np.float64)
        flat = np.ascontiguousarray(asked.reshape(-1, 2))
        directions = np.empty((len(flat), 3))
        kernel.rays(self.packed, flat, directions)
        return directions.reshape(*asked.shape[:-1], 3)

    def shows(self, pixels: npt.ArrayLike, margin_px: float = 0.0) -> BoolArray:
        """Tell which pixels lie in the picture, so far inside its border, shape ``(...)``."""
        asked = np.asarray(pixels, dtype=np.float64)
        u, v = asked[..., 0], asked[..., 1]
        inside_u = (u >= margin_px - 0.5) & (u <= self.width_px - 0.5 - margin_px)
        return inside_u & (v >= margin_px - 0.5) & (v <= self.height_px - 0.5 - margin_px)


def fold(packed: FloatArray) -> float:
    """Return where the radial part of a packed lens stops to rise.

    Args:
        packed: Packed lens of which this number may be missing, shape ``(11,)``.

    Returns:
        Square of the ray's slope (pinhole, infinite where it never does) or of its angle in rad
        (fisheye, at most a right angle).
    """
    d = packed[kernel.D0 : kernel.FOLD]
    if packed[kernel.KIND] == kernel.PINHOLE:
        rise, limit = (7.0 * d[4], 5.0 * d[1], 3.0 * d[0], 1.0), math.inf
    else:
        rise = (9.0 * d[3], 7.0 * d[2], 5.0 * d[1], 3.0 * d[0], 1.0)
        limit = (0.5 * math.pi) ** 2
    roots = np.roots(rise)
    real = roots.real[np.abs(roots.imag) <= 1e-9 * np.abs(roots.real)]
    return min((float(root) for root in real if 0.0 < root < limit), default=limit)
