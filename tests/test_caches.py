
import pytest
from fresh_python import fresh_python

import fowt_env
from fowt_env.caches import _CACHES, Cache, cached, clear_caches


@pytest.fixture
def cache():
    made = Cache(2)
    yield made
    _CACHES.remove(made)


def test_a_value_is_made_once_and_the_least_used_one_goes(cache):
    made = []

    def get(key):
        return cache.get(key, lambda: made.append(key) or key.upper())

    assert [get(key) for key in "abacb"] == ["A", "B", "A", "C", "B"]
    assert made == ["a", "b", "c", "b"]  # c pushed b out, since a was used after b
    assert len(cache) == 2


def test_one_call_empties_every_cache(cache):
    calls = []
    function = cached(4)(lambda x: calls.append(x) or x)
    cache.get("a", lambda: 1)
    function(1), function(1)
    clear_caches()
    function(1)
    assert len(cache) == 0 and calls == [1, 1]
    _CACHES.remove(function)


def test_what_is_computed_anew_has_the_same_bits():
    def run():
        scene = fowt_env.build_scene(wind={"kind": "ntm", "speed": 14.0}, fidelity="fast")
        return fowt_env.simulate(scene, "lqr", duration=2.0)

    before = run()
    clear_caches()
    assert run().equals(before)


def test_the_import_changes_neither_environment_variables_nor_numba():
    code = (
        "import os\n"
        "for name in [n for n in os.environ if n.startswith(('OMP', 'GOMP'))]: del os.environ[name]\n"
        "from numba import config\n"
        "settings = {name: getattr(config, name) for name in dir(config) if name.isupper()}\n"
        "variables = dict(os.environ)\n"
        "import fowt_env, fowt_env.envs, fowt_env.controllers, fowt_env.training.cli.app\n"
        "for name in fowt_env.__all__: getattr(fowt_env, name)\n"
        "assert dict(os.environ) == variables, set(os.environ.items()) ^ set(variables.items())\n"
        "after = {name: getattr(config, name) for name in settings}\n"
        "assert after == settings, {name for name in after if after[name] != settings[name]}\n"
    )
    fresh_python(code)
