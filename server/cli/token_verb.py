"""``grace token``: bearer tokens of scripts."""

from argparse import ArgumentParser, Namespace
from datetime import timedelta

from db.query.station.people import list_tokens
from server.access import register
from server.access.role import Role
from server.cli.data import clock_of, open_store, settings_of
from server.cli.option import add_data_option
from server.cli.user_verb import add_grant_options, grants_of


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    create = actions.add_parser("create", help="create a token and print it, once")
    create.add_argument("--role", type=Role, choices=list(Role), required=True)
    add_grant_options(create)
    create.add_argument("--name", default="script", help="stands in the log as who did something")
    create.add_argument("--days", type=float, default=30.0, help="how long it is valid")
    show = actions.add_parser("list", help="list the tokens, without their secrets")
    revoke = actions.add_parser(
        "revoke", help="revoke a token; a running station follows within 0.3 s"
    )
    revoke.add_argument("token", help="its id, such as token-3")
    for action in (create, show, revoke):
        add_data_option(action)


def run(arguments: Namespace) -> int:
    """Do the action on the folder's database; a running station knows at once."""
    settings = settings_of(arguments)
    at = clock_of(settings).now()
    with open_store(settings) as store:
        match arguments.action:
            case "create":
                issued = store.change(
                    lambda session: register.create_token(
                        session,
                        arguments.name,
                        arguments.role,
                        timedelta(days=arguments.days),
                        grants=grants_of(arguments) or (),
                        at=at,
                        by="command line",
                    )
                ).result()
                print(issued.secret)
            case "revoke":
                store.change(
                    lambda session: register.revoke_token(
                        session, arguments.token, at=at, by="command line"
                    )
                ).result()
            case _:
                with store.read() as session:
                    for token in list_tokens(session):
                        state = (
                            "revoked" if token.revoked_at else f"until {token.expires_at:%F %TZ}"
                        )
                        print(f"{token.id}  {token.role:6}  {state}  {token.name}")
    return 0
