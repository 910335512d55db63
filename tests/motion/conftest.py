"""A bar whose model has learned to move, on disk."""

import pytest


@pytest.fixture(scope="session")
def root(moving_bar):
    return moving_bar
