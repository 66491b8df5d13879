"""Makes mutants: copies of a module's source with one small fault.

A mutant changes a comparison, a number, a sign, a logical operator or a returned value, or omits a
call. If the tests still pass, they do not test that place.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

_COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}
_UNSEEN_CALLS = ("debug", "info", "warning", "exception")


@dataclass(frozen=True)
class Mutant:
    """One changed place: its line, its original text, and the whole changed module."""

    line: int
    was: str
    becomes: str
    tree: ast.Module

    def __str__(self) -> str:
        return f"line {self.line}: {self.was}  ->  {self.becomes}"


def mutants(source: str) -> Iterator[Mutant]:
    """Yield every mutant of a module."""
    tree = ast.parse(source)
    # The type checker already checks the arguments of decorators (frozen, slots).
    declared = {
        part
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        for decorator in node.decorator_list
        for part in ast.walk(decorator)
    }
    for number, node in enumerate(ast.walk(tree)):
        if node in declared:
            continue
        for variant in range(len(_variants(node))):
            changed = ast.parse(source)
            target = list(ast.walk(changed))[number]
            was = ast.unparse(target)
            _variants(target)[variant]()
            yield Mutant(getattr(node, "lineno", 0), was, ast.unparse(target), changed)


def _variants(node: ast.AST) -> list:
    """Return the possible changes of this node, as functions that make them."""
    if isinstance(node, ast.Compare):
        return [
            lambda i=i, kind=kind: node.ops.__setitem__(i, kind())
            for i, op in enumerate(node.ops)
            if (kind := _COMPARISONS.get(type(op))) is not None
        ]
    if isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        return [lambda: setattr(node, "op", other)]
    if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
        return [lambda: setattr(node, "op", _ARITHMETIC[type(node.op)]())]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return [lambda: node.__dict__.update(op=ast.UAdd(), operand=_as_bool(node.operand))]
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        return [lambda: setattr(node, "value", not node.value)]
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return [lambda: setattr(node, "value", node.value + 1)]
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        name = node.value.func.attr if isinstance(node.value.func, ast.Attribute) else ""
        if name not in _UNSEEN_CALLS:
            return [lambda: setattr(node, "value", ast.Constant(None))]
    if isinstance(node, ast.Return) and not _is_plain(node.value):
        return [lambda: setattr(node, "value", ast.Constant(None))]
    return []


def _as_bool(node: ast.expr) -> ast.expr:
    return ast.Call(ast.Name("bool", ast.Load()), [node], [])


def _is_plain(node: ast.expr | None) -> bool:
    return node is None or isinstance(node, ast.Constant)
