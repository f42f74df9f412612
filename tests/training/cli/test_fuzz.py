"""Whatever is typed or handed in: it works, or it fails with a message that names the key or the value."""

import os
import tempfile
import warnings

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from fowt_env import build_scene
from fowt_env.descriptions.sea_state import SEA_KEYS
from fowt_env.descriptions.wind import KINDS
from fowt_env.errors import InputError, PlantWarning
from fowt_env.scene.options import OPTIONS
from fowt_env.training.cli import app as cli
from fowt_env.training.cli import console


def examples(count):
    """Settings of a search: the quick ones the same each time, since a failure by chance helps nobody."""
    return settings(
        max_examples=count, deadline=None, derandomize=count < 1000, suppress_health_check=list(HealthCheck)
    )


# ---------------------------------------------------------------- command lines

NASTY = st.sampled_from(
    (
        "", " ", "nan", "inf", "-inf", "1e400", "-1", "0", "1e300", "abc", "a" * 3000, "{}", "[]", "null",
        "{", '{"kind": 3}', '{"kind": "ntm"}', '{"kind": "ntm", "speed": [1]}', '{"kind": "bts"}', "1,2",
        "::", ":", "ntm:18:", "ntm:1e300:B", "ntm:-5:B", "eog:0", "jonswap:1e9:10", "jonswap:1:1e-300",
        "jonswap:0:0", "regular:1:1e-9", "regular:1:1e9", "../..", "/", "/dev/null", "~", "é", "[bold]",
        "[/]", "%s", "x.csv", "/proc/x.csv", "a:b/x.parquet", "x.png", "x.xyz", "=", "=1", "KEY=",
        "duration=nan", "current=[1]", "PtfmPitch=1e300", "PtfmPitch=[1]", "RotSpeed=NaN", "BldPitch1=-1",
        "nope=1",
    )
)  # fmt: skip
TEXT = NASTY | st.text(st.characters(blacklist_characters="\0", blacklist_categories=["Cs"]), max_size=12)
USUAL = {  # values that work, of the kinds of scene that the tests have compiled
    "--platform": ("oc3_hywind",),
    "--wind": ("18", "8", '{"kind": "steady", "speed": 12}'),
    "--sea": ("none",),
    "--controller": ("pi", "pi_land"),
    "--duration": ("1", "2"),
    "--dt": ("0.1", "0.05"),
    "--control-dt": ("0.1", "0.2"),
    "--output-dt": ("0.1", "0.5"),
    "--seed": ("0", "7"),
    "--fidelity": ("standard",),
    "--start": ("trim", "zero"),
    "--initial": ("PtfmPitch=3", "RotSpeed=11"),
    "--option": ("wave_components=50", "shear_exponent=0.1"),
    "--out": ("run.csv", "run.parquet"),
}
BASE = {"--duration": "1", "--fidelity": "standard"}


@st.composite
def simulate_arguments(draw):
    """(arguments, {option: value} of those that may be wrong)."""
    chosen = draw(st.lists(st.sampled_from(sorted(USUAL)), unique=True, max_size=4))
    given_values = dict(BASE)
    odd = {}
    for option in chosen:
        if draw(st.booleans()):
            given_values[option] = draw(st.sampled_from(USUAL[option]))
        else:
            given_values[option] = odd[option] = draw(TEXT)
    return [part for option, value in given_values.items() for part in (f"{option}={value}",)], odd


def check_command(arguments, odd):
    """Run `fowt` in an empty folder; assert a clean end, and that a refusal names what was odd."""
    before = os.getcwd()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", PlantWarning)  # of weather that can hardly be meant
        os.chdir(folder)
        try:
            result = CliRunner().invoke(cli.app, arguments, env={"COLUMNS": "10000", "NO_COLOR": "1"})
        finally:
            os.chdir(before)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code in (0, console.EXIT_STOPPED, console.EXIT_INPUT), result.output
    if result.exit_code == console.EXIT_INPUT:
        said = result.stderr.lower()
        names = [option.strip("-").replace("-", "_") for option in odd] + [o.strip("-") for o in odd]
        values = [value.strip().partition("=")[0][:20].lower() for value in odd.values()]
        assert odd and any(name in said for name in (*names, *filter(None, values))), result.stderr


