"""What holds for every test: one thread for algebra, and no hurry for a property's examples."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the product, before numpy is imported

from hypothesis import HealthCheck, settings

settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")
