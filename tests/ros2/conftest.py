"""A node with parameters on the stand-in for rclpy, and a hand for its topics."""

import importlib
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import pytest
from ros2 import ros
from support.fast_cases import fast_are
from surrogate.stored import train_folder

from cfem.predict.load import load_model

PACKAGE = Path(__file__).parents[2] / "ros2" / "cfem_ros"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return train_folder(tmp_path_factory.mktemp("ros"), "{kind: spectral, max_degree: 8}", train=60)


@pytest.fixture(params=fast_are({"real"}, ["written", "real"]))
def messages(request):
    return ros.written() if request.param == "written" else ros.real()[0]


@pytest.fixture
def start(monkeypatch, messages, folder):
    """A node with parameters, and a hand for its topics."""
    monkeypatch.syspath_prepend(str(PACKAGE))
    ros.install(monkeypatch, messages)
    monkeypatch.setattr(ros.Node, "now", 1000.0)
    with ExitStack() as stack:

        def made(**given):
            monkeypatch.setattr(ros.Node, "given", {"model": str(folder)} | given)
            node = importlib.import_module("cfem_ros.node").Controller(stack)
            return SimpleNamespace(node=node, model=load_model(folder), messages=messages)

        yield made
