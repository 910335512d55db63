"""What forces do to all robots of a scene in one compiled call."""

from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.predict.contact.forces.joint_dents import dent_slopes, dented_places
from cfem.predict.contact.forces.load_response import load_response, moved_places, under_forces

FIRST, SECOND, BEARS, ERROR, STORED = range(5)  # columns of `LoadResult.sizes`
THIRD = 2.5  # the third order over the square of the second, both relative to the first (docs/contact.md)


class RobotArrays(NamedTuple):
    """Arrays of robots (r) that are held, one after another.

    shapes: (r, 6) of each the numbers n of points, k of modes, r of mixtures of modes, e of effectors, c of points that
        are known, and t of triples that dent each other; -1: each point dents by itself
    numbers: what `RobotNumbers` says
    triples: (t, 3) of `JointDents`
    flat: of `Surfaces`
    free: (N, 3) mm, places of all points without forces"""

    shapes: np.ndarray
    numbers: np.ndarray
    triples: np.ndarray
    flat: np.ndarray
    free: np.ndarray


class RobotNumbers(NamedTuple):
    """What is known of a robot at held actuators, of known points without forces.

    missing (1,), rows (k,), C_es (e, k), C_ss (k, k), bends (k, r), D (r, e + r, r): of `HeldRobot`
    U (3 c, k), local (3 c, 3 c), total (3 c, 3 c), flexibility (c,), dents (c, 3, 3, 3 + e) and tip (e, 3 c): of
        `PointCompliance`
    change: (t, 3, 3, 3) of `JointDents`"""

    missing: np.ndarray
    rows: np.ndarray
    C_es: np.ndarray
    C_ss: np.ndarray
    bends: np.ndarray
    D: np.ndarray
    U: np.ndarray
    local: np.ndarray
    total: np.ndarray
    flexibility: np.ndarray
    dents: np.ndarray
    tip: np.ndarray
    change: np.ndarray


class LoadResult(NamedTuple):
    """What forces do, of one robot after another and each in its own frame.

    rows (sum of k,) mm of the skins; w (sum of k,) N and v (sum of r,) N: loads of the forces on modes and mixtures
    places: (N, 3) mm of all points
    compliance: (sum of 9 c^2,) mm/N, derivative of the places of known points by the forces on them, where it was asked
        for
    moved: (sum of e,) mm by which forces move the effectors
    sizes: (r, 5) shares of the first and the second order that are taken; 1 where any force is not 0; the largest
        estimate of all loads of how far what forces do is off; N mm that are stored beside what the actuators have
    pressed: (N,) bool, points that have borne forces, so that rounds do not alternate
    h (sum of 3 c,) N of `DentedPlaces` and begin (r,), how many of each robot's the next load begins with"""

    rows: np.ndarray
    w: np.ndarray
    v: np.ndarray
    places: np.ndarray
    compliance: np.ndarray
    moved: np.ndarray
    h: np.ndarray
    sizes: np.ndarray
    pressed: np.ndarray
    begin: np.ndarray


@njit(cache=True, error_model="numpy")
def load_robots(robots, known, forces, R, sloped, loaded):
    """Puts forces (C, 3) N, in axes to which R (r, 3, 3) turn, on known points (C,) of `RobotArrays`. sloped: whether
    the compliance under forces is asked for."""
    shapes, numbers, triples, flat, free = robots
    point, mode, mixture, effector, first, triple, entry, modal = 0, 0, 0, 0, 0, 0, 0, 0
    number = np.int64(0)  # of a literal 0 numba would compile `robot_numbers` once more
    for i in range(len(shapes)):
        n, k, r, e, c, t = shapes[i, 0], shapes[i, 1], shapes[i, 2], shapes[i, 3], shapes[i, 4], shapes[i, 5]
        mine, turned = np.empty(c, dtype=np.int64), np.empty((c, 3))
        for p in range(c):
            mine[p], f = known[first + p] - point, forces[first + p]
            for a in range(3):
                turned[p, a] = f[0] * R[i, 0, a] + f[1] * R[i, 1, a] + f[2] * R[i, 2, a]
        robot, end = robot_numbers(numbers, number, shapes[i])
        of_robot = LoadResult(
            loaded.rows[mode : mode + k],
            loaded.w[mode : mode + k],
            loaded.v[mixture : mixture + r],
            loaded.places[point : point + n],
            loaded.compliance[entry : entry + 9 * c * c],
            loaded.moved[effector : effector + e],
            loaded.h[3 * first : 3 * (first + c)],
            loaded.sizes[i : i + 1],
            loaded.pressed[point : point + n],
            loaded.begin[i : i + 1],
        )
        modes, dents = flat[modal : modal + 3 * n * k].reshape((3 * n, k)), triples[triple : triple + max(t, 0)]
        _load(robot, modes, dents, free[point : point + n], mine, turned, t >= 0, sloped, of_robot)
        point, mode, mixture, effector, first = point + n, mode + k, mixture + r, effector + e, first + c
        triple, entry, number, modal = triple + max(t, 0), entry + 9 * c * c, end, modal + 3 * n * k


