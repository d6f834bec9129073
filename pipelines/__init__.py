"""The dataflow: which step runs after which, what can be skipped, where it runs."""

import os

# Steps run side by side, and their matrices are small: threads of OpenBLAS would wait for each other, and on a busy
# machine a step takes 25 times as long. It reads this when NumPy is imported; workers inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
