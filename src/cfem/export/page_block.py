"""The robot as the block of bytes that the page's WebAssembly reads; web/cfem_page.c has its layout."""

import numpy as np

from cfem.core.errors import InputError
from cfem.export.c_constants import OBSERVERS, Surrogate
from cfem.export.c_series import Group

# What web/cfem_data.h has room for.
ROOM = {
    "CFEM_NA": (8, "actuators"),
    "CFEM_NE": (12, "effector coordinates"),
    "CFEM_NZ": (12, "inputs"),
    "CFEM_DEGREE": (40, "degrees"),
    "CFEM_MODULES": (4, "modules"),
    "skin": (40, "modes of its skin"),
}
DEGREES = ROOM["CFEM_NZ"][0] - 1  # of a group, in memory
HEAD = 16  # numbers of four bytes
SIZES = ("FORM_DISPLACEMENT", "NA", "NE", "SERIES_NA", "SERIES_NE", "NZ", "DEGREE")
VECTORS = ("ridge", "damping", "lambda_low", "lambda_high", "delta_low", "delta_high")
RATES = ("step_limit", "delta_rate", "lambda_rate", "home")


def block(model: Surrogate, defines: dict, constants: dict[str, np.ndarray], n_skin: int) -> bytes:
    """model: in double precision, its series potential, effector and skin (of n_skin outputs each); defines and
    constants: of the controller. InputError where the page has no room for it."""
    sizes = {"CFEM_MODULES": 1, **defines, **model.defines, "skin": n_skin}
    for name, (most, what) in ROOM.items():
        if sizes[name] > most:
            raise InputError(f"the page has room for {most} {what}, and this robot has {sizes[name]}", do="export C")
    counts = [
        ("spectral", "mlp", "serial").index("serial" if sizes["CFEM_SERIAL"] else "spectral"),
        *(
            sizes[f"CFEM_{name}"]
            for name in ("FORM_DISPLACEMENT", "NA", "NE", "SERIES_NA", "SERIES_NE", "NZ", "DEGREE")
        ),
        sizes["CFEM_MODULES"],
        OBSERVERS.index(sizes["CFEM_OBSERVER"].removeprefix("CFEM_OBSERVER_").lower()),
        *(sizes[f"CFEM_{name}"] for name in ("OBSERVER_ITERATIONS", "COMMAND_FORCE", "ITERATIONS", "HALVINGS")),
        n_skin,
    ]
    scalars = [sizes[f"CFEM_{name}"] for name in ("OBSERVER_TOLERANCE", "TOLERANCE", "K_P", "K_I", "INTEGRAL_LIMIT")]
    arrays = {**constants, **model.arrays}
    numbers = [
        scalars,
        *(arrays[f"cfem_{name}"] for name in ("rest_e", "effector_weight", *VECTORS, *RATES)),
        *arrays["cfem_domain_delta_a"],
        *arrays["cfem_domain_lambda_a"],
        *arrays["cfem_to_box"],
        arrays["cfem_offset"],
        arrays.get("cfem_softer", [1.0]),
        arrays.get("cfem_module_rest", np.zeros(3)),
    ]
    parts = [np.array(counts + [0] * (HEAD - len(counts)), "<i4").tobytes()]
    parts += [np.asarray(one, float).astype("<f8").tobytes() for one in numbers]
    for name in ("potential", "effector", "skin"):
        degrees = arrays[f"cfem_{name}_degrees"]
        groups = model.groups[name]
        parts += [
            np.array([len(degrees), len(groups)], "<i4").tobytes(),
            np.asarray(arrays[f"cfem_{name}"]).astype("<f8").tobytes(),
            degrees.astype(np.uint8).tobytes(),
            b"".join(map(_group, groups)),
        ]
    return b"".join(one + bytes(-len(one) % 8) for one in parts)


def _group(one: Group) -> bytes:
    if one.end > 0xFFFF:
        raise InputError(f"the page has no room for {one.end} terms of a series", do="train it to a lower degree")
    degrees = bytes([one.depth, *one.degrees, *[0] * (DEGREES - len(one.degrees))])
    return np.array(one.end, "<u2").tobytes() + degrees
