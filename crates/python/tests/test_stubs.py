"""The stubs name what the module has, and nothing else."""

import ast
from pathlib import Path

import hysteron
from hysteron import _hysteron


def public(names):
    return {name for name in names if not name.startswith("_")}


def test_val_stubs_are_the_module():
    tree = ast.parse(Path(hysteron.__file__).with_name("_hysteron.pyi").read_text(encoding="utf-8"))
    stubs = {node.name: node for node in tree.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    # Dictionaries are described, and are no classes of the module.
    stubs = {name: node for name, node in stubs.items() if "TypedDict" not in map(ast.unparse, getattr(node, "bases", []))}
    assert public(stubs) == public(vars(_hysteron))
    assert public(stubs) <= set(hysteron.__all__)
    for name, node in stubs.items():
        if isinstance(node, ast.ClassDef) and name != "Error":
            methods = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
            values = {part.target.id for part in node.body if isinstance(part, ast.AnnAssign)}
            assert public(methods | values) == public(vars(getattr(_hysteron, name))), name
