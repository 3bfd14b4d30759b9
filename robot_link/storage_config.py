"""How long a station keeps what it was told, and what becomes of it then."""

from typing import Literal

from autonomy.configuration import Configuration, quantity


class SeriesRule(Configuration):
    """What becomes of rows that follow one another in time."""

    then: Literal["keep", "thin", "move", "delete"] = quantity("keep", title="What becomes of it")
    """Keep: it stays for ever. Thin: one row a period stays, with the extremes. Move: it goes to
    compressed files, which can be read back. Delete: it is gone."""
    after_days: int = quantity(365, "d", title="Once older than", ge=1, le=36_500)
    """Counted from the measurement and from its arrival; the later counts."""
    period_s: int = quantity(10, "s", title="Thinned to one per", ge=1, le=3600)
    """Only where it is thinned."""


class RawRule(Configuration):
    """What becomes of raw bytes, of which every one counts."""

    then: Literal["keep", "move", "delete"] = quantity("keep", title="What becomes of it")
    """Keep: it stays for ever. Move: it goes to compressed files, which can be read back. Delete:
    it is gone; the journal of that time cannot be replayed then."""
    after_days: int = quantity(365, "d", title="Once older than", ge=1, le=36_500)
    """Counted from the moment at which the station had them."""


class StorageConfig(Configuration):
    """What is kept, and how long; by whole days of UTC."""

    raw: RawRule = quantity(RawRule(), title="Raw bytes of links")
    """Every packet as it crossed a link."""
    states: SeriesRule = quantity(SeriesRule(), title="State reports")
    """Place, attitude and condition, as robots reported them."""
    samples: SeriesRule = quantity(SeriesRule(), title="Samples")
    """What instruments measured at a place."""
    readings: SeriesRule = quantity(SeriesRule(), title="Readings")
    """What belongs to no place, such as pressures inside the hull."""
    actuators: SeriesRule = quantity(SeriesRule(), title="Actuator reports")
    """How sliding mass and pump followed their commands."""
    fixes: SeriesRule = quantity(SeriesRule(), title="Camera fixes")
    """Where cameras over a tank found robots."""
    hour: int = quantity(2, "h", title="Daily pass at", ge=0, le=23)
    """Hour of the day, UTC, at which what is due is thinned, moved and deleted."""
    full_within_days: float = quantity(
        14.0, "d", title="Alarm of a full disk from", ge=0.0, le=365.0
    )
    """Somebody is told when the disk will be full within so many days, at the growth of late."""
