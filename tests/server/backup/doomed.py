"""Makes a backup and says how far it is, a line each time, for a test that kills it at work."""

import sys
import time
from pathlib import Path

from server.backup.making import BackupOrder, make_backup

if __name__ == "__main__":
    data, target, staging = sys.argv[1:]
    url = f"sqlite:///{data}/station.sqlite3"
    order = BackupOrder(Path(data), url, Path(target), staging=staging)

    def tell(share: float, words: str) -> None:
        del words
        sys.stdout.write(f"{share}\n")
        sys.stdout.flush()
        if share > 0.9999:
            time.sleep(600)  # it comes to its end by no hurry

    make_backup(order, tell)
