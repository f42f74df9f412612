"""The public layer carries types, and a checker sees them."""

import ast
import inspect
from pathlib import Path

import fowt_env
from fowt_env.envs import FowtEnv, FowtVectorEnv

ROOT = Path(fowt_env.__file__).parent


def public_functions():
    """The functions a user calls: public names of the package, methods of its public classes."""
    found = [getattr(fowt_env, name) for name in ("build_scene", "simulate", "trim")]
    for owner in (FowtEnv, FowtVectorEnv, fowt_env.Scene):
        found += [f for name, f in vars(owner).items() if inspect.isfunction(f) and name[0] != "_"]
    return found


def test_public_functions_carry_types():
    bare = []
    for function in public_functions():
        signature = inspect.signature(function)
        hints = {name: p.annotation for name, p in signature.parameters.items() if name != "self"}
        hints["return"] = signature.return_annotation
        missing = [name for name, hint in hints.items() if hint is inspect.Signature.empty]
        bare += [f"{function.__qualname__}: {name}" for name in missing]
    assert not bare


def test_a_type_checker_is_told_every_public_name():
    """They are loaded on first use, which a checker cannot follow: it reads them under TYPE_CHECKING."""
    tree = ast.parse((ROOT / "__init__.py").read_text())
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    told = {alias.asname for node in block.body for alias in node.names}
    assert told == set(fowt_env.__all__)
    assert (ROOT / "py.typed").is_file()
