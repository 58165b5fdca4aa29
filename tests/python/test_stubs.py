"""The type stub agrees with the library."""

import ast
import inspect
from pathlib import Path

import hyst
import pytest

STUB = ast.parse((Path(hyst.__file__).parent / "_hyst.pyi").read_text())
CLASSES = {node.name: node for node in STUB.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")}
FUNCTIONS = {node.name: node for node in STUB.body if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")}
COMPILED = {name for name in vars(hyst._hyst) if not name.startswith("_")}


def arguments(node):
    """Returns the names of positional and of keyword arguments, each with its default."""
    a = node.args
    positional = a.posonlyargs + a.args
    defaults = [None] * (len(positional) - len(a.defaults)) + a.defaults

    def value(default):
        return inspect.Parameter.empty if default is None else ast.literal_eval(default)

    positional = [(p.arg, value(d)) for p, d in zip(positional, defaults) if p.arg not in ("self", "cls")]
    return positional, [(k.arg, value(d)) for k, d in zip(a.kwonlyargs, a.kw_defaults)]


def signature(thing):
    positional, keyword = [], []
    for p in inspect.signature(thing).parameters.values():
        if p.name not in ("self", "cls") and p.kind is not p.VAR_KEYWORD:
            into = keyword if p.kind is p.KEYWORD_ONLY else positional
            into.append((p.name, p.default))
    return positional, keyword


def same(stub, real):
    """Returns whether two lists of arguments agree. The signature shows a default that is an expression as Ellipsis."""
    return [name for name, _ in stub] == [name for name, _ in real] and all(
        a == b or (b is Ellipsis and a is not inspect.Parameter.empty) for (_, a), (_, b) in zip(stub, real)
    )


def agree(node, thing):
    (positional, keyword), (real_positional, real_keyword) = arguments(node), signature(thing)
    return same(positional, real_positional) and same(keyword, real_keyword)


def block(name):
    """Returns a draft of the stub of a class of parameters."""
    _, keyword = signature(getattr(hyst, name))
    head = ", ".join(f"{k}: float" + ("" if d is inspect.Parameter.empty else f" = {d!r}") for k, d in keyword)
    properties = "".join(f"    @property\n    def {k}(self) -> float: ...\n" for k, _ in keyword)
    return f"class {name}(Operator):\n    def __new__(cls, *, {head}) -> {name}: ...\n{properties}"


def test_nothing_is_missing():
    missing = sorted(COMPILED - CLASSES.keys() - FUNCTIONS.keys())
    assert not missing, "add to _hyst.pyi:\n" + "\n".join(block(name) for name in missing)
    assert not (CLASSES.keys() | FUNCTIONS.keys()) - COMPILED
    assert COMPILED <= set(hyst.__all__)
    assert (Path(hyst.__file__).parent / "py.typed").exists()


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_functions(name):
    assert agree(FUNCTIONS[name], getattr(hyst, name))


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_classes(name):
    real, stub = getattr(hyst, name), CLASSES[name]
    assert [b.id for b in stub.bases] == [b.__name__ for b in real.__bases__ if b is not object]
    methods = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
    public = {n for n in vars(real) if not n.startswith("_")}
    assert {n for n in methods if not n.startswith("_")} == public
    for method, node in methods.items():
        if any(isinstance(d, ast.Name) and d.id == "property" for d in node.decorator_list):
            assert inspect.isgetsetdescriptor(vars(real)[method])
        elif method == "__new__":
            assert agree(node, real), method
        elif not method.startswith("__"):
            assert agree(node, getattr(real, method)), method
