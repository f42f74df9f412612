"""The layers and what each may import: an arrow goes from a layer to one further down, never up."""

import ast
import re
from pathlib import Path

import fowt_env
from fowt_env.plant.compile.sources import read_source

ROOT = Path(fowt_env.__file__).resolve().parent.parent
# from the ground up; a layer imports itself and what stands before it
LAYERS = (
    "errors", "caches", "folders", "layout", "display", "registration", "plant", "shipped", "loop",
    "descriptions", "weather", "scene", "files", "analysis", "control", "run", "realtime", "visual", "envs",
    "warmup",
    "controllers", "training", "training.evaluation", "training.design", "training.rl", "training.reports",
    "training.live", "training.board", "training.loads", "training.validation", "training.benchmarks",
    "training.studies", "training.cli",
)  # fmt: skip


def module_paths():
    """{dotted name below fowt_env: path} of every module."""
    found = {}
    for top in ("fowt_env", "controllers", "training"):
        for path in (ROOT / top).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            parts = parts[1:] if parts[0] == "fowt_env" else parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = module_paths()


def layer_of(module):
    """The layer that a module is in."""
    head, *rest = module.split(".")
    return ".".join((head, *rest[:1])) if head == "training" and rest else head


def imports(path):
    """Modules of this project that a source imports, at its top or inside a function."""
    found = set()
    for name in read_source(path).imports:
        assert not name.startswith("."), f"{path}: imports are absolute"
        top, _, inner = name.partition(".")
        found |= {inner} & set(MODULES) if top == "fowt_env" else set()
    return sorted(found - {""})


def test_imports_go_down():
    homeless = {layer_of(module) for module in MODULES if module} - set(LAYERS)
    assert not homeless
    upward = [
        f"{module} imports {name}"
        for module, path in MODULES.items()
        for name in imports(path)
        if module and layer_of(name) in LAYERS[LAYERS.index(layer_of(module)) + 1 :]
    ]
    assert not upward and len(MODULES) > 300


def test_no_module_reads_a_file_of_the_tests_the_examples_or_the_pages():
    texts = [
        f"{module}: {node.value}"
        for module, path in MODULES.items()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " not in node.value
        if node.value.partition("/")[0] in ("tests", "examples", "docs")
    ]
    assert not texts


def test_the_page_for_contributors_lists_the_layers():
    """Each list from the top down, as the imports go."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    lists = r"Within `fowt_env` it is (.*?); within `training` it is (.*?)\. "
    simulator, training = re.search(lists, text, re.S).groups()
    # but for the last, what all may import
    apart = ("errors", "caches", "folders", "layout", "display", "registration", "controllers")
    inside = [name for name in LAYERS if name not in apart and name.partition(".")[0] != "training"]
    assert re.findall(r"`(\w+)`", simulator) == inside[::-1]
    inside = [name.partition(".")[2] for name in LAYERS if name.startswith("training.")]
    assert re.findall(r"`(\w+)`", training) == inside[::-1]
