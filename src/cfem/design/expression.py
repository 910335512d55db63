"""Inequalities of design parameters as a user writes them: 'H - JH >= 13', 'sqrt(L) * H <= 150'."""

import ast
import math
import operator
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from cfem.core.errors import SpecError

_FUNCTIONS = {name: getattr(np, name) for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "abs")}
_FUNCTIONS |= {"min": np.minimum, "max": np.maximum}
_TWO = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
Values = Mapping[str, np.ndarray]


def inequality(text: str, names: Iterable[str], where: str) -> Callable[[Values], np.ndarray]:
    """Function of the names' values (m,), >= 0 where the inequality holds. SpecError where the text is none."""
    known = [*names, "pi"]
    try:
        tree = ast.parse(text, mode="eval").body
    except SyntaxError:
        do = "write such as 'H - JH >= 13', numbers without units, which are those of the parameters (mm, MPa)"
        raise SpecError(f"'{text}' is not an inequality", where=where, do=do) from None
    if not isinstance(tree, ast.Compare) or len(tree.ops) != 1 or not isinstance(tree.ops[0], ast.GtE | ast.LtE):
        raise SpecError(f"'{text}' is not an inequality", where=where, do="write one <= or >=, such as 'H - JH >= 13'")
    _check(tree.left, known, where), _check(tree.comparators[0], known, where)
    sign = 1.0 if isinstance(tree.ops[0], ast.GtE) else -1.0

    def slack(values: Values) -> np.ndarray:
        """Values (m,) of the inequality, >= 0 where it holds. SpecError where one is not finite."""
        scope = {**values, "pi": math.pi}
        with np.errstate(all="ignore"):
            values_of_slack = sign * (_value(tree.left, scope) - _value(tree.comparators[0], scope))
        if not np.isfinite(values_of_slack).all():
            wrong = np.flatnonzero(
                ~np.isfinite(np.broadcast_to(values_of_slack, np.shape(next(iter(values.values())))))
            )[0]
            place = ", ".join(
                f"{name} {np.ravel(values[name])[wrong]:.4g}" for name in sorted(names_in(text)) if name in values
            )
            raise SpecError(
                f"'{text}' has no finite value{f' at {place}' if place else ''}", where=where, do="check divisions"
            )
        return values_of_slack

    return slack


def names_in(text: str) -> set[str]:
    """Names that an expression speaks of."""
    try:
        return {node.id for node in ast.walk(ast.parse(text, mode="eval")) if isinstance(node, ast.Name)}
    except SyntaxError:
        return set()


def _check(node: ast.AST, known: list[str], where: str) -> None:
    """Raises SpecError where a part of an expression is not allowed."""
    if isinstance(node, ast.Name):
        if node.id not in known:
            raise SpecError(f"unknown name '{node.id}'", where=where, do=f"known are {', '.join(known)}")
    elif isinstance(node, ast.BinOp) and type(node.op) in _TWO:
        _check(node.left, known, where), _check(node.right, known, where)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        _check(node.operand, known, where)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS:
        count = _FUNCTIONS[node.func.id].nin
        if len(node.args) != count or node.keywords:
            raise SpecError(f"{node.func.id} takes {count} numbers", where=where)
        for argument in node.args:
            _check(argument, known, where)
    elif not (isinstance(node, ast.Constant) and type(node.value) in (int, float)):
        known_here = f"numbers, parameters, + - * / **, {', '.join(_FUNCTIONS)}"
        raise SpecError(f"'{ast.unparse(node)}' is not allowed", where=where, do=f"use {known_here}")


def _value(node: ast.AST, scope: Mapping[str, np.ndarray | float]) -> np.ndarray | float:
    """Value of a part of an expression."""
    if isinstance(node, ast.Name):
        return scope[node.id]
    if isinstance(node, ast.Constant):
        return np.float64(node.value)  # of which 1/0 is infinite, and no exception
    if isinstance(node, ast.BinOp):
        return _TWO[type(node.op)](_value(node.left, scope), _value(node.right, scope))
    if isinstance(node, ast.UnaryOp):
        return -_value(node.operand, scope)
    return _FUNCTIONS[node.func.id](*(_value(argument, scope) for argument in node.args))
