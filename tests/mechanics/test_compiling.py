import numpy as np
from numba import njit

from cfem.core.console import progress
from cfem.core.console.progress import Display, doing
from cfem.mechanics import compiling


def test_a_kernel_that_is_compiled_is_said_to_be(monkeypatch):
    said = []
    monkeypatch.setattr(progress, "_display", Display("solve", said.append, lambda: 0.0))
    monkeypatch.setattr(compiling, "doing", lambda text: said.append(text) or doing(text))
    doing("solving")

    @njit
    def double(x):
        return 2 * x

    double(np.ones(1))
    assert any("compiling kernels" in text for text in said) and progress.what_is_done() == "solving"
    said.clear()
    double(np.ones(1))
    assert said == []
