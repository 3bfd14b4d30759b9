"""Shows running jobs in the live stream."""

import asyncio

from db.query.jobs import JobRecord
from server.base.job import JobBoard
from server.base.live_feed import LiveFeed

PERIOD_S = 0.2


async def watch_jobs(jobs: JobBoard, feed: LiveFeed) -> None:
    """Tell the live stream about each change of a job until cancelled."""
    shown: dict[str, JobRecord] = {}
    while True:
        running = {job.id: job for job in jobs.running}
        for job in running.values():
            if shown.get(job.id) is not job:
                _show(feed, job)
        for ended in shown.keys() - running.keys():
            _show(feed, await jobs.get(ended))
        shown = running
        await asyncio.sleep(PERIOD_S)


def _show(feed: LiveFeed, job: JobRecord) -> None:
    feed.put("jobs", job.id, lambda: job)
