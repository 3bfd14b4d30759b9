"""One number that robots report, declared once: its row says all that anybody does with it.

A report's field carries its rows in its annotation, a vector one for each of its parts:

    battery_v: Annotated[float, ReportField(unit="V", wire=Wire("battery_voltage", 1e3), ...)]

The codecs of both wires, the columns of the database, the check of what is possible, the robot's
own log, the columns of recordings and the gauges are made from a ``Catalogue`` of such a report.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Annotated, Any, get_args, get_origin, get_type_hints

_SI_OF_DISPLAYED = {"deg": math.pi / 180.0, "g": 1e-3, "mm": 1e-3, "%": 1e-2}


@dataclass(frozen=True, slots=True)
class Wire:
    """Field of the dialect's message, whose type there says what it can hold."""

    field: str
    scale: float = 1.0
    """What a number is multiplied by when it is sent."""


@dataclass(frozen=True, slots=True)
class Octets:
    """Place in the satellite record; what exceeds its octets is shown as their end."""

    place: int
    """Channels stand in the record in this order."""
    count: int
    scale: float
    """What a number is multiplied by before it is rounded."""
    signed: bool = True


@dataclass(frozen=True, slots=True)
class Gauge:
    """How a screen shows the channel."""

    place: int
    """Order on the screen."""
    title: str
    help: str
    decimals: int
    limit_s: float
    """Age from which the value must look old, at the clock's normal speed."""


@dataclass(frozen=True, slots=True)
class Possible:
    """Between which values the channel can be true, and what is said of another."""

    low: float
    high: float
    words: str
    """A format of the value, such as "a battery charge of {:.0%}"."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """What a column of a recording can hold, in the unit on a screen."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class ReportField:
    """One number of a report: a channel that every state carries.

    A face that is not given is one that it does not have.
    """

    key: str = ""
    """Name with the unit's suffix, also of the column; a number has that of its field."""
    unit: str = ""
    """SI unit."""
    display_unit: str | None = None
    """Unit on a screen and in files where it differs."""
    standard_name: str | None = None
    """Name in the table of the Climate and Forecast conventions."""
    wire: Wire | None = None
    octets: Octets | None = None
    gauge: Gauge | None = None
    possible: Possible | None = None
    recorded: Recorded | None = None
    is_norm: bool = False
    """Whether it is the length of the vector whose parts the other rows are: computed, not kept."""

    @property
    def display_factor(self) -> float:
        """SI units in one unit on a screen."""
        return 1.0 if self.display_unit is None else _SI_OF_DISPLAYED[self.display_unit]

    @property
    def display_key(self) -> str:
        """Name with the suffix of the unit on a screen."""
        if self.display_unit is None:
            return self.key
        return f"{self.key.rpartition('_')[0]}_{self.display_unit}"

    def fault(self, value: float) -> str | None:
        """Return what is impossible about a value, or ``None``."""
        if self.possible is None or self.possible.low <= value <= self.possible.high:
            return None
        return self.possible.words.format(value)


class Catalogue:
    """The channels of a report, in the order of declaration.

    What is read of each report that passes is compiled once from the rows, as ``dataclasses``
    compiles an ``__init__``: written out it takes a third of the time of a loop over them.

    Args:
        report: A class whose annotations carry the rows.
    """

    numbers: Callable[[object], tuple[float, ...]]
    """Returns the values of ``channels`` in a report."""
    values: Callable[[object], dict[str, Any]]
    """Returns the same by the channels' names, in a new dictionary."""
    fields: Callable[[Sequence[float]], dict[str, Any]]
    """Returns a report's fields by their names, given the values of ``channels``."""

    def __init__(self, report: type) -> None:
        self._parts: dict[str, tuple[ReportField, ...]] = {}
        self._norms: dict[str, ReportField] = {}
        self._vectors: set[str] = set()
        for name, hint in get_type_hints(report, include_extras=True).items():
            if get_origin(hint) is Annotated:
                self._declare(name, *get_args(hint))
        self.channels = tuple(row for rows in self._parts.values() for row in rows)
        """Those that travel and are kept."""
        self.keys = tuple(row.key for row in self.channels)
        """Their names."""
        self.norms = tuple(row.key for row in self._norms.values())
        """Names of those that are computed: the lengths of others."""
        self._by_key = {row.key: row for row in (*self.channels, *self._norms.values())}
        gauges = ((row.key, row.gauge) for row in self._by_key.values() if row.gauge is not None)
        self.gauges = dict(sorted(gauges, key=lambda pair: pair[1].place))
        """Those that a screen shows by their channels' names, in its order."""
        self.fields = self.reader("numbers", (f"numbers[{n}]" for n in range(len(self.keys))))
        places = [
            f"report.{field}[{part}]" if field in self._vectors else f"report.{field}"
            for field, rows in self._parts.items()
            for part in range(len(rows))
        ]
        values = (f"{key!r}: {place}" for key, place in zip(self.keys, places, strict=True))
        self.numbers = eval(f"lambda report: ({', '.join(places)},)")
        self.values = eval(f"lambda report: {{{', '.join(values)}}}")

    def _declare(self, field: str, kind: Any, *rows: object) -> None:  # noqa: ANN401 - a type
        channels = [row for row in rows if isinstance(row, ReportField)]
        if get_origin(kind) is tuple:
            self._vectors.add(field)
        elif channels:
            channels = [replace(channels[0], key=field)]
        parts = tuple(row for row in channels if not row.is_norm)
        if parts:
            self._parts[field] = parts
        for row in channels:
            if row.is_norm:
                self._norms[field] = row

    def reader(self, arguments: str, numbers: Iterable[str]) -> Callable[..., dict[str, Any]]:
        """Compile what reads a report's fields, by their names, from another form of the report.

        Args:
            arguments: What the expressions call the other form, with commas between its parts.
            numbers: One expression for each of ``channels``.
        """
        number, fields = iter(numbers), list[str]()
        for field, rows in self._parts.items():
            comma = "," if field in self._vectors else ""
            fields.append(f"{field!r}: ({', '.join(islice(number, len(rows)))}{comma})")
        return eval(f"lambda {arguments}: {{{', '.join(fields)}}}")

    def __getitem__(self, key: str) -> ReportField:
        """Return the channel of a name."""
        return self._by_key[key]

    def shown(self, report: object) -> Mapping[str, float]:
        """Return the values of all channels by their names, the computed ones too."""
        known = self.values(report)
        for field, row in self._norms.items():
            known[row.key] = math.hypot(*getattr(report, field))
        return known

    def parts_of_norm(self, key: str) -> tuple[str, ...] | None:
        """Return the channels whose length a computed one is, ``None`` for another."""
        for field, row in self._norms.items():
            if row.key == key:
                return tuple(part.key for part in self._parts[field])
        return None