@njit(cache=True, error_model="numpy")
def robot_numbers(numbers, begin, shape):
    """`RobotNumbers` of a robot of this shape (6,) that begin in numbers, and where they end."""
    k, r, e, c, t = shape[1], shape[2], shape[3], shape[4], shape[5]
    rows = begin + 1
    C_es = rows + k
    C_ss = C_es + e * k
    bends = C_ss + k * k
    D = bends + k * r
    U = D + r * (e + r) * r
    local = U + 3 * c * k
    total = local + 9 * c * c
    flexibility = total + 9 * c * c
    dents = flexibility + c
    tip = dents + 9 * c * (3 + e)
    change = tip + 3 * e * c
    end = change + 27 * max(t, 0)
    robot = RobotNumbers(
        numbers[begin:rows],
        numbers[rows:C_es],
        numbers[C_es:C_ss].reshape((e, k)),
        numbers[C_ss:bends].reshape((k, k)),
        numbers[bends:D].reshape((k, r)),
        numbers[D:U].reshape((r, e + r, r)),
        numbers[U:local].reshape((3 * c, k)),
        numbers[local:total].reshape((3 * c, 3 * c)),
        numbers[total:flexibility].reshape((3 * c, 3 * c)),
        numbers[flexibility:dents],
        numbers[dents:tip].reshape((c, 3, 3, 3 + e)),
        numbers[tip:change].reshape((e, 3 * c)),
        numbers[change:end].reshape((max(t, 0), 3, 3, 3)),
    )
    return robot, end


@njit(inline="always", error_model="numpy")  # as are others with one caller: else numba optimises them twice
def _load(robot, flat, triples, free, known, forces, joint, sloped, loaded):
    """Loads one robot by forces (c, 3) N in its own frame; joint: whether its points dent together."""
    bears, yields, sizes = False, np.zeros(len(known), dtype=np.bool_), loaded.sizes[0]
    for p in range(len(known)):
        if forces[p, 0] != 0.0 or forces[p, 1] != 0.0 or forces[p, 2] != 0.0:
            bears, loaded.pressed[known[p]] = True, True
        yields[p] = loaded.pressed[known[p]]
    sizes[BEARS], sizes[STORED] = bears, 0.0
    if not bears:
        for a in range(len(loaded.w)):
            loaded.w[a], loaded.rows[a] = 0.0, robot.rows[a]
        for a in range(len(loaded.v)):
            loaded.v[a] = 0.0
        for a in range(len(loaded.moved)):
            loaded.moved[a] = 0.0
        loaded.begin[0] = 0
        _copy(free.reshape(-1), loaded.places.reshape(-1))
        _copy(robot.total.reshape(-1), loaded.compliance)
        return
    response = load_response(forces, robot.C_ss, robot.bends, robot.D, robot.U, robot.flexibility, robot.dents)
    modes, by_dents = response.modes, response.places
    for d in range(len(robot.rows)):
        loaded.rows[d], loaded.w[d] = robot.rows[d] + modes.motion[d], response.w[d]
    _copy(response.v, loaded.v)
    if sloped:
        change = response.change[len(robot.C_es) :]
        compliance = under_forces(robot.total, robot.local, robot.U, robot.bends, change, response.slopes, modes)
        _copy(compliance.reshape(-1), loaded.compliance)
    sizes[FIRST], sizes[SECOND], sizes[STORED] = modes.first, modes.second, _stored(robot, forces, response)
    sizes[ERROR] = max(sizes[ERROR], estimated_error(response.bending, robot.missing[0]))
    if joint:
        start = loaded.h[: loaded.begin[0]]
        dented = dented_places(forces, robot.total, triples, robot.change, yields, start)
        loaded.begin[0] = len(dented.h) if dented.share == 1.0 else 0
        _copy(dented.h, loaded.h)
        by_dents = dented.places
        sizes[STORED] += dented.energy
        sizes[ERROR] = np.inf if dented.share < 1 else sizes[ERROR]
        if sloped:
            slopes = dent_slopes(dented.change, dented.mine, dented.factor).reshape(-1)
            for i in range(len(slopes)):
                loaded.compliance[i] += slopes[i]
    places = moved_places(free, flat, modes.motion, known, robot.local, forces, by_dents)
    _copy(places.reshape(-1), loaded.places.reshape(-1))
    _move_effectors(robot, forces, response, loaded.moved)


