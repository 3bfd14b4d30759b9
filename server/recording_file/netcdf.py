"""What readers of NetCDF share: opening a file, and its variables as numbers.

``netCDF4`` is a part of the extra ``delivery``; a library in C reads what somebody sent, so this
runs in a worker process.
"""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

from autonomy.arrays import FloatArray
from server.recording_file.raw import UnreadableError

EXTRA: Final = "pip install 'grace-ground-station[delivery]'"


@contextmanager
def opened(path: Path, name: str) -> Generator[Any]:
    """Open a file.

    Raises:
        UnreadableError: If it cannot be read, or the reader is not installed.
    """
    try:
        import netCDF4
    except ImportError:
        raise UnreadableError(
            f"{name} is NetCDF, whose reader is not installed: {EXTRA}."
        ) from None
    try:
        file = netCDF4.Dataset(path)
    except (OSError, RuntimeError) as error:
        raise UnreadableError(f"{name} is no whole NetCDF file: {error}.") from None
    try:
        file.set_auto_maskandscale(True)
        yield file
    except (OSError, RuntimeError, IndexError) as error:
        raise UnreadableError(f"{name} is truncated or broken: {error}.") from error
    finally:
        file.close()


def numbers(variable: Any) -> FloatArray:  # noqa: ANN401 - netCDF4 has no types
    """Return a variable as floats, NaN where the file has none."""
    found = np.ma.masked_invalid(np.ma.asarray(variable[:]).astype(np.float64))
    return np.ma.filled(found, np.nan).reshape(-1)


def is_number(variable: Any) -> bool:  # noqa: ANN401 - as above
    """Tell whether a variable holds numbers."""
    return getattr(variable.dtype, "kind", "O") in "iuf"


def text_of(thing: Any, attribute: str) -> str:  # noqa: ANN401 - as above
    """Return an attribute as text, "" where there is none."""
    return str(getattr(thing, attribute, "") or "").strip()


def epoch_seconds(variable: Any, name: str) -> FloatArray:  # noqa: ANN401 - as above
    """Return times in seconds from the epoch.

    Raises:
        UnreadableError: If the unit counts from no moment.
    """
    import cftime

    values, unit = numbers(variable), " ".join(text_of(variable, "units").split())
    calendar = text_of(variable, "calendar") or "standard"
    try:
        start, one = cftime.num2date([0, 1], unit, calendar, only_use_cftime_datetimes=False)
        offset = float(cftime.date2num(start, "seconds since 1970-01-01", "standard"))
    except (ValueError, TypeError, OverflowError):
        raise UnreadableError(
            f"{name}: the unit {unit!r} of {variable.name} does not say from when it counts."
        ) from None
    return offset + values * (one - start).total_seconds()
