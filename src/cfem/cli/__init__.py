"""The command line: parse, call a stage, print. No science."""

import os

# Before NumPy is imported: on the small dense matrices here a threaded BLAS is slower, most of all on busy cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
