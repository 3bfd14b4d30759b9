"""Makes one backup in a process that gives way to the station, and can be called off."""

from typing import Final

from db.fault import StoreError
from server.backup.failure import BackupError
from server.backup.making import BackupOrder, MadeBackup, make_backup
from server.base.study import Refusal
from server.base.worker import IsCancelled, Report, WorkCancelledError

TASK: Final = f"{__name__}:run"


def run(order: BackupOrder, report: Report, is_cancelled: IsCancelled) -> MadeBackup | Refusal:
    """Make a backup.

    Raises:
        WorkCancelledError: If it is not wanted any more.
    """

    def tell(share: float, words: str) -> None:
        if is_cancelled():
            raise WorkCancelledError
        report((share, words))

    try:
        return make_backup(order, tell)
    except (BackupError, StoreError) as error:
        return Refusal(str(error))
