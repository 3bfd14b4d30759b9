"""``grace coefficients``: a vehicle's coefficients from a table of forces and moments."""

import json
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Column, Table

from autonomy.vehicle.config import MINIGLIDER, VEHICLES, Vehicle
from autonomy.vehicle.parameter_file import VehicleFileError, vehicle_from_document
from server.cli.failure import CommandError
from server.vehicle.coefficients import (
    COLUMNS,
    CoefficientTableError,
    FittedVehicle,
    csv_rows,
    fit_vehicle,
    place_of,
)


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    width = max(map(len, COLUMNS))
    lines = "\n".join(f"  {name:{width}}  {unit}" for name, unit in COLUMNS.items())
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.epilog = (
        f"The table's columns and their units:\n{lines}\n\n"
        "At least one force or moment is needed; an empty one was not measured in its row.\n"
        "Damping of turns cannot be told at rest in a tunnel: the vehicle keeps its own."
    )
    parser.add_argument("file", type=Path, metavar="FILE.csv", help="the table")
    parser.add_argument(
        "--vehicle",
        default=MINIGLIDER.key,
        metavar="KEY",
        help=f"what has the other parameters: {' or '.join(VEHICLES)}, or a file with a vehicle's "
        f"document (default: {MINIGLIDER.key})",
    )
    parser.add_argument(
        "--density", type=float, metavar="KG_M3", help="of the tunnel's water, kg/m3"
    )
    parser.add_argument("--key", help="of the new vehicle (default: KEY-tunnel)")
    parser.add_argument("--title", help="of the new vehicle")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="VEHICLE.json",
        help="write the vehicle there, as `POST /api/vehicles` takes it",
    )


def run(arguments: Namespace) -> int:
    """Fit the coefficients, print them, and write the vehicle."""
    density = arguments.density
    if density is not None and not 0.0 < density < 1e5:
        raise CommandError("--density: must be greater than 0 kg/m3.", status=2)
    base = _vehicle(arguments.vehicle)
    try:
        found = fit_vehicle(
            base,
            csv_rows(_text(arguments.file)),
            key=arguments.key or f"{base.key[:33]}-tunnel",
            title=arguments.title or f"{base.title[:60]}, from a tunnel",
            water_density_kg_m3=density,
        )
    except CoefficientTableError as error:
        for loc, message in error.errors:
            print(f"{place_of(loc)}: {message}")
        raise CommandError(f"{arguments.file} tells no coefficients.") from error
    _print(found)
    if arguments.out is not None:
        try:
            arguments.out.write_text(json.dumps(found.document, indent=2) + "\n", encoding="utf-8")
        except OSError as error:
            raise CommandError(f"{arguments.out}: {error.strerror}.") from error
        print(arguments.out)
    return 0


def _vehicle(name: str) -> Vehicle:
    if name in VEHICLES:
        return VEHICLES[name]
    path = Path(name)
    if not path.is_file():
        known = " and ".join(VEHICLES)
        raise CommandError(f"There is no vehicle or file {name!r}; there are {known}.", status=2)
    try:
        return vehicle_from_document(json.loads(_text(path)))
    except json.JSONDecodeError as error:
        raise CommandError(f"{path} is no JSON: {error}.") from error
    except VehicleFileError as error:
        raise CommandError(f"{path} is no vehicle: {error}.") from error


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise CommandError(f"{path}: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise CommandError(f"{path} is not text in UTF-8.") from error


def _print(found: FittedVehicle) -> None:
    console = Console(highlight=False)
    table = Table(
        Column("coefficient"),
        Column(""),
        Column("before", justify="right"),
        Column("now", justify="right"),
        Column("standard error", justify="right"),
        Column("unit"),
        box=SIMPLE_HEAD,
    )
    for one in found.coefficients:
        numbers = (f"{one.before:.5g}", f"{one.value:.5g}", f"{one.std:.2g}")
        table.add_row(one.name, one.title, *numbers, one.unit)
    console.print(table)
    for column, rms in found.residual.items():
        console.print(f"{column}: the polynomial leaves {rms:.2g} (root mean square)")
    if found.kept:
        console.print(f"Not told by the table, kept: {', '.join(found.kept)}")
