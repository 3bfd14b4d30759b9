"""The process of a shard: robots of a simulation that is asked elsewhere (``simulator.shard``).

``python -m simulator.shard_process`` reads its settings and robots, pickled by its parent, from its
standard input.
"""

import logging
import pickle
import sys

from onboard.node.wire import NodeAddress
from simulator.fleet import FLEET
from simulator.process import serve
from simulator.until_told import run_until_told


def main() -> None:
    """Let the robots live until SIGTERM, or until the parent is gone."""
    settings, definitions = pickle.load(sys.stdin.buffer)
    FLEET.update(definitions)
    logging.basicConfig(
        level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s"
    )

    def tell_port(desk: NodeAddress) -> None:
        sys.stdout.write(f"{desk.port}\n")
        sys.stdout.flush()

    run_until_told(lambda stopped: serve(settings, stopped, opened=tell_port))


if __name__ == "__main__":
    main()
