"""What the station itself verifies of each file that it wrote, beyond the field's checkers.

They look whether names exist; this looks at what stands there. A fault is named with its cure.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import netCDF4
import numpy as np

from server.delivery.finding import Finding
from server.delivery.og1_channel import COLLECTION, TERMS
from server.delivery.og1_header import SIMULATED

VARIABLES: Final = (
    *("LATITUDE_GPS", "LONGITUDE_GPS", "TIME_GPS", "LATITUDE", "LONGITUDE", "TIME", "DEPTH"),
    *("TRAJECTORY", "PLATFORM_MODEL", "WMO_IDENTIFIER", "PLATFORM_SERIAL_NUMBER"),
    *("DEPLOYMENT_TIME", "DEPLOYMENT_LATITUDE", "DEPLOYMENT_LONGITUDE"),
)
"""Without which a file is none of OG1.0."""
ATTRIBUTES: Final = (
    *("title", "platform", "platform_vocabulary", "id", "comment", "contributor_name"),
    *("contributor_email", "contributor_role", "contributor_role_vocabulary"),
    *("contributing_institutions", "contributing_institutions_role"),
    *("contributing_institutions_role_vocabulary", "rtqc_method", "start_date", "date_created"),
    *("featureType", "Conventions"),
)
"""Global attributes without which it is none."""
_FIELD_OF: Final = {
    "contributor_name": "Principal investigator, name",
    "contributor_email": "Principal investigator, e-mail",
    "contributing_institutions": "Operating agency",
    "title": "Title of the file",
    "comment": "Comment",
}
"""Fields of the metadata form behind attributes."""
_DATE: Final = re.compile(r"\d{8}T\d{6}")
_DATES: Final = ("start_date", "date_created", "date_modified")
_AT_ONCE: Final = 262_144


def own_checks(path: Path, name: str) -> list[Finding]:
    """Return what is wrong with a file, which is to be called ``name``.

    A file that cannot be read is a finding, too; nothing is ever passed by mistake.
    """
    try:
        with netCDF4.Dataset(path) as file:
            file.set_auto_maskandscale(False)
            return [found for check in _CHECKS for found in check(file, name)]
    except (OSError, RuntimeError, IndexError, AttributeError, ValueError) as error:
        cure = "Write the file anew."
        return [Finding("readable", "", f"The file cannot be read: {error}", cure)]


def _mandatory(file: Any, name: str) -> Iterator[Finding]:  # noqa: ANN401 - netCDF4 has no types
    del name
    if "N_MEASUREMENTS" not in file.dimensions:
        yield Finding("mandatory", "N_MEASUREMENTS", "The dimension is missing.", _REWRITE)
    for variable in VARIABLES:
        if variable not in file.variables:
            yield Finding("mandatory", variable, "The variable is missing.", _REWRITE)
        elif file[variable].dtype is str and not str(file[variable][...]).strip():
            yield Finding("mandatory", variable, "The variable is empty.", _REWRITE)
    for attribute in ATTRIBUTES:
        if attribute not in file.ncattrs():
            what = "The global attribute is missing."
        elif not str(file.getncattr(attribute)).strip():
            what = "The global attribute is empty."
        else:
            continue
        yield Finding("mandatory", attribute, what, _cure(attribute))


def _cure(attribute: str) -> str:
    field = _FIELD_OF.get(attribute)
    return _REWRITE if field is None else f"Fill in {field} in the metadata, then write anew."


def _time(file: Any, name: str) -> Iterator[Finding]:  # noqa: ANN401 - netCDF4 has no types
    del name
    last, broken = -np.inf, 0
    for values in _parts(file, "TIME"):
        steps = np.diff(values, prepend=last)
        broken += int(np.count_nonzero(~np.isfinite(values) | ~(steps > 0.0)))
        last = values[-1]
    if broken:
        yield Finding("time", "TIME", f"{broken} times do not ascend strictly.", _REWRITE)


def _depth(file: Any, name: str) -> Iterator[Finding]:  # noqa: ANN401 - netCDF4 has no types
    del name
    if "DEPTH" not in file.variables:
        return
    fill = file["DEPTH"].getncattr("_FillValue")
    above = sum(
        int(np.count_nonzero((part < 0.0) & (part != fill))) for part in _parts(file, "DEPTH")
    )
    if above:
        cure = "Correct the zero of the depth sensor, or void what was measured ashore."
        yield Finding("depth", "DEPTH", f"{above} depths are above the surface.", cure)


def _flags(file: Any, name: str) -> Iterator[Finding]:  # noqa: ANN401 - netCDF4 has no types
    del name
    for key, variable in file.variables.items():
        if "flag_values" not in variable.ncattrs() or not variable.dimensions:
            continue
        known = np.append(variable.getncattr("flag_values"), variable.getncattr("_FillValue"))
        strange = sum(int(np.count_nonzero(~np.isin(part, known))) for part in _parts(file, key))
        if strange:
            yield Finding("flags", key, f"{strange} flags have no meaning.", _REWRITE)


def _names(file: Any, name: str) -> Iterator[Finding]:  # noqa: ANN401 - netCDF4 has no types
    told = {attribute: str(file.getncattr(attribute)) for attribute in file.ncattrs()}
    identity = told.get("id", "")
    if name != f"{identity}.nc":
        what = f"The file is called {name}, its id is {identity}."
        yield Finding("name", "id", what, _REWRITE)
    if "PLATFORM_SERIAL_NUMBER" in file.variables:
        serial = str(file["PLATFORM_SERIAL_NUMBER"][...])
        expected = f"{serial}_{told.get('start_date', '')}_{told.get('data_mode', '')}"
        if identity != expected:
            what = f"The id is {identity}, not {expected}."
            yield Finding("name", "id", what, _REWRITE)
    for date in _DATES:
        if date in told and not _DATE.fullmatch(told[date]):
            what = f"{told[date]} is not written like 20260921T141320."
            yield Finding("date", date, what, _REWRITE)


def _vocabulary(file: Any, name: str) -> Iterator[Finding]:  # noqa: ANN401 - netCDF4 has no types
    del name
    for key, variable in file.variables.items():
        if "vocabulary" not in variable.ncattrs():
            continue
        told = str(variable.getncattr("vocabulary"))
        term = told.removeprefix(COLLECTION).removesuffix("/")
        if told != f"{COLLECTION}{term}/" or term not in TERMS:
            what = f"{told} is no term of the vendored list."
            yield Finding("vocabulary", key, what, _REWRITE)


def _marks(file: Any, name: str) -> Iterator[Finding]:  # noqa: ANN401 - netCDF4 has no types
    told = {attribute: str(file.getncattr(attribute)) for attribute in file.ncattrs()}
    if told.get("is_simulated") != "yes":
        return
    marked = {
        "file": name.startswith("SIMULATION_"),
        "id": told.get("id", "").startswith("SIMULATION_"),
        "title": told.get("title", "").startswith("SIMULATION - "),
        "comment": told.get("comment", "").startswith(SIMULATED),
        "summary": told.get("summary", "").startswith(SIMULATED),
    }
    for what, is_marked in marked.items():
        if not is_marked:
            words = "A simulated robot's data do not say so here."
            yield Finding("marks", what, words, _REWRITE)


def _parts(file: Any, name: str) -> Iterator[np.ndarray]:  # noqa: ANN401 - netCDF4 has no types
    if name not in file.variables:
        return
    variable = file[name]
    for first in range(0, variable.shape[0], _AT_ONCE):
        yield variable[first : first + _AT_ONCE]


_REWRITE: Final = "Write the file anew; if this stays, it is a fault of the station."
_CHECKS: Final[tuple[Callable[[Any, str], Iterator[Finding]], ...]] = (
    _mandatory,
    _time,
    _depth,
    _flags,
    _names,
    _vocabulary,
    _marks,
)
