"""Makes `gymnasium.make("fowt_env/OC3Hywind-v1")` work without importing fowt_env first.

Gymnasium 0.26 to 0.29 called the functions of the entry-point group "gymnasium.envs"; 1.0 dropped that
and knows only what has been imported. So the installed file fowt_env_registration.pth calls
register_with_gymnasium() when Python starts: it waits for gymnasium to be imported, and then adds
the id, as text. Neither gymnasium nor fowt_env is loaded before somebody asks for it, nor anything else:
every Python of the environment starts with it.
"""

import sys

ENVIRONMENTS = {"fowt_env/OC3Hywind-v1": "fowt_env.envs:FowtEnv"}
VECTOR_ENTRY_POINT = "fowt_env.envs:FowtVectorEnv"  # of each of them


def register_envs():
    """Add the ids to Gymnasium's registry, each once however often this is called."""
    from gymnasium.envs.registration import register, registry

    for name, entry_point in ENVIRONMENTS.items():
        if name not in registry:
            register(id=name, entry_point=entry_point, vector_entry_point=VECTOR_ENTRY_POINT)


class _GymnasiumWatch:
    """Import hook that runs register_envs after the first import of gymnasium.envs."""

    def find_spec(self, name, path=None, target=None):
        if name != "gymnasium.envs":
            return None
        from importlib.machinery import PathFinder

        sys.meta_path.remove(self)
        spec = PathFinder.find_spec(name, path, target)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_and_register(module):
            execute(module)
            try:
                register_envs()
            except Exception as error:  # gymnasium is for others too, and does without these
                import warnings

                warnings.warn(f"fowt_env's environments are not registered: {error!r}", stacklevel=2)

        spec.loader.exec_module = execute_and_register
        return spec


def register_with_gymnasium():
    """Register now if gymnasium is loaded, else as soon as it is."""
    if "gymnasium.envs" in sys.modules:
        register_envs()
    elif not any(isinstance(finder, _GymnasiumWatch) for finder in sys.meta_path):
        sys.meta_path.insert(0, _GymnasiumWatch())
