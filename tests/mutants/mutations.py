"""The mutants of a module: each is one small fault in its text."""

import ast
import copy
from collections.abc import Iterator
from typing import Final, NamedTuple

_COMPARED: Final = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_RECKONED: Final = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.FloorDiv,
    ast.FloorDiv: ast.Mult,
    ast.Div: ast.Mult,
    ast.Mod: ast.Add,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}
# A number this large is doubled: of a billion nanoseconds, nobody could see one more.
_MANY: Final = 1000
# What is said to people, and what is read by tools alone.
_SAID: Final = frozenset({"log", "info", "warning", "error", "debug", "exception"})
_FOR_TOOLS: Final = frozenset({"__slots__", "__all__", "__repr__"})


class Mutant(NamedTuple):
    """A fault: the text between two places in a module is another."""

    line: int
    last_line: int
    begin: int
    end: int
    before: str
    after: str


def mutants_of(source: str) -> list[Mutant]:
    """Return all mutants of a module's text, in its order."""
    tree = ast.parse(source)
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    whole = source.encode()
    found = []
    for node, changed in _changes(tree):
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)
        before, after = whole[begin:end].decode(), changed if isinstance(changed, str) else f"({ast.unparse(changed)})"
        if before != after:
            found.append(Mutant(node.lineno, node.end_lineno or node.lineno, begin, end, before, after))
    return sorted(set(found), key=lambda each: (each.begin, each.end, each.after))


def mutated(source: str, mutant: Mutant) -> str:
    """Return a module's text with a mutant in it."""
    whole = source.encode()
    return (whole[: mutant.begin] + mutant.after.encode() + whole[mutant.end :]).decode()


def _changes(tree: ast.AST) -> Iterator[tuple["ast.expr | ast.stmt", "ast.expr | str"]]:
    for node in _code(tree):
        if isinstance(node, ast.expr):
            for other in _other_values(node):
                yield node, other
        elif isinstance(node, ast.stmt):
            for text in _other_statements(node):
                yield node, text


def _other_values(node: ast.expr) -> Iterator[ast.expr]:
    match node:
        case ast.Compare(ops=[op]):
            for other in _COMPARED[type(op)]:
                yield _with(node, ops=[other()])
        case ast.BinOp(op=op) if type(op) in _RECKONED:
            yield _with(node, op=_RECKONED[type(op)]())
        case ast.BoolOp(op=op):
            yield _with(node, op=ast.Or() if isinstance(op, ast.And) else ast.And())
            yield node.values[0]
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield node.operand
        case ast.IfExp():
            yield from (node.body, node.orelse)
        case ast.Constant(value=bool() | int() | float() as value):
            yield ast.Constant(not value if isinstance(value, bool) else value + (1 if value < _MANY else value))


def _other_statements(node: ast.stmt) -> Iterator[str]:
    match node:
        case ast.Return(value=ast.expr() as value) if not _is_nothing(value):
            yield "return None"
        case ast.Break():
            yield "continue"
        case ast.Continue():
            yield "break"
        case ast.Expr(value=ast.Call()) | ast.AugAssign():
            yield "pass"


def _with(node: ast.expr, **fields: object) -> ast.expr:
    other = copy.copy(node)
    for name, value in fields.items():
        setattr(other, name, value)
    return other


def _is_nothing(value: ast.expr) -> bool:
    """Whether it is None or False: what asks for the truth of a result takes one for the other."""
    return isinstance(value, ast.Constant) and (value.value is None or value.value is False)


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what runs: no annotations, no decorators, no texts for people, nothing for type checkers alone."""
    match node:
        case ast.If(test=ast.Name(id="TYPE_CHECKING")) | ast.Import() | ast.ImportFrom() | ast.JoinedStr():
            return
        case ast.Call(func=ast.Attribute(attr=name)) | ast.Expr(value=ast.Call(func=ast.Attribute(attr=name))) if (
            name in _SAID
        ):
            return
        case ast.Assign(targets=[ast.Name(id=name)]) | ast.FunctionDef(name=name) if name in _FOR_TOOLS:
            return
        case ast.keyword(arg="strict"):
            # Of zip: an assertion, which nothing that holds can break.
            return
    yield node
    skipped = {id(getattr(node, name, None)) for name in ("annotation", "returns")}
    skipped |= {id(each) for each in getattr(node, "decorator_list", ())}
    for child in ast.iter_child_nodes(node):
        if id(child) not in skipped:
            yield from _code(child)
