"""A network of sines fitted by least squares to values and derivatives of a function.

u(z) = A [h, z, z z] + c with h = sin(W_d ... sin(W_1 z + b_1) ... + b_d): the output layer sees the last hidden units,
the inputs and their products in pairs, so that what is nearly quadratic costs no hidden units. Everything is a Taylor
series (`cfem.surrogate.series.taylor`), which gives the derivatives of u by z without nested differentiation. As u is a
function of z, so are its derivatives by the weights: that by W_l[o, i] is the product of the functions du/da_l[o], of
the layer's output a_l, and h_{l-1}[i], of its input, and its derivatives by z are those of a product."""

from collections.abc import Iterator

import numpy as np

from cfem.surrogate.series.taylor import Derivative, Taylor

BLOCK = 4_000_000  # entries of a block of the Jacobian


class Network:
    """Network of n inputs, `depth` hidden layers of `width` sines, q outputs; its weights are one vector theta
    (size,)."""

    def __init__(self, n: int, width: int, depth: int, q: int):
        self.shapes = [(width, n), *[(width, width)] * (depth - 1), (q, width + n + n * (n + 1) // 2)]
        ends = np.cumsum([rows * (columns + 1) for rows, columns in self.shapes])
        self.width, self.size = width, int(ends[-1])
        self._starts = [0, *(int(end) for end in ends[:-1])]

    def slices(self) -> list[tuple[slice, slice]]:
        """Slices of theta that hold the matrix (row-major) and the bias of every layer."""
        middle = [start + rows * columns for start, (rows, columns) in zip(self._starts, self.shapes, strict=True)]
        ends = [end + rows for end, (rows, _) in zip(middle, self.shapes, strict=True)]
        return [(slice(a, b), slice(b, c)) for a, b, c in zip(self._starts, middle, ends, strict=True)]

    def layers(self, theta: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Views of matrix and bias of every layer."""
        parts = zip(self.slices(), self.shapes, strict=True)
        return [(theta[matrix].reshape(shape), theta[bias]) for (matrix, bias), shape in parts]

    def start(self, seed: int) -> np.ndarray:
        """Random theta: hidden layers that keep the size of their inputs, small outputs."""
        rng = np.random.default_rng(seed)
        theta = np.empty(self.size)
        *hidden, (output, constant) = self.layers(theta)
        for matrix, bias in hidden:
            matrix[:] = rng.standard_normal(matrix.shape) / np.sqrt(matrix.shape[1])
            bias[:] = rng.uniform(-1, 1, len(bias))
        output[:], constant[:] = 0.0, 0.0
        output[:, : self.width] = 0.1 * rng.standard_normal((len(output), self.width)) / np.sqrt(self.width)
        return theta


class DerivativeResiduals:
    """Residuals weights * (derivatives of u - targets) at m states, whose squares
    `cfem.surrogate.networks.gauss_newton` minimises.

    z: (m, n)
    derivatives: k of them, by axes of z
    targets: (m, k, q)
    weights: (k, q)"""

    def __init__(
        self,
        network: Network,
        z: np.ndarray,
        derivatives: tuple[Derivative, ...],
        targets: np.ndarray,
        weights: np.ndarray,
    ):
        """Prepares the inputs' own series, z and its products."""
        self.network, self.taylor = network, Taylor(derivatives)
        self.count = targets.size
        self._weights = (weights * self.taylor.factorials[:, None])[:, None, :]
        self._targets = (targets * weights).swapaxes(0, 1)
        self._z = np.zeros((len(derivatives), *z.shape))
        self._z[0] = z
        for i, axes in enumerate(derivatives):
            if len(axes) == 1:
                self._z[i, :, axes[0]] = 1.0
        first, second = np.triu_indices(z.shape[1])
        products = self.taylor.multiply(self._z[:, :, first], self._z[:, :, second])
        self._monomials = np.concatenate([self._z, products], axis=2)

    def __call__(self, theta: np.ndarray) -> np.ndarray:
        """Residuals (k, m, q) at parameters theta."""
        inputs, _ = self._run(theta, slice(None))
        return _affine(inputs[-1], *self.network.layers(theta)[-1]) * self._weights - self._targets

    def square(self, theta: np.ndarray) -> float:
        """Sum of the squared residuals."""
        return float(np.sum(self(theta) ** 2))

    def pull_back(self, theta: np.ndarray, v: np.ndarray) -> np.ndarray:
        """J^T v (size,) for v (k, m, q), by adjoints through the layers."""
        inputs, cosines = self._run(theta, slice(None))
        layers = self.network.layers(theta)
        gradient = np.empty(self.network.size)
        adjoint = v * self._weights
        for number in range(len(layers) - 1, -1, -1):
            matrix, bias = self.network.slices()[number]
            flat, h = adjoint.reshape(-1, adjoint.shape[2]), inputs[number]
            gradient[matrix] = (flat.T @ h.reshape(len(flat), -1)).ravel()
            gradient[bias] = adjoint[0].sum(axis=0)
            if number:
                weights = layers[number][0][:, : self.network.width]
                adjoint = self.taylor.correlate(cosines[number - 1], adjoint @ weights)
        return gradient

    def normal_matrix(self, theta: np.ndarray) -> np.ndarray:
        """Normal matrix J^T J (size, size)."""
        matrix = np.zeros((self.network.size, self.network.size))
        for rows in self.jacobian(theta):
            matrix += rows.T @ rows
        return matrix

    def jacobian(self, theta: np.ndarray) -> Iterator[np.ndarray]:
        """Rows (rows, size) of J, some states at a time."""
        k, m, q = self._targets.shape
        at_once = max(1, BLOCK // (k * q * self.network.size))
        for first in range(0, m, at_once):
            yield self._rows(theta, slice(first, first + at_once))

    def _rows(self, theta: np.ndarray, part: slice) -> np.ndarray:
        """Rows (m k q, size) of J of the states `part`: series of the outputs by each layer's weights, from the last
        layer back."""
        inputs, cosines = self._run(theta, part)
        layers, slices = self.network.layers(theta), self.network.slices()
        k, m, q = inputs[0].shape[0], inputs[0].shape[1], self._targets.shape[2]
        rows = np.zeros((m, k, q, self.network.size))
        by_output = np.zeros((k, m, q, q))  # the series of d u_q / d a_l[o]
        by_output[0] = np.eye(q)
        for number in range(len(layers) - 1, -1, -1):
            matrix, bias = slices[number]
            products = self._products(by_output, inputs[number])
            rows[..., matrix] = products.reshape(m, k, q, -1)
            rows[..., bias] = by_output.swapaxes(0, 1)
            if number:
                weights = layers[number][0][:, : self.network.width]
                by_output = self.taylor.multiply(by_output @ weights, cosines[number - 1][:, :, None, :])
        rows *= self._weights.swapaxes(0, 1)[..., None]
        return rows.reshape(m * k * q, -1)

    def _products(self, f: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Series (m, k q o, i) of every f_o g_i, from f (k, m, q, o) and g (k, m, i), as one matrix product a state."""
        k, m, q, o = f.shape
        padded = np.concatenate([f, np.zeros((1, m, q, o))])
        convolving = padded[self.taylor.terms].transpose(2, 0, 3, 4, 1)  # (m, k, q, o, k)
        return convolving.reshape(m, k * q * o, k) @ g.swapaxes(0, 1)

    def _run(self, theta: np.ndarray, part: slice) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """The series of every layer's input, and of the cosines of every hidden layer's output."""
        inputs, cosines = [self._z[:, part]], []
        for matrix, bias in self.network.layers(theta)[:-1]:
            sine, cosine = self.taylor.sine_cosine(_affine(inputs[-1], matrix, bias))
            inputs.append(sine)
            cosines.append(cosine)
        inputs[-1] = np.concatenate([inputs[-1], self._monomials[:, part]], axis=2)
        return inputs, cosines


def _affine(series: np.ndarray, matrix: np.ndarray, bias: np.ndarray) -> np.ndarray:
    out = series @ matrix.T
    out[0] += bias
    return out
