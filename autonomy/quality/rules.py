"""Rules of quality control: one versioned document, which a station or a robot may have its own of.

Numbers of the delivered set are defaults for cold to temperate water; a team sets its own.
"""

import hashlib
import math
from collections.abc import Mapping
from typing import Final

from pydantic import Field, ValidationInfo, field_validator

from autonomy.configuration import Configuration, quantity

KEPT: Final = {"is_kept": True}
"""Context to validate rules in that were kept: limits that contradict each other are let pass, as
catalogues and earlier versions of the station made them."""


def _limit(title: str, unit: str = "", *, ge: float | None = None) -> float | None:
    return quantity(None, unit, title=title, ge=ge)


class SeriesRule(Configuration):
    """Limits of one channel, in its own unit; what is left empty is not tested."""

    fail_low: float | None = _limit("Fails below")
    """Less than this cannot be."""
    fail_high: float | None = _limit("Fails above")
    """More than this cannot be."""
    suspect_low: float | None = _limit("Suspect below")
    """Less than this is unlikely here."""
    suspect_high: float | None = _limit("Suspect above")
    """More than this is unlikely here."""
    spike_suspect: float | None = _limit("Spike, suspect", ge=0.0)
    """Suspect where a value differs by more from the mean of its two neighbours."""
    spike_fail: float | None = _limit("Spike, fails", ge=0.0)
    """Fails where it differs by more than this."""
    rate_suspect: float | None = _limit("Rate of change, suspect", ge=0.0)
    """Suspect where it changed faster since the value before, per second."""
    flat_suspect_s: float | None = _limit("Flat line, suspect after", "s", ge=0.0)
    """Suspect once values have stayed within the tolerance for so long."""
    flat_fail_s: float | None = _limit("Flat line, fails after", "s", ge=0.0)
    """Fails once they have for so long."""
    flat_tolerance: float = quantity(0.0, title="Flat line, tolerance", ge=0.0)
    """Values that differ by less count as the same."""

    @field_validator("fail_high", "suspect_low", "suspect_high", "spike_fail", "flat_fail_s")
    @classmethod
    def _fits(cls, value: float | None, info: ValidationInfo) -> float | None:
        match info.field_name:
            case "fail_high":
                _refuse_unless(value, info, above="fail_low")
            case "suspect_low":
                _refuse_unless(value, info, least="fail_low", most="fail_high")
            case "suspect_high":
                _refuse_unless(value, info, above="suspect_low")
                _refuse_unless(value, info, least="fail_low", most="fail_high")
            case "spike_fail":
                _refuse_unless(value, info, least="spike_suspect")
            case _:
                _refuse_unless(value, info, least="flat_suspect_s")
        return value


def _refuse_unless(
    value: float | None, info: ValidationInfo, *, above: str = "", least: str = "", most: str = ""
) -> None:
    """Refuse a limit that is not where others, which are named, let it be.

    Raises:
        ValueError: With the limit that it breaks.
    """
    if value is None or (info.context or {}).get("is_kept"):
        return
    other = info.data.get(above)
    if other is not None and value <= other:
        raise ValueError(f"must be above {above} {other:g}; is {value:g}")
    other = info.data.get(least)
    if other is not None and value < other:
        raise ValueError(f"must not be below {least} {other:g}; is {value:g}")
    other = info.data.get(most)
    if other is not None and value > other:
        raise ValueError(f"must not be above {most} {other:g}; is {value:g}")


class PositionRule(Configuration):
    """Limits of where a robot can be, and how fast it gets there."""

    speed_suspect_m_s: float = quantity(1.0, "m/s", title="Speed, suspect", gt=0.0)
    """A place to which the robot would have moved faster is suspect."""
    speed_fail_m_s: float = quantity(3.0, "m/s", title="Speed, fails", gt=0.0)
    """One to which it would have moved faster than this fails."""
    margin_m: float = quantity(1000.0, "m", title="Margin around the water", ge=0.0)
    """A place farther outside of the water's bounds is suspect."""
    resolution_m: float = quantity(0.01, "m", title="Resolution of places", ge=0.0)
    """Places that differ by no more are the same: they are kept in whole millimetres."""

    @field_validator("speed_fail_m_s")
    @classmethod
    def _fits(cls, value: float, info: ValidationInfo) -> float:
        _refuse_unless(value, info, least="speed_suspect_m_s")
        return value


class DepthRule(Configuration):
    """Limits of depth."""

    margin_m: float = quantity(2.0, "m", title="Below the deepest place, fails", ge=0.0)
    """A depth fails where it is so far below the deepest place of the water."""
    above_m: float = quantity(1.0, "m", title="Above the surface, fails", ge=0.0)
    """A depth fails where it is so far above the surface; up to there it is suspect."""
    rate_suspect_m_s: float = quantity(1.0, "m/s", title="Vertical speed, suspect", gt=0.0)
    """Suspect where it changed faster since the one before."""
    resolution_m: float = quantity(0.01, "m", title="Resolution of depths", ge=0.0)
    """Depths that differ by no more are the same: they are kept in whole millimetres."""


class QualityRules(Configuration):
    """By what measurements are flagged; runs keep the rules that they followed."""

    name: str = Field(default="grace-qartod", title="Name", min_length=1, max_length=40)
    """Name of the set, as files cite it."""
    version: str = Field(
        default="1.0.0", title="Version", pattern=r"^\d{1,4}\.\d{1,4}\.\d{1,4}$", max_length=14
    )
    """Of the set, as files cite it: three numbers. Raise it with every change."""
    series: dict[str, SeriesRule] = Field(default_factory=dict, title="Channels")
    """Limits by the key of a channel. A channel without any fails outside of the range that the
    catalogue believes."""
    position: PositionRule = Field(default=PositionRule(), title="Position")
    """How a place is judged."""
    depth: DepthRule = Field(default=DepthRule(), title="Depth")
    """How a depth is judged."""

    def with_ranges(self, ranges: Mapping[str, tuple[float, float]]) -> "QualityRules":
        """Return the rules as they are applied: outside of a range values fail where none says.

        Args:
            ranges: What the catalogue believes, by channel; infinite where it has no end.
        """
        series = dict(self.series)
        for key, span in ranges.items():
            rule = series.get(key, SeriesRule())
            open_ends = {
                name: end
                for name, end in zip(("fail_low", "fail_high"), span, strict=True)
                if getattr(rule, name) is None and math.isfinite(end)
            }
            series[key] = rule.model_copy(update=open_ends)
        return self.model_copy(update={"series": series})

    @property
    def sha256(self) -> str:
        """Digest of all rules, by which a run says which ones it followed."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()


GRACE_QARTOD = QualityRules(
    series={
        "temperature": SeriesRule(
            fail_low=-2.5,
            fail_high=40.0,
            suspect_low=-2.0,
            suspect_high=35.0,
            spike_suspect=2.0,
            spike_fail=6.0,
            rate_suspect=0.2,
            flat_suspect_s=1800.0,
            flat_fail_s=3600.0,
            flat_tolerance=0.001,
        ),
        "chlorophyll": SeriesRule(
            fail_low=-1.0,
            fail_high=100.0,
            suspect_low=-0.1,
            suspect_high=50.0,
            spike_suspect=1.0,
            spike_fail=5.0,
            flat_suspect_s=3600.0,
            flat_fail_s=7200.0,
            flat_tolerance=0.0001,
        ),
        "blue_light": SeriesRule(fail_low=0.0, fail_high=65535.0),
    }
)
"""The delivered set."""
