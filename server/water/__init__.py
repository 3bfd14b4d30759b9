"""Waters: their documents, and outlines and depths from files. Publishes ``WaterChanged``."""
