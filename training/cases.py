"""Named load cases on which controllers are compared."""

from dataclasses import dataclass, field

from fowt_env.description import joint_sea_state
from fowt_env.errors import InputError, unknown

SITE = "gulf_of_maine_normal"  # joint wind and wave states of the named suites
ABOVE_RATED = (12, 14, 16, 18, 20, 22, 24)  # m/s at hub height
BELOW_RATED = (4, 6, 8, 10)


@dataclass(frozen=True)
class Case:
    """One load case: what build_scene is given, apart from the seed."""

    name: str
    wind: object = None  # as build_scene takes it
    sea: object = None
    platform: str = "oc3_hywind"
    # further options of build_scene; "standard" is within 1e-3 of "reference" at a fraction of the time
    options: dict = field(default_factory=lambda: {"fidelity": "standard"})


def _normal_operation(speed):
    """Normal turbulence of class B with the site's normal sea state at that wind (IEC 61400-3 DLC 1.2)."""
    wind = {"kind": "ntm", "speed": float(speed), "class": "B"}
    return Case(f"ntm_{speed}", wind, joint_sea_state(SITE, float(speed)))


def _steady(speed):
    """Steady wind with the shear of the site over still water."""
    return Case(f"steady_{speed}", float(speed), None)


def _paper_18():
    """Wind and wave case of the paper (Hs 7.5 m, Tp 10 s, gamma 3.3, 18 m/s); its turbulence class is not
    printed, class B is this project's choice."""
    wind = {"kind": "ntm", "speed": 18.0, "class": "B"}
    return Case("paper_18", wind, "paper_wind_wave")


CASES = {
    **{f"ntm_{v}": (_normal_operation, v) for v in BELOW_RATED + ABOVE_RATED},
    **{f"steady_{v}": (_steady, v) for v in BELOW_RATED + ABOVE_RATED},
    "paper_18": (_paper_18,),
}
SUITES = {
    "above_rated": tuple(f"ntm_{v}" for v in ABOVE_RATED),
    "full_range": tuple(f"ntm_{v}" for v in BELOW_RATED + ABOVE_RATED),
    "steady": tuple(f"steady_{v}" for v in BELOW_RATED + ABOVE_RATED),
}


def named_cases(names):
    """List of Cases for names of cases and suites, each once, in the order asked for.

    names: a name, several separated by commas, or a sequence of names.
    Raises: InputError for an unknown name.
    """
    if isinstance(names, str):
        names = [name.strip() for name in names.split(",") if name.strip()]
    wanted = {}
    for name in names:
        if name not in SUITES and name not in CASES:
            raise unknown("case", name, (*SUITES, *CASES))
        for case in SUITES.get(name, (name,)):
            make, *arguments = CASES[case]
            wanted.setdefault(case, make(*arguments))
    if not wanted:
        raise InputError("cases: none were named")
    return list(wanted.values())