@njit(cache=True, error_model="numpy")
def _copy(numbers, into):
    for i in range(len(numbers)):
        into[i] = numbers[i]


@njit(cache=True, error_model="numpy")
def estimated_error(bending, missing):
    """Estimate of how far what forces do is off, a share of it: what modes miss of the second order
    (`SurfaceModel.missing`), and the orders beyond. bending: second order over first.

    A slender body that is bent sideways comes nearer by 0.6 of the square of its deflection, both over its length, and
    stiffens by about that square: the third order goes with the square of the second."""
    return (missing + THIRD * bending) * bending


@njit(cache=True, error_model="numpy")
def _stored(robot, forces, response):
    """N mm that forces (c, 3) N have stored, without joint dents: their work, less the integral of places over forces.
    Of the latter the orders w . C w and D[w, w, w] have 1/2 and 1/6 (`cfem.predict.contact.forces.high_order`), and of
    the work 1 and 1/2."""
    w, modes, f, stored = response.w, response.modes, forces.reshape(-1), 0.0
    for d in range(len(w)):
        stored += 2 / 3 * w[d] * modes.motion[d]
        for b in range(len(w)):
            stored -= modes.first / 6 * w[d] * robot.C_ss[d, b] * w[b]
    for i in range(len(f)):
        for j in range(len(f)):
            stored += f[i] * robot.local[i, j] * f[j] / 2
    for p in range(len(forces)):
        flexible, along = 0.0, 0.0
        for a in range(3):
            flexible += robot.flexibility[p] * forces[p, a] ** 2
            along += forces[p, a] * response.places[p, a]
        stored += 2 / 3 * (along + flexible) - response.firsts[p] * flexible / 6 - flexible / 2
    return stored


@njit(cache=True, error_model="numpy")
def _move_effectors(robot, forces, response, moved):
    """Puts into moved (e,) mm by how much forces (c, 3) N move the effectors."""
    for e in range(len(moved)):
        moved[e] = 0.0
        for d in range(len(response.w)):
            moved[e] += response.modes.first * robot.C_es[e, d] * response.w[d]
        for d in range(len(response.v)):
            moved[e] += response.modes.second / 2 * response.change[e, d] * response.v[d]
        for p in range(len(forces)):
            for a in range(3):
                moved[e] += robot.tip[e, 3 * p + a] * forces[p, a]
                for b in range(3):
                    pair = response.seconds[p] / 2 * forces[p, a] * forces[p, b]
                    moved[e] += pair * robot.dents[p, a, b, 3 + e]


@njit(cache=True, error_model="numpy")
def free_places(shapes, flat, rest, rows):
    """(N, 3) mm of all points where robots with these rows (sum of k,) mm bear no forces; the rest as for
    `RobotArrays`."""
    places, point, mode, modal = np.empty_like(rest), 0, 0, 0
    nothing = np.empty(0, dtype=np.int64), np.empty((0, 0)), np.empty((0, 3)), np.empty((0, 3))
    for i in range(len(shapes)):
        n, k = shapes[i, 0], shapes[i, 1]
        modes = flat[modal : modal + 3 * n * k].reshape((3 * n, k))
        moved = moved_places(rest[point : point + n], modes, rows[mode : mode + k], *nothing)
        _copy(moved.reshape(-1), places[point : point + n].reshape(-1))
        point, mode, modal = point + n, mode + k, modal + 3 * n * k
    return places


