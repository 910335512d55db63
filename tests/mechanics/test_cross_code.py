"""The same boundary-value problem in another code: scikit-fem, with stresses written from the textbook in index form.

Same mesh, elements, quadrature and loads, so that the solutions agree to rounding. tet10p0 is there the mixed
problem for displacement and pressure; hex8 is compared without its incompatible modes, which scikit-fem has not."""

from dataclasses import replace

import numpy as np
import pytest
import skfem
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from skfem.models.elasticity import lame_parameters, linear_elasticity
from support.blocks import box
from support.boundary_value import newton
from support.fast_cases import fast_are

from cfem.mechanics.assembly import make_pattern, symmetric_product
from cfem.mechanics.body import make_body, response, tangent
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mass import gravity
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material

YOUNG, SIZE, STEPS = 3.0, (2.0, 1.0, 1.0), 3
WEIGHT = np.array([0.05, -0.2, -0.3])  # N/mm^3
KINDS = {
    "tet4": (skfem.MeshTet, skfem.ElementTetP1),
    "tet10": (skfem.MeshTet, skfem.ElementTetP2),
    "tet10p0": (skfem.MeshTet, skfem.ElementTetP2),
    "hex8": (skfem.MeshHex, skfem.ElementHex1),
}


def body_without_modes(mesh, element, law, poisson):
    body = make_body(mesh, ELEMENTS[element], Material(LAWS[law], YOUNG, poisson))
    n, plain = body.element.n_nodes, replace(body.element, bubbles=0)
    solids = [
        replace(part, element=plain, gradients=np.ascontiguousarray(part.gradients[:, :, :n])) for part in body.solids
    ]
    return replace(body, element=plain, solids=tuple(solids))


ONE = np.eye(3)[:, :, None, None]


def cofactors(A, B):
    """1/2 e_ikl e_jmn A_km B_ln, bilinear and symmetric; of A = B = F the cofactors of F."""
    out = np.empty(np.broadcast_shapes(A.shape, B.shape))
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            m, n = (j + 1) % 3, (j + 2) % 3
            out[i, j] = (A[k, m] * B[l, n] + A[l, n] * B[k, m] - A[k, n] * B[l, m] - A[l, m] * B[k, n]) / 2
    return out


def inner(A, B):
    return np.einsum("ijeq,ijeq->eq", A, B)


def product(A, B):
    return np.einsum("ijeq,jkeq->ikeq", A, B)


def transposed(A):
    return np.swapaxes(A, 0, 1)


class NeoHookean:
    """psi = mu/2 (I1 - 3) - mu (J - 1) + mu/2 (J - 1)^2 + lambda/2 theta^2, theta = J - 1, dJ/dF = cof F."""

    def theta(F):
        return inner(F, cofactors(F, F)) / 3 - 1

    def dtheta(F):
        return cofactors(F, F)

    def d2theta(F, dF):
        return 2 * cofactors(F, dF)

    def stress(F, mu):
        return mu * F + mu * (NeoHookean.theta(F) - 1) * cofactors(F, F)

    def dstress(F, dF, mu):
        cof = cofactors(F, F)
        return mu * (dF + inner(cof, dF) * cof + (NeoHookean.theta(F) - 1) * 2 * cofactors(F, dF))


class StVenantKirchhoff:
    """psi = mu E:E + lambda/2 theta^2, theta = tr E, E = (F^T F - 1) / 2."""

    def theta(F):
        return (inner(F, F) - 3) / 2

    def dtheta(F):
        return F

    def d2theta(F, dF):
        return dF

    def stress(F, mu):
        return mu * product(F, product(transposed(F), F) - ONE)

    def dstress(F, dF, mu):
        E2 = product(transposed(F), F) - ONE
        return mu * (product(dF, E2) + product(F, product(transposed(dF), F) + product(transposed(F), dF)))


THEIR_LAWS = {"neo-hookean": NeoHookean, "st-venant-kirchhoff": StVenantKirchhoff}


