"""Samples of one field as a model takes them: where, what, how well located, in which dive."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from autonomy.arrays import BoolArray, FloatArray, IntArray

_TOLERANCE = 1e-9
_LEAST_STD_M = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class FieldSamples:
    """Measurements in order of arrival, ``n`` of them.

    The position errors of one dive are one random walk, which a fix at the surface begins and
    ends: ``position_error_covariance`` gives their covariance.
    """

    points: FloatArray
    """Estimated positions in the site's NED frame, shape ``(n, 3)``, m."""
    values: FloatArray
    """Measurements in the variable's unit, shape ``(n,)``."""
    position_std_m: FloatArray
    """Standard deviation of each horizontal position, shape ``(n,)``; the smoothed one where the
    dive was smoothed."""
    filtered_std_m: FloatArray
    """Standard deviation that the robot stated when it measured, never smaller, shape ``(n,)``."""
    dive: IntArray
    """Number of the dive, the same for samples between the same two fixes, shape ``(n,)``."""
    time_s: FloatArray
    """When each was measured, shape ``(n,)``."""

    @classmethod
    def of(
        cls,
        points: npt.ArrayLike,
        values: npt.ArrayLike,
        position_std_m: npt.ArrayLike,
        *,
        filtered_std_m: npt.ArrayLike | None = None,
        dive: npt.ArrayLike | None = None,
        time_s: npt.ArrayLike | None = None,
        after: "FieldSamples | None" = None,
    ) -> "FieldSamples":
        """Make samples of arrays, and check them.

        Args:
            points: Estimated positions, shape ``(n, 3)``, m.
            values: Measurements, shape ``(n,)``.
            position_std_m: Standard deviation of each horizontal position, shape ``(n,)``.
            filtered_std_m: As stated by the robot; ``position_std_m`` if nothing was smoothed.
            dive: Number of each sample's dive; without it a new dive begins where the stated
                standard deviation falls.
            time_s: Times of the samples; 0 without them.
            after: Samples of the same robot that came before, whose last dive may go on.

        Raises:
            ValueError: As ``checked`` does.
        """
        numbers = np.asarray(values, dtype=np.float64)
        stated = np.asarray(
            position_std_m if filtered_std_m is None else filtered_std_m, dtype=np.float64
        )
        return checked(
            cls(
                points=np.asarray(points, dtype=np.float64),
                values=numbers,
                position_std_m=np.asarray(position_std_m, dtype=np.float64),
                filtered_std_m=stated,
                dive=_dives(stated, after) if dive is None else np.asarray(dive, dtype=np.int64),
                time_s=np.zeros(numbers.shape)
                if time_s is None
                else np.asarray(time_s, dtype=np.float64),
            )
        )

    @classmethod
    def none(cls) -> "FieldSamples":
        """Return no samples."""
        nothing = np.empty(0)
        return cls(
            np.empty((0, 3)), nothing, nothing, nothing, np.empty(0, dtype=np.int64), nothing
        )

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.values)

    def __getitem__(self, chosen: slice | IntArray | BoolArray) -> "FieldSamples":
        """Return some of the samples, by slice, indices or mask."""
        return FieldSamples(
            self.points[chosen],
            self.values[chosen],
            self.position_std_m[chosen],
            self.filtered_std_m[chosen],
            self.dive[chosen],
            self.time_s[chosen],
        )


def joined(a: FieldSamples, b: FieldSamples) -> FieldSamples:
    """Return the samples of ``a``, then those of ``b``; equal dive numbers mean the same dive."""
    return FieldSamples(
        np.concatenate([a.points, b.points]),
        np.concatenate([a.values, b.values]),
        np.concatenate([a.position_std_m, b.position_std_m]),
        np.concatenate([a.filtered_std_m, b.filtered_std_m]),
        np.concatenate([a.dive, b.dive]),
        np.concatenate([a.time_s, b.time_s]),
    )


def checked(samples: FieldSamples) -> FieldSamples:
    """Return the samples if every model can use them.

    Raises:
        ValueError: If shapes disagree, a number is not finite, a standard deviation is negative,
            or a smoothed one exceeds the filtered one.
    """
    n = len(samples.values) if samples.values.ndim == 1 else -1
    if samples.points.shape != (n, 3):
        raise ValueError(
            f"samples need points (n, 3) and values (n,), not "
            f"{samples.points.shape} and {samples.values.shape}"
        )
    columns = {
        "points": samples.points,
        "values": samples.values,
        "position_std_m": samples.position_std_m,
        "filtered_std_m": samples.filtered_std_m,
        "dive": samples.dive,
        "time_s": samples.time_s,
    }
    for name, column in columns.items():
        if len(column) != n or column.ndim != (2 if name == "points" else 1):
            raise ValueError(f"samples need {name} for {n} values, not {column.shape}")
        width = 3 if name == "points" else 1
        finite = np.isfinite(column.reshape(n, width)).all(axis=1)
        if not finite.all():
            raise ValueError(f"{name} of sample {int(np.argmin(finite))} is not finite")
    if (samples.position_std_m < 0.0).any():
        raise ValueError("position_std_m must not be negative")
    if (samples.position_std_m > samples.filtered_std_m * (1.0 + _TOLERANCE) + _TOLERANCE).any():
        raise ValueError("position_std_m must not exceed filtered_std_m: smoothing only improves")
    return samples


def position_error_covariance(a: FieldSamples, b: FieldSamples) -> FloatArray:
    r"""Return the covariance of the position errors of samples, on each horizontal axis.

    Between two fixes the error of the filter is a random walk :math:`W` with
    :math:`Var W_i = f_i^2`, so :math:`Cov(W_i, W_j) = \min(f_i^2, f_j^2)`. A fix at the end of the
    dive tells the whole walk, which leaves
    :math:`\min(f_i^2, f_j^2) - \sqrt{(f_i^2 - s_i^2)(f_j^2 - s_j^2)}` with the smoothed standard
    deviation :math:`s`. This is :math:`s_i s_j \min(c_i, c_j) / \max(c_i, c_j)` with
    :math:`c = f^2 / s`, which is a covariance also where a robot states what no random walk can.
    Samples of different dives are independent.

    Args:
        a: ``n`` samples.
        b: ``m`` samples.

    Returns:
        Shape ``(n, m)``, m^2.
    """
    clock_a, clock_b = _clock(a), _clock(b)
    covariance = np.minimum.outer(clock_a, clock_b) / np.maximum.outer(clock_a, clock_b)
    covariance *= np.multiply.outer(a.position_std_m, b.position_std_m)
    covariance[np.not_equal.outer(a.dive, b.dive)] = 0.0
    return covariance


def _clock(samples: FieldSamples) -> FloatArray:
    stated = np.maximum(samples.filtered_std_m, _LEAST_STD_M)
    return np.square(stated) / np.maximum(samples.position_std_m, _LEAST_STD_M)


def _dives(stated_std_m: FloatArray, after: FieldSamples | None) -> IntArray:
    before = after is not None and len(after) > 0
    last_std = after.filtered_std_m[-1:] if after is not None and before else stated_std_m[:1]
    last_dive = int(after.dive[-1]) if after is not None and before else 0
    falls = np.diff(stated_std_m.reshape(-1), prepend=last_std) < 0.0
    return last_dive + np.cumsum(falls, dtype=np.int64)
