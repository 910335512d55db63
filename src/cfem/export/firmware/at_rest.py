"""The robot at rest among the states that firmware and pages take as known."""

import numpy as np

from cfem.predict.protocol import Predictor

AT_REST = 5e-3  # of length and largest force: what a model may be off at rest, to be called right there


def right_at_rest(predictor: Predictor, constants: dict[str, np.ndarray], p: np.ndarray) -> bool:
    """Tells whether the model is right at rest, a state that is known without any sample."""
    rest_state = predictor.at(np.zeros(predictor.rows.n_a), p if len(p) else None)
    offset = np.abs(rest_state.delta_e).max() / predictor.length
    forced = (np.abs(rest_state.lambda_a) / np.abs(constants["cfem_domain_lambda_a"]).max(axis=0)).max()
    return bool(max(offset, forced) < AT_REST)


def with_rest(predictor: Predictor, constants: dict[str, np.ndarray], p: np.ndarray) -> dict[str, np.ndarray]:
    """The box of the training states with the robot at rest in it, where every robot begins. Training states pull a
    little, so rest lies beside their box."""
    rest_state = predictor.at(np.zeros(predictor.rows.n_a), p if len(p) else None)
    along = constants["cfem_domain_axes"] @ rest_state.delta_a
    bounds = {}
    for name, rest in (
        ("cfem_domain_delta_a", rest_state.delta_a),
        ("cfem_domain_lambda_a", rest_state.lambda_a),
        ("cfem_domain_along", along),
    ):
        low, high = constants[name]
        rounding = 1e-5 * (high - low)  # of firmware in single precision
        bounds[name] = np.stack([np.minimum(low, rest - rounding), np.maximum(high, rest + rounding)])
    return bounds