def their_basis(mesh, element):
    """scikit-fem's basis of vectors on our mesh with our quadrature, and dof (n, 3): its number of each component of
    each of our nodes."""
    mesh_kind, element_kind = KINDS[element]
    if element == "hex8":
        corners, cells = np.arange(len(mesh.X)), mesh.cells
        vtk = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
        order = [int(np.flatnonzero((vtk == place).all(axis=1))[0]) for place in skfem.ElementHex1.doflocs]
        cells = cells[:, order]
        s = np.array([-1, 1]) / np.sqrt(3)
        points = np.stack(np.meshgrid(s, s, s, indexing="ij")).reshape(3, -1) / 2 + 0.5
        weights = np.full(8, 1 / 8)
    else:
        corners = np.unique(mesh.cells[:, :4])
        cells = np.searchsorted(corners, mesh.cells[:, :4])
        a, b = (5 + 3 * np.sqrt(5)) / 20, (5 - np.sqrt(5)) / 20
        points, weights = np.full((3, 4), b) + (a - b) * np.eye(3, 4), np.full(4, 1 / 24)
    theirs = mesh_kind(mesh.X[corners].T.copy(), cells.T.copy(), sort_t=False)
    basis = skfem.Basis(theirs, skfem.ElementVector(element_kind()), quadrature=(points, weights))
    dof = np.empty(mesh.X.shape, dtype=int)
    for i in range(3):
        numbers = np.concatenate([basis.nodal_dofs[i], basis.edge_dofs[i] if len(basis.edge_dofs) else []]).astype(int)
        distance, nearest = cKDTree(basis.doflocs[:, numbers].T).query(mesh.X)
        assert distance.max() < 1e-12
        dof[:, i] = numbers[nearest]
    return basis, dof


def their_moduli(law, F, p, mu, bulk):
    """C (3, 3, 3, 3, cells, points): dP = C : dF of P = stress + p dtheta, where p itself changes by bulk dtheta."""
    C = np.empty((3, 3, 3, 3, *F.shape[2:]))
    for k in range(3):
        for l in range(3):
            dF, g = np.zeros_like(F), law.dtheta(F)
            dF[k, l] = 1.0
            C[:, :, k, l] = law.dstress(F, dF, mu) + p * law.d2theta(F, dF) + bulk * inner(g, dF) * g
    return C


def their_solution(mesh, element, law, poisson, held, motion):
    """(n, 3) mm: displacement under the weight with that of `held` nodes prescribed, in equal steps of both."""
    basis, dof = their_basis(mesh, element)
    law, (lam, mu) = THEIR_LAWS[law], lame_parameters(YOUNG, poisson)
    mixed = ELEMENTS[element].pressure
    pressures = basis.with_element(skfem.ElementTetP0()) if mixed else None
    fixed = dof[held].ravel()

    @skfem.BilinearForm
    def stiffness(u, v, w):
        return np.einsum("ijeq,ijkleq,kleq->eq", v.grad, w["C"], u.grad)

    @skfem.BilinearForm
    def coupling(u, q, w):
        return inner(law.dtheta(w["F"]), u.grad) * q

    @skfem.BilinearForm
    def softness(p, q, w):
        return p * q / lam

    @skfem.LinearForm
    def force(v, w):
        return inner(v.grad, law.stress(w["F"], mu) + w["p"] * law.dtheta(w["F"]))

    @skfem.LinearForm
    def mismatch(q, w):
        return (law.theta(w["F"]) - w["p"] / lam) * q

    @skfem.LinearForm
    def weight(v, w):
        return sum(WEIGHT[i] * v[i] for i in range(3))

    load = weight.assemble(basis)
    u, p = np.zeros(basis.N), np.zeros(pressures.N if mixed else 0)
    for step in range(1, STEPS + 1):
        u[fixed] = motion[held].ravel() * step / STEPS
        for _ in range(15):
            F = ONE + basis.interpolate(u).grad
            at = {"F": F, "p": pressures.interpolate(p) if mixed else lam * law.theta(F)}
            rest = force.assemble(basis, **at) - load * step / STEPS
            K = stiffness.assemble(basis, C=their_moduli(law, F, at["p"], mu, 0.0 if mixed else lam))
            if mixed:
                B = coupling.assemble(basis, pressures, **at)
                K = skfem.utils.bmat([[K, B.T], [B, -softness.assemble(pressures)]], "csr")
                rest = np.concatenate([rest, mismatch.assemble(pressures, **at)])
            free = np.setdiff1d(np.arange(len(rest)), fixed)
            if np.abs(rest[free]).max() < 1e-12:
                break
            change = np.zeros(len(rest))
            change[free] = skfem.solve(K[free][:, free].tocsc(), -rest[free])
            u, p = u + change[: basis.N], p + change[basis.N :]
        else:
            raise ArithmeticError("scikit-fem's Newton did not converge")
    return u[dof]


