"""``grace user``: people who may sign in."""

import getpass
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from datetime import datetime, timedelta

from db.query.station.grants import GrantRecord, Holder, list_grants
from db.query.station.people import list_people
from db.store import Store
from server.access import register
from server.access.grant import words_of
from server.access.role import Role
from server.access.secret import hash_password
from server.cli.data import clock_of, open_store, settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option

_BY = "command line"
_GRANTED = tuple(role for role in Role if role is not Role.NONE)


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    add = actions.add_parser("add", help="add a person; asks for the password")
    add.add_argument("name")
    add.add_argument("--role", type=Role, choices=list(Role), required=True)
    change = actions.add_parser("change", help="change a role, disable or enable a person")
    change.add_argument("name")
    change.add_argument("--role", type=Role, choices=list(Role))
    change.add_argument("--disable", action="store_true", default=None)
    change.add_argument("--enable", dest="disable", action="store_false")
    for action in (add, change):
        add_grant_options(action)
    password = actions.add_parser("password", help="set a password; asks for it")
    password.add_argument("name")
    link = actions.add_parser("link", help="print a one-time sign-in path of a person")
    link.add_argument("name")
    link.add_argument("--minutes", type=float, default=15.0, help="how long it is valid")
    show = actions.add_parser("list", help="list everyone")
    for action in (add, change, password, link, show):
        add_data_option(action)


def run(arguments: Namespace) -> int:
    """Do the action on the folder's database; a running station knows at once."""
    settings = settings_of(arguments)
    at = clock_of(settings).now()
    with open_store(settings) as store:
        match arguments.action:
            case "link":
                _link(store, arguments, at)
            case "list":
                _list(store)
            case _:
                _change(store, arguments, at)
    return 0


def _change(store: Store, arguments: Namespace, at: datetime) -> None:
    if arguments.action == "add":
        password_hash = _asked_password()
        store.change(
            lambda session: register.add_person(
                session,
                arguments.name,
                arguments.role,
                password_hash,
                grants=grants_of(arguments) or (),
                at=at,
                by=_BY,
            )
        ).result()
        return
    setting_password = arguments.action == "password"
    password_hash = _asked_password() if setting_password else None
    store.change(
        lambda session: register.change_person(
            session,
            arguments.name,
            role=None if setting_password else arguments.role,
            disabled=None if setting_password else arguments.disable,
            password_hash=password_hash,
            grants=None if setting_password else grants_of(arguments),
            at=at,
            by=_BY,
        )
    ).result()


def _link(store: Store, arguments: Namespace, at: datetime) -> None:
    issued = store.change(
        lambda session: register.create_sign_in_link(
            session, arguments.name, timedelta(minutes=arguments.minutes), at=at, by=_BY
        )
    ).result()
    print(f"/sign-in?token={issued.secret}")


def _list(store: Store) -> None:
    with store.read() as session:
        grants = list_grants(session)
        for person in list_people(session):
            state = "disabled" if person.disabled_at else ""
            words = words_of(person.role, grants.get(Holder(person=person.key), []))
            print(f"{person.name}  {words}  {state}".rstrip())


def _asked_password() -> str:
    """Ask twice on a terminal, or take one line of a pipe."""
    if sys.stdin.isatty():
        password = getpass.getpass("Password: ")
        if getpass.getpass("Again: ") != password:
            raise CommandError("The two passwords differ; nothing was changed.")
    else:
        password = sys.stdin.readline().rstrip("\r\n")
    try:
        return hash_password(password)
    except ValueError as error:
        raise CommandError(f"{error}; nothing was changed.") from error


def add_grant_options(parser: ArgumentParser) -> None:
    """Let roles be given for chosen robots and groups."""
    parser.add_argument(
        "--robot",
        dest="grants",
        action="append",
        type=_of_robot,
        metavar="ROBOT=ROLE",
        help="a role for one robot, such as mini-1=pilot; may be repeated",
    )
    parser.add_argument(
        "--group",
        dest="grants",
        action="append",
        type=_of_group,
        metavar="GROUP=ROLE",
        help="a role for the robots of a group; may be repeated",
    )


def grants_of(arguments: Namespace) -> list[GrantRecord] | None:
    """Return the roles that were given, ``None`` if none was."""
    return arguments.grants


def _of_robot(text: str) -> GrantRecord:
    name, role = _parts(text)
    return GrantRecord(role, robot=name)


def _of_group(text: str) -> GrantRecord:
    name, role = _parts(text)
    return GrantRecord(role, group=name)


def _parts(text: str) -> tuple[str, Role]:
    name, _, role = text.rpartition("=")
    if not name or role not in _GRANTED:
        raise ArgumentTypeError(f"{text!r} is not NAME=ROLE with one of {', '.join(_GRANTED)}")
    return name, Role(role)
