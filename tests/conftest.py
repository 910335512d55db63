"""One thread a process: pytest-xdist fills the cores, and threads that wait for each other only burn them."""

import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