@njit(cache=True, error_model="numpy")
def turned_compliance(robots, loaded, R, under_forces):
    """(3 C, 3 C) mm/N of the known points of `RobotArrays`, in axes to which R (r, 3, 3) turn; under_forces: as the
    forces have changed it."""
    shapes, numbers = robots.shapes, robots.numbers
    count, half, first, entry, number = 0, np.empty((3, 3)), 0, 0, np.int64(0)
    for i in range(len(shapes)):
        count += shapes[i, 4]
    total = np.zeros((3 * count, 3 * count))
    for i in range(len(shapes)):
        robot, number = robot_numbers(numbers, number, shapes[i])
        n = len(robot.total)
        C = loaded[entry : entry + n * n].reshape((n, n)) if under_forces else robot.total
        for row in range(0, n, 3):
            for column in range(0, n, 3):
                for a in range(3):
                    for b in range(3):
                        half[a, b] = 0.0
                        for d in range(3):
                            half[a, b] += R[i, a, d] * C[row + d, column + b]
                for a in range(3):
                    for b in range(3):
                        value = half[a, 0] * R[i, b, 0] + half[a, 1] * R[i, b, 1] + half[a, 2] * R[i, b, 2]
                        total[3 * first + row + a, 3 * first + column + b] = value
        first, entry = first + n // 3, entry + n * n
    return total


class Answers(NamedTuple):
    """What robots answer to forces, one after another.

    displaced: (sum of e,) mm of the effectors
    pull: (sum of n_a,) N, forces of the actuators
    work: (sum of n_a + sum of e,) what forces on points take off these, N, and by how much they move the effectors, mm
    rows: (sum of k,) mm of the skins
    error, stored: the largest and the sum of those of the robots, of `LoadResult.sizes`"""

    displaced: np.ndarray
    pull: np.ndarray
    work: np.ndarray
    rows: np.ndarray
    error: float
    stored: float


@njit(cache=True, error_model="numpy")
def answers(shapes, actuators, numbers, loaded):
    """`Answers` of robots (r,) with so many actuators. numbers: `HeldRobot.answers` of robots with known points, and
    `alone` of the others, one after another."""
    total, error, stored = 0, 0.0, 0.0
    for i in range(len(shapes)):
        total += actuators[i]
        error, stored = max(error, loaded.sizes[i, ERROR]), stored + loaded.sizes[i, STORED]
    displaced, pull, work = loaded.moved.copy(), np.empty(total), np.zeros(total + len(loaded.moved))
    effector, actuator, mode, mixture, number = 0, 0, 0, 0, 0
    for i in range(len(shapes)):
        k, r, e, a = shapes[i, 1], shapes[i, 2], shapes[i, 3], actuators[i]
        for d in range(e):
            work[total + effector + d] = loaded.moved[effector + d]
            displaced[effector + d] = numbers[number + d] + loaded.moved[effector + d]
        lam, number = numbers[number + e : number + e + a], number + e + a
        if shapes[i, 4]:
            c = r * (r + 1) * (r + 2) // 6
            gradient, number = numbers[number : number + a * k].reshape((a, k)), number + a * k
            slopes, number = numbers[number : number + a * k * k].reshape((a, k, k)), number + a * k * k
            cubic, number = numbers[number : number + a * c].reshape((a, c)), number + a * c
            w, v = loaded.w[mode : mode + k], loaded.v[mixture : mixture + r]
        if loaded.sizes[i, BEARS]:
            _relieve(gradient, slopes, cubic, w, v, loaded.sizes[i], work[actuator : actuator + a])
        for d in range(a):
            pull[actuator + d] = lam[d] - work[actuator + d]
        effector, actuator, mode, mixture = effector + e, actuator + a, mode + k, mixture + r
    return Answers(displaced, pull, work, loaded.rows.copy(), error, stored)


@njit(cache=True, error_model="numpy")
def _relieve(gradient, slopes, cubic, w, v, sizes, helped):
    """Puts into helped (n_a,) N by how much forces help the actuators of a robot to stay: loads w (k,) and v (r,) N;
    gradient (n_a, k), slopes (n_a, k, k), and cubic (n_a, c) of three mixtures i <= j <= k each."""
    for a in range(len(gradient)):
        for d in range(len(w)):
            along = 0.0
            for b in range(len(w)):
                along += slopes[a, d, b] * w[b]
            helped[a] += (gradient[a, d] + sizes[FIRST] / 2 * along) * w[d]
        c = 0
        for i in range(len(v)):
            for j in range(i, len(v)):
                along = 0.0
                for k in range(j, len(v)):
                    along += cubic[a, c] * v[k]
                    c += 1
                helped[a] += sizes[SECOND] / 6 * v[i] * v[j] * along
