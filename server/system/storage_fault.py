"""The sentence on every page about a database that fails, or has just come back."""

from datetime import datetime

from db.store import Store


def storage_sentence(store: Store, fault: str | None, since: datetime | None) -> str:
    """Return what is to be said of the storage now; "" where all is well.

    Args:
        store: The database.
        fault: What is wrong with it, a sentence.
        since: Since when, by the station's clock, where that is known.
    """
    waiting, on_disk = store.waiting_rows, store.bridged_rows
    if fault is None:
        if not on_disk:
            return ""
        return f"The database works again; {on_disk:,} rows that waited on the disk are written."
    began = "" if since is None else f" It fails since {since:%Y-%m-%d %H:%M:%S} UTC."
    rows = f" {on_disk:,} rows wait on the disk." if on_disk else ""
    in_memory = waiting - on_disk
    if in_memory and store.bridge_fault is not None:
        rows += f" {in_memory:,} rows wait in memory: {store.bridge_fault}."
    return f"{fault}{began}{rows}"
