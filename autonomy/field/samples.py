"""Samples of one field as a model takes them: where, what, how well located, in which dive."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.field.reckoning import Reckoning, reckoned

_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class FieldSamples:
    """Measurements in order of arrival, ``n`` of them.

    The position errors of one dive go together, from the fix at the surface that begins it to the
    one that ends it: ``reckoning.position_error_covariance`` gives their covariance.
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
    reckoning: Reckoning
    """What is known of their dives."""

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
        believed: npt.ArrayLike | None = None,
        end_s: npt.ArrayLike | None = None,
        jump_ne_m: npt.ArrayLike | None = None,
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
            believed: Where the robot believed to be, shape ``(n, 3)``, m; ``points`` if nothing was
                smoothed. How far smoothing moved a dive tells how far the fix at its end jumped.
            end_s: When that fix came, shape ``(n,)``, not a number where none did; about one
                sample after the last if not given.
            jump_ne_m: How far it jumped, shape ``(n, 2)``, where that is known otherwise.
            after: Samples of the same robot that came before, whose last dive may go on.

        Raises:
            ValueError: As ``checked`` does.
        """
        places, numbers = _array(points), _array(values)
        smoothed = _array(position_std_m)
        stated = smoothed if filtered_std_m is None else _array(filtered_std_m)
        made = checked(
            cls(
                points=places,
                values=numbers,
                position_std_m=smoothed,
                filtered_std_m=stated,
                dive=_dives(stated, after) if dive is None else np.asarray(dive, dtype=np.int64),
                time_s=np.zeros(numbers.shape) if time_s is None else _array(time_s),
                reckoning=Reckoning.unknown(len(numbers) if numbers.ndim else 0),
            )
        )
        return made.reckoned(
            believed=places if believed is None else _array(believed),
            end_s=None if end_s is None else _array(end_s),
            jump_ne_m=None if jump_ne_m is None else _array(jump_ne_m),
            after=after,
        )

    def reckoned(
        self,
        *,
        believed: FloatArray,
        end_s: FloatArray | None = None,
        jump_ne_m: FloatArray | None = None,
        after: "FieldSamples | None" = None,
    ) -> "FieldSamples":
        """Return these samples with what they show of their dives; arguments as those of ``of``."""
        goes_on = np.empty(0, dtype=np.int64)
        if after is not None and len(after) and len(self):
            goes_on = np.flatnonzero(after.dive == self.dive[0])
        before = after[goes_on] if after is not None else self[:0]
        moved = (self.points - believed)[:, :2]
        found = reckoned(
            np.concatenate([before.time_s, self.time_s]),
            np.concatenate([before.filtered_std_m, self.filtered_std_m]),
            np.concatenate([before.position_std_m, self.position_std_m]),
            np.concatenate([before.dive, self.dive]),
            moved_ne_m=np.concatenate([np.zeros((len(before), 2)), moved]),
            end_s=end_s,
            jump_ne_m=jump_ne_m,
        )
        return replace(self, reckoning=found[len(before) :])

    @classmethod
    def none(cls) -> "FieldSamples":
        """Return no samples."""
        nothing = np.empty(0)
        return cls(
            np.empty((0, 3)),
            nothing,
            nothing,
            nothing,
            np.empty(0, dtype=np.int64),
            nothing,
            Reckoning.unknown(0),
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
            self.reckoning[chosen],
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
        a.reckoning.followed_by(b.reckoning),
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


def _array(given: npt.ArrayLike) -> FloatArray:
    return np.asarray(given, dtype=np.float64)


def _dives(stated_std_m: FloatArray, after: FieldSamples | None) -> IntArray:
    before = after is not None and len(after) > 0
    last_std = after.filtered_std_m[-1:] if after is not None and before else stated_std_m[:1]
    last_dive = int(after.dive[-1]) if after is not None and before else 0
    falls = np.diff(stated_std_m.reshape(-1), prepend=last_std) < 0.0
    return last_dive + np.cumsum(falls, dtype=np.int64)
