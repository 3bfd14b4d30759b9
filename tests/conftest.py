import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the product, before numpy is imported
