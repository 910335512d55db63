"""Torch module of a model folder's content, of whatever kind."""

import numpy as np
from torch import nn

from cfem.condensed import Rows
from cfem.condensed.parameters import from_json
from cfem.core.errors import InputError
from cfem.predict.kinds.mlp import rest_arrays
from cfem.predict.load import build
from cfem.predict.rows.serial import module_arrays
from cfem.surrogate.rows.serial_module import Serial
from cfem.surrogate.torch_model import Locked, OnRest, Parametric, Spectral, SurfaceModule, mlp_from_arrays


def module_of(meta: dict, arrays: dict[str, np.ndarray]) -> nn.Module:
    """The torch module of a model folder's content (cfem.predict.load.read_meta, read_arrays), ready for inference."""
    rows = Rows(tuple(meta["rows"]["effectors"]), tuple(meta["rows"]["actuators"]))
    parameters, sizes = from_json(meta["parameters"]), meta.get("semidefinite")
    if meta["kind"] == "spectral":
        model = Spectral(meta["form"], rows, arrays, sizes)
    elif meta["kind"] == "serial":
        if meta.get("wrench") is not None:
            what = "modules in a row under loads find their equilibrium by an iteration, which graphs do not have"
            raise InputError(what, where="loads", do="export `arrays`")
        models = [module_of(card, module_arrays(arrays, i)) for i, card in enumerate(meta["modules"])]
        model = Serial(models, build(meta, arrays))
    else:
        model = mlp_from_arrays(rows, arrays, meta["activation"])
        if "at_rest" in meta:
            model = OnRest(model, module_of(meta["at_rest"], rest_arrays(arrays)).learned)
        model = model if sizes is None else Locked(model, rows.n_e, sizes)
    return (Parametric(model, meta["form"], parameters) if parameters else model).eval()


def shape_module(meta: dict, skin: dict[str, np.ndarray]) -> nn.Module:
    """The torch module of a model's whole surface; skin: arrays of its skin.npz."""
    return SurfaceModule(meta["form"], from_json(meta["parameters"]), skin).eval()
