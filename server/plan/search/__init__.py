"""The search for a round of a survey: what is asked, the problem, and the worker's task."""
