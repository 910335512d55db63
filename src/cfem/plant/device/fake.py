"""A device of the pipe protocol that is a model: `python -P -m cfem.plant.device.fake MODEL [--stiffer 1.1] ...`.

To try a closed loop without hardware, and to start one's own device from."""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant, Stiffer
from cfem.plant.model_plant import ModelPlant
from cfem.plant.protocol import Measurement
from cfem.predict.load import load_model


def main() -> None:
    """Answers every line of stdin by one of stdout until told goodbye or left alone."""
    options = _options()
    model = load_model(options.model)
    robot = ModelPlant(Stiffer(model, options.stiffer), model.rest_e)
    imperfection = Imperfection(options.noise, 1 / options.every, options.delay)
    plant = ImperfectPlant(robot, imperfection, options.seed)
    for line in sys.stdin:
        message = json.loads(line)
        if "bye" in message:
            return
        if "hello" in message:
            same = message["effectors"] == list(model.rows.effectors) and message["actuators"] == list(
                model.rows.actuators
            )
            _say({"ready": True, "version": 1} if same else {"error": f"the model has rows {model.rows.names}"})
            continue
        if message["t"] == options.at:
            _fail(options.fail)
        _say(_answer(plant.step(np.array(message["u"]), message["kind"])))


def _answer(measured: Measurement) -> dict:
    known = np.isfinite(measured.x_e).all()
    return {
        "t": measured.t,
        "x_e": measured.x_e.tolist() if known else None,
        "delta_a": measured.delta_a.tolist() if known else None,
    }


def _say(answer: dict) -> None:
    print(json.dumps(answer), flush=True)


def _fail(how: str) -> None:
    if how == "die":
        sys.exit(3)
    if how == "hang":
        time.sleep(3600)
    print("?", flush=True)


def _options() -> argparse.Namespace:
    """Options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", type=Path, help="folder of cfem train or cfem export")
    parser.add_argument("--stiffer", type=float, default=1.0, help="Young's modulus over the model's")
    parser.add_argument("--noise", type=float, default=0.0, help="mm, standard deviation of a coordinate")
    parser.add_argument("--every", type=int, default=1, help="ticks from one sample to the next")
    parser.add_argument("--delay", type=int, default=0, help="ticks from sample to answer")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fail", choices=["die", "hang", "garbage"], default="garbage", help="what to do at --at")
    parser.add_argument("--at", type=int, help="step at which it fails; never unless given")
    return parser.parse_args()


if __name__ == "__main__":
    main()