def our_solution(mesh, element, law, poisson, held, motion):
    body = body_without_modes(mesh, element, law, poisson)
    load = gravity(body, 1.0, WEIGHT)
    mask = np.zeros(mesh.X.shape, dtype=bool)
    mask[held] = True
    x = mesh.X.copy()
    for step in range(1, STEPS + 1):
        x[held] = mesh.X[held] + motion[held] * step / STEPS
        x = newton(body, x, mask, load * step / STEPS, 1e-11)
    return x - mesh.X


THEIRS = [("tet4", 0.3), ("tet10", 0.3), ("tet10p0", 0.3), ("tet10p0", 0.499), ("hex8", 0.3)]


@pytest.mark.parametrize(
    "law, case",
    fast_are(
        [
            ("neo-hookean", ("tet4", 0.3)),
            ("st-venant-kirchhoff", ("tet10", 0.3)),
            ("neo-hookean", ("tet10p0", 0.499)),
            ("st-venant-kirchhoff", ("hex8", 0.3)),
        ],
        [(law, case) for law in THEIR_LAWS for case in THEIRS],
    ),
    ids=str,
)
def test_large_deformation_against_scikit_fem(law, case):
    """A block that sags, one end held and the other turned by half a radian and pulled by a fifth of its length."""
    element, poisson = case
    mesh = box(SIZE, (3, 2, 2), element, distort=0.2)
    held = np.flatnonzero((mesh.X[:, 0] < 1e-9) | (mesh.X[:, 0] > SIZE[0] - 1e-9))
    middle = np.array([2.0, 0.5, 0.5])
    turned = (mesh.X - middle) @ Rotation.from_rotvec([0.5, 0.1, 0.0]).as_matrix().T + middle + [0.4, 0.1, -0.1]
    motion = np.where(mesh.X[:, :1] > 1.0, turned - mesh.X, 0.0)
    ours = our_solution(mesh, element, law, poisson, held, motion)
    theirs = their_solution(mesh, element, law, poisson, held, motion)
    free = np.setdiff1d(np.arange(len(mesh.X)), held)
    assert np.abs(ours[free]).max() > 0.2
    np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8"])
def test_small_strain_stiffness_against_scikit_fem(element):
    """Linear elasticity of scikit-fem at rest."""
    mesh = box(SIZE, (2, 1, 1), element, distort=0.2)
    body = body_without_modes(mesh, element, "neo-hookean", 0.3)
    basis, dof = their_basis(mesh, element)
    K = linear_elasticity(*lame_parameters(YOUNG, 0.3)).assemble(basis)[dof.ravel()][:, dof.ravel()]
    pattern = make_pattern(len(mesh.X), [mesh.cells], np.array([], dtype=int))
    data = np.zeros(pattern.nnz)
    tangent(body, response(body, mesh.X), pattern.slots, data)
    ours = symmetric_product(pattern, data, np.eye(pattern.n_dof))
    np.testing.assert_allclose(ours, K.toarray(), atol=1e-12 * np.abs(ours).max())
