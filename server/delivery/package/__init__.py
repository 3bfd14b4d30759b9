"""The delivery ZIP: what it holds, its report, and the job that packs it."""