def often(count):
    """Parameters of a search: a quick one, and one of `count` examples that runs at night."""
    marks = pytest.mark.nightly
    return pytest.mark.parametrize("count", [None, pytest.param(count, marks=marks)])


@often(1000)
def test_simulate_works_or_names_what_is_wrong(count):
    @examples(count or 60)
    @given(simulate_arguments())
    def search(case):
        check_command(["simulate", *case[0]], case[1])

    search()


@examples(60)
@given(option=st.sampled_from(["--winds", "--platform", "--rotor", "--option", "--out"]), value=TEXT)
def test_trim_works_or_names_what_is_wrong(option, value):
    usual = {"--winds": "18", "--rotor": "lookup", "--option": "integrator=ab4"}
    arguments = [f"{name}={text}" for name, text in (usual | {option: value}).items()]
    check_command(["model", "trim", *arguments], {option: value})


@examples(40)
@given(value=TEXT)
def test_list_works_or_names_what_is_wrong(value):
    check_command(["list", "--", value], {"kind": value})


# ---------------------------------------------------------------- scene descriptions

JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**6), 10**6),
    st.floats(allow_nan=True, allow_infinity=True),
    st.text(max_size=6),
    st.sampled_from((10**400, "nan", "ntm", b"bytes", 1j, (1.0, 2.0), [], {}, [1, "a"], [[1.0]], {"a": {}})),
    st.lists(st.floats(-10.0, 30.0), max_size=4),
)
WIND_KEYS = sorted({key for kind in KINDS.values() for key in kind.keys.model_fields})
WAVE_KEYS = sorted({key for needed, further in SEA_KEYS.values() for key in (*needed, *further)})


def description(kinds, keys):
    """A mapping with a kind, right or wrong, and a few keys of any kind with any value."""
    kind = st.sampled_from(sorted(kinds)) | JUNK
    values = st.dictionaries(st.sampled_from([*keys, "heading", "colour"]), JUNK, max_size=4)
    return st.tuples(kind, values).map(lambda pair: {"kind": pair[0]} | pair[1])


LONG = ("duration", "wave_components")  # right values of these make long runs, not wrong ones
ARGUMENTS = {
    "platform": st.just("oc3_hywind") | JUNK,
    "wind": description(KINDS, WIND_KEYS) | st.floats(0.0, 30.0) | JUNK,
    "sea": description(SEA_KEYS, WAVE_KEYS) | st.sampled_from(["paper_wind_wave", "nowhere"]) | JUNK,
    "seed": st.integers(0, 9) | JUNK,
    "rotor": st.sampled_from(["bem", "lookup", "round"]) | JUNK,
    "fidelity": st.sampled_from(["reference", "standard", "good"]) | JUNK,
    **{name: JUNK for name in OPTIONS if name not in LONG},
    "duration": st.sampled_from([30.0, 0.0, -1.0, "x", None, float("nan"), 1e300, 10**400]),
    "wave_components": st.sampled_from([20, 0, -5, 1.5, "x", True, 10**9, 10**400]),
    "no_such_option": JUNK,
}
# two at a time, wind and sea most of all: of many wrong ones only the first is ever looked at
NAMES = st.sampled_from([*ARGUMENTS, *["wind", "sea"] * 8])
CHOSEN = st.sets(NAMES, max_size=2).flatmap(
    lambda names: st.fixed_dictionaries({name: ARGUMENTS[name] for name in sorted(names)})
)
SCENE = CHOSEN.map(lambda arguments: {"duration": 30.0, "fidelity": "standard"} | arguments)


def check_scene(arguments):
    """Build the scene; assert that a refusal names a key or value of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", PlantWarning)  # of weather that can hardly be meant
        try:
            scene = build_scene(**arguments)
        except InputError as error:
            text = str(error)
            inner = [key for value in arguments.values() if isinstance(value, dict) for key in value]
            keys = [str(key).replace("_", " ") for key in (*arguments, *inner)]
            assert any(key in text.replace("_", " ") for key in keys), text
        else:
            assert scene.model.rigid_body.mass > 0.0


@often(5000)
def test_a_scene_is_built_or_refused_by_name(count):
    examples(count or 100)(given(SCENE)(check_scene))()
