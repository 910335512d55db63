"""A plant whose stiffness changes, against a model of that stiffness."""

import numpy as np
import pytest
from surrogate.stored import train_folder

from cfem.plant.drifting_plant import DriftingPlant
from cfem.plant.imperfect_plant import Stiffer
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import load_model


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return load_model(train_folder(tmp_path_factory.mktemp("drift"), "{kind: spectral, max_degree: 8}", train=40))


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_it_ends_as_a_robot_of_that_stiffness(model, kind):
    u = 0.3 * (model.domain.lambda_a if kind == "force" else model.domain.delta_a)[1]
    drifting = DriftingPlant(ModelPlant(model, model.rest_e), 0.7, 3)
    found = [drifting.step(u, kind) for _ in range(5)]
    there = ModelPlant(Stiffer(model, 0.7), model.rest_e).step(u, kind)
    for one in found[2:]:
        assert one.x_e == pytest.approx(there.x_e) and one.lambda_a == pytest.approx(there.lambda_a)
    if kind == "force":
        assert np.linalg.norm(found[0].x_e - there.x_e) > 0.1
