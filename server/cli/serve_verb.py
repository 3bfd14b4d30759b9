"""``grace serve``: the station."""

import asyncio
import os
import signal
import socket
import threading
import time
from argparse import SUPPRESS, ArgumentParser, Namespace
from pathlib import Path

import autonomy
from db.fault import StoreError
from db.migrate import NewerSchemaError
from server.base.settings import Settings
from server.cli.data import settings_of
from server.cli.data_folder import LOG_FOLDER, DataFolderError, hold_data_folder
from server.cli.failure import CommandError
from server.cli.option import add_data_option
from server.cli.service.manager import ServiceManager
from server.cli.service.preparation import clear_killed_work
from server.cli.service.station_process import StationProcess
from server.cli.service.succession import OPTION, Heirloom, SuccessionError
from server.system.certificate import CertificateError
from server.watch.log import log_station, logged_to_files
from server.watch.memory import return_freed_memory

_PARENT_PERIOD_S = 0.5
_PARENT_GRACE_S = 15.0


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    add_data_option(parser)
    parser.add_argument("--host", help="address to listen on (default: 127.0.0.1)")
    parser.add_argument("--port", type=int, help="port to listen on (default: 8000; 0: a free one)")
    parser.add_argument("--tls-certificate", type=Path, metavar="PEM", help="certificate chain")
    parser.add_argument("--tls-key", type=Path, metavar="PEM", help="key of the certificate")
    parser.add_argument(
        "--behind-proxy", action="store_true", default=None, help="a reverse proxy speaks TLS"
    )
    parser.add_argument(
        "--proxy",
        action="append",
        metavar="NETWORK",
        help="address or network of that proxy (default: this machine); may be given again",
    )
    parser.add_argument(
        "--public-origin",
        action="append",
        metavar="URL",
        help="origin that browsers see, where it differs; may be given again",
    )
    parser.add_argument(
        "--simulation", action="store_true", default=None, help="mark everything SIMULATION"
    )
    parser.add_argument(
        "--clock-file", type=Path, metavar="FILE", help="scaled clock that the simulator shares"
    )
    parser.add_argument(
        "--demo-port",
        type=int,
        metavar="PORT",
        help="loopback port of a simulator with the same option, whose robots may be given faults",
    )
    parser.add_argument(
        "--log-format", choices=("text", "json"), help="lines on the terminal (default: text)"
    )
    parser.add_argument(
        "--log-level",
        choices=("debug", "info", "warning", "error"),
        help="from which level on something is logged (default: info)",
    )
    parser.add_argument("--listen-fd", type=int, help=SUPPRESS)
    parser.add_argument(OPTION, type=Heirloom.parse, help=SUPPRESS)
    parser.add_argument("--parent-pid", type=int, help=SUPPRESS)


def run(arguments: Namespace) -> int:
    """Serve until told to stop."""
    settings = settings_of(
        arguments,
        host=arguments.host,
        port=arguments.port,
        tls_certificate=arguments.tls_certificate,
        tls_key=arguments.tls_key,
        behind_proxy=arguments.behind_proxy,
        proxies=arguments.proxy,
        public_origins=arguments.public_origin,
        simulation=arguments.simulation,
        clock_file=arguments.clock_file,
        demo_port=arguments.demo_port,
        log_format=arguments.log_format,
        log_level=arguments.log_level,
    )
    if arguments.parent_pid is not None:
        _end_with_parent(arguments.parent_pid)
    return_freed_memory()
    log_station(settings.log_format, settings.log_level)
    manager = ServiceManager()
    heirloom: Heirloom | None = arguments.take_over
    inherited = manager.listener if arguments.listen_fd is None else arguments.listen_fd
    _keep_machine_code(settings.data_dir)
    log_bytes = round(settings.log_limit_mb * 1e6)
    try:
        with (
            hold_data_folder(settings.data_dir, heirloom and heirloom.lock) as lock,
            logged_to_files(settings.data_dir / LOG_FOLDER, log_bytes),
            _listener(settings, heirloom.listener if heirloom else inherited) as at,
        ):
            clear_killed_work(settings.data_dir)
            is_alone = arguments.parent_pid is None and os.getpid() != 1
            process = StationProcess(settings, manager, at, lock, may_be_replaced=is_alone)
            asyncio.run(process.run(heirloom))
    except (DataFolderError, NewerSchemaError, StoreError, CertificateError, OSError) as error:
        raise CommandError(str(error)) from error
    except SuccessionError as error:
        raise CommandError(f"This process does not take over: {error}.") from error
    return 0


def _keep_machine_code(folder: Path) -> None:
    """Keep compiled kernels in the data folder where this user cannot write the installation."""
    if not os.access(Path(autonomy.__file__).parent, os.W_OK):
        os.environ.setdefault("NUMBA_CACHE_DIR", str((folder / "kernels").resolve()))


def _listener(settings: Settings, inherited: int | None) -> socket.socket:
    if inherited is not None:
        return socket.socket(fileno=inherited)
    listener = socket.socket(socket.AF_INET6 if ":" in settings.host else socket.AF_INET)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((settings.host, settings.port))
    except OSError as error:
        listener.close()
        raise CommandError(
            f"Port {settings.port} of {settings.host} cannot be used ({error.strerror}); "
            "choose another with --port."
        ) from error
    return listener


def _end_with_parent(parent_pid: int) -> None:
    """Stop in order when the parent is gone, however it ended, or by force if that fails."""
    threading.Thread(
        target=_watch_parent, args=(parent_pid,), name="parent watch", daemon=True
    ).start()


def _watch_parent(parent_pid: int) -> None:
    while os.getppid() == parent_pid:
        time.sleep(_PARENT_PERIOD_S)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_PARENT_GRACE_S)
    os._exit(1)
