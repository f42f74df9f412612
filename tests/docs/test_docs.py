"""Pages of docs/ that say what the code says, and the site that is built of them."""

import html
import importlib.util
import os
import pkgutil
import re
import subprocess
import sys
from math import exp, hypot, log, pi, radians

import numpy as np
import pandas as pd
import pytest
from doc_pages import DOCS, FENCE, defined
from offline_browser import browser, offline_page  # noqa: F401  # a fixture

import fowt_env
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs import FowtEnv
from fowt_env.envs.rewards import N_TERMS, REWARD_TERMS, build_scales, fill_terms
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure
from fowt_env.registration import ENVIRONMENTS, LADDER, OBJECTIVES
from fowt_env.training.benchmarks import compile_time

ROOT = DOCS.parent


def tool(name):
    """A module of docs/tools."""
    spec = importlib.util.spec_from_file_location(name, DOCS / "tools" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PAGES = tool("reference_pages")
AGAIN = "python docs/tools/reference_pages.py writes it anew"


@pytest.mark.parametrize("page", PAGES.TABLES)
def test_the_tables_of_a_page_are_those_of_the_code(page):
    text = (DOCS / page).read_text()
    assert PAGES.with_tables(page, text) == text, AGAIN


def test_the_page_of_the_command_line_is_that_of_the_commands():
    assert PAGES.cli_page() == (DOCS / "reference/cli.md").read_text(), AGAIN


def clip(x, low, high):
    return min(max(x, low), high)


def tolerance(x, low, high, margin):
    if low <= x <= high:
        return 1.0
    distance = low - x if x < low else x - high
    return exp(log(0.1) * (distance / margin) ** 2)


def test_the_printed_reward_formulas_give_what_the_kernels_give():
    turbine, control_dt = read_turbine("nrel5mw"), 0.1
    rng = np.random.default_rng(5)
    law, scales = turbine.torque_law, build_scales(turbine, control_dt)
    formulas = PAGES.reward_formulas()
    for _ in range(200):
        before, now = np.zeros((2, N_MEASUREMENTS))
        now[Measure.ROTOR_SPEED] = rng.uniform(0.2, 1.8)
        now[Measure.GENERATOR_TORQUE] = rng.uniform(0.0, 47e3)
        now[Measure.PLATFORM_PITCH], now[Measure.PLATFORM_PITCH_RATE] = rng.normal(scale=[0.08, 0.02])
        now[Measure.BLADE_PITCH], now[Measure.NACELLE_ACCELERATION] = rng.uniform(0.0, 0.5), rng.normal()
        before[Measure.BLADE_PITCH] = now[Measure.BLADE_PITCH] + rng.normal(scale=0.01)
        before[Measure.GENERATOR_TORQUE] = now[Measure.GENERATOR_TORQUE] + rng.normal(scale=1e3)
        reference = np.array([rng.normal(scale=0.05), rng.uniform(0.7, 1.4)])
        failed = bool(rng.integers(2))
        names = {
            "clip": clip, "tolerance": tolerance, "hypot": hypot, "radians": radians, "pi": pi,
            "min": min, "abs": abs,
            "P": now[Measure.GENERATOR_TORQUE] * turbine.drivetrain.gear_ratio * now[Measure.ROTOR_SPEED],
            "P_rated": law.rated_power,
            "W": now[Measure.ROTOR_SPEED], "W_0": reference[1], "W_rated": turbine.rated_rotor_speed,
            "theta": now[Measure.PLATFORM_PITCH], "theta_0": reference[0],
            "rate": now[Measure.PLATFORM_PITCH_RATE], "a": now[Measure.NACELLE_ACCELERATION],
            "beta": now[Measure.BLADE_PITCH], "beta_before": before[Measure.BLADE_PITCH],
            "beta_rate": turbine.pitch_drive.rate_limit,
            "Q": now[Measure.GENERATOR_TORQUE], "Q_before": before[Measure.GENERATOR_TORQUE],
            "Q_rate": law.max_torque_rate, "control_dt": control_dt, "failed": failed,
        }  # fmt: skip
        terms = np.full(N_TERMS, np.nan)
        fill_terms(now, before, reference, failed, scales, terms)
        printed = [eval(formulas[term], {"__builtins__": {}}, names) for term in REWARD_TERMS]
        np.testing.assert_allclose(terms, printed, rtol=1e-12, atol=1e-15)


def test_the_info_table_has_every_key_and_no_other():
    section = (
        (DOCS / "reference/environment.md").read_text().partition("\n## Info\n")[2].partition("\n## ")[0]
    )
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| `")]
    told = {"reset": set(), "step": set(), "last step": set(), "step, at a failure": set()}
    for key, where, _ in rows:
        name = key.strip("`")
        if where == "step, of the reward of goals":
            continue
        names = [f"reward/{term}" for term in REWARD_TERMS] if name == "reward/<term>" else [name]
        for place in where.split(", ") if "failure" not in where else [where]:
            told[place].update(names)
    env = FowtEnv("above_rated")
    assert set(env.reset(seed=1)[1]) == told["reset"]
    assert set(env.step([0.0, 0.0])[4]) == told["step"]
    env.reset(seed=1, options={"offsets": {"RotSpeed": 6.0}})
    assert set(env.step([0.0, 0.0])[4]) == told["step"] | told["last step"] | told["step, at a failure"]


README, VALIDATION, SPEED = "README.md", "docs/results/validation.md", "docs/results/speed.md"
PERFORMANCE, PAPER = "docs/explanation/performance.md", "docs/joss/paper.md"
CONTROLLERS, AGENTS = "docs/results/controllers.md", "docs/results/agents.md"
FIGURES = {  # what several pages say: {page: pattern with the figure as its group}
    "speed of standard": {
        README: r"one core \(([\d,]+) times real time\)",
        PERFORMANCE: r"\| `\"standard\"` \|.*\| ([\d,]+) \|",
        SPEED: r"([\d,]+) with\s`standard`, ",
        PAPER: r"measures ([\d,]+) times real time",
    },
    "figures of the validation": {
        README: r"\d+ of (\d+) compared values",
        VALIDATION: r"One value of (\d+) misses its target",
        PAPER: r"\d+ of (\d+) compared values",
    },
    "rotor speed of mpc": {
        README: r"\| `mpc` \| (\S+) %",
        CONTROLLERS: r"\| `mpc` \| (\S+) %",
    },
    "rotor speed of mpc on the rigid turbine": {
        CONTROLLERS: r"\| `mpc` \| [^|]+ \| \S+ (\S+) %",
        AGENTS: r"`mpc` alone is at (\S+) % in rotor speed",
    },
    "score of mpc": {
        README: r"\| `mpc` \| -.*\*\*(\d\S+) ",
        CONTROLLERS: r"\| `mpc` \| -.*\*\*(\d\S+) ",
    },
    "score of mpc on the rigid turbine": {
        README: r"the rigid turbine.* `mpc` (\S+),",
        CONTROLLERS: r"\| `mpc` \| five.* \*\*(\S+) ",
        AGENTS: r"\| `mpc` \|.* (\S+) \|",
    },
    "score of the agent": {
        README: r"`policy:ppo_lqr` \(RL\) (\d\S+\d)",
        CONTROLLERS: r"\| `policy:ppo_lqr` .* \| (\S+) \[",
        AGENTS: r"\| PPO on `lqr`, seeds 0, 1, 2 .*\| (\S+), \S+, \S+ \|",
    },
}


def test_pages_that_give_the_same_figure_agree():
    wrong = {}
    for name, patterns in FIGURES.items():
        found = {page: re.findall(pattern, (ROOT / page).read_text()) for page, pattern in patterns.items()}
        values = list(found.values())
        if any(len(each) != 1 or each != values[0] for each in values):
            wrong[name] = found
    assert not wrong


def stored(name):
    """Rows of a stored sweep of docs/figures by variant."""
    return pd.read_csv(DOCS / "figures" / name, comment="#").groupby("variant")


def table_of(heading):
    """Rows of cells of the first table after a heading of the page of measured speeds."""
    text = (ROOT / SPEED).read_text().partition(f"# {heading}\n")[2]
    lines = [line for line in text.partition("\n#")[0].splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[1:]]


def shows(text, speed):
    """Whether a text is a speed, rounded to three figures and a whole number."""
    return abs(float(text.replace(",", "")) - speed) <= 0.005 * speed + 0.5


def test_the_errors_of_the_levels_are_the_largest_of_the_stored_sweep():
    sweep = stored("accuracy.csv")["worst"]
    rows = dict(
        re.findall(
            r"^\| [^|]+ \| `\"(\w+)\"` \| .*?\| (\d\S*) \| [\d,]+ \|$",
            (ROOT / PERFORMANCE).read_text(),
            re.M,
        )
    )
    assert set(rows) == {"reference", "standard", "fast"}
    variants = {
        level: variant
        for variant, level in re.findall(r"^\| ([^|]*) \(`(\w+)`\) \|", (ROOT / SPEED).read_text(), re.M)
    }
    for level, error in rows.items():
        digits = len(error.partition("e")[0].replace(".", "")) - 1
        assert float(error) == float(f"{sweep.get_group(variants[level]).max():.{digits}e}"), level


def test_the_table_of_errors_and_speeds_is_that_of_the_stored_sweep():
    sweep, rows = stored("accuracy.csv"), table_of("Error against run time")
    assert len(rows) > 6
    for label, mean, largest, worst_of, speed in rows:
        seeds = sweep.get_group(re.sub(r" \(`\w+`\)", "", label))
        assert (mean, largest) == (f"{seeds['worst'].mean():.1e}", f"{seeds['worst'].max():.1e}"), label
        assert worst_of.replace(" ", "_") in set(seeds["worst_of"]), label
        assert shows(speed, seeds["real_time_factor"].median()), label


def test_the_table_of_the_box_is_that_of_the_stored_sweep():
    sweep, rows = stored("accuracy_box.csv"), table_of("Full-field wind")
    standard = "ab4 0.1 s, lookup, fast waves"
    counts = {f"with {n} rotor load" if n == 1 else f"with {n}": n for n in (1, 2, 4)}
    names = {label: f"{standard}, {n} rotor loads a step" for label, n in counts.items()}
    names |= {"`standard` (three rotor loads a step)": standard}
    names |= {"`fast`": "ab4 0.1 s, table, fast waves, mooring by table"}
    assert {label for label, *_ in rows} == set(names)
    for label, error, worst_of, speed in rows:
        (row,) = sweep.get_group(names[label]).to_dict("records")
        assert error == f"{row['worst']:.1e}" and worst_of.replace(" ", "_") == row["worst_of"], label
        assert shows(speed, row["real_time_factor"]), label


def test_the_counts_of_the_validation_are_those_of_the_stored_figures():
    """Per platform in the first table, and in sum over the cases of a platform's own table."""
    text = (ROOT / VALIDATION).read_text()
    rows = re.findall(r"^\| `(\w+)` \| [^|]+ \| (\d+) of (\d+) \|$", text, re.M)
    assert len(rows) == 4
    for platform, met, judged in rows:
        folder = DOCS / "results" / "validation" / ("" if platform == "oc3_hywind" else platform)
        verdicts = pd.read_csv(folder / "validation.csv")["verdict"].value_counts()
        assert (int(met), int(judged)) == (verdicts["met"], verdicts["met"] + verdicts.get("MISSED", 0))
    table = text.partition("<!-- measured: fowt dev validate --platform iea15_volturnus_s -->")[2].partition(
        "\n\n#"
    )[0]
    cases = re.findall(r"(\d+) of (\d+) \|$", table, re.M)
    total = {platform: (int(met), int(judged)) for platform, met, judged in rows}
    assert tuple(np.array(cases, dtype=int).sum(axis=0)) == total["iea15_volturnus_s"]


def test_the_margins_of_the_robustness_page_are_those_of_its_table():
    text = (DOCS / "results" / "numerical-robustness.md").read_text()
    table = pd.read_csv(DOCS / "results" / "numerical-robustness" / "map.csv", na_values="-")
    found = re.findall(
        r"^\| (\w+): default step of (\S+) s \| (\d+) kinds of scene \| least margin (\S+) ", text, re.M
    )
    assert len(found) == table["integrator"].nunique()
    for integrator, step, count, margin in found:
        rows = table[table["integrator"] == integrator]
        assert (len(rows), set(rows["default, s"])) == (int(count), {float(step)})
        assert rows["margin"].min() == float(margin)


def test_the_table_of_compile_times_has_the_rows_of_the_benchmark():
    table = (ROOT / SPEED).read_text().partition("<!-- measured: fowt dev benchmark compile -->")[2]
    rows = re.findall(r"^\| ([\w -]+) \| [^|]+ \| \d+\.\d \|$", table.partition("<!-- end -->")[0], re.M)
    assert rows == list(compile_time.NAMES)


PROSE = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "examples/README.md"]
PROSE += [path.relative_to(ROOT).as_posix() for path in DOCS.rglob("*.md")]


def test_links_between_files_hold():
    broken = []
    for page in PROSE:
        text = FENCE.sub("", (ROOT / page).read_text())
        for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]+`", "", text)):
            inside = ":" not in target and not target.startswith("#")
            if inside and not ((ROOT / page).parent / target.partition("#")[0]).exists():
                broken.append(f"{page}: {target}")
    assert not broken


def test_every_picture_is_shown_on_a_page():
    shown = set()
    for page in PROSE:
        found = re.findall(r"\]\(([^)\s]+\.(?:png|gif))\)", (ROOT / page).read_text())
        shown.update(((ROOT / page).parent / target).resolve() for target in found)
    assert not {path.resolve() for path in (*DOCS.rglob("*.png"), *DOCS.rglob("*.gif"))} - shown


NOT_FILES = {"fowt_env/OC3Hywind-v0", *ENVIRONMENTS, *LADDER, *OBJECTIVES}  # names of environments
NOT_FILES |= {"fowt_env/kernels"}  # which a command makes
LIVING = [page for page in PROSE if page != "CHANGELOG.md"]  # which keeps the names of its day


FOLDERS = "fowt_env|controllers|training|tests|docs|examples"


def test_files_and_modules_that_a_page_names_exist():
    missing = []
    for page in LIVING:
        text = (ROOT / page).read_text()
        for path in re.findall(rf"(?<![\w./:<-])((?:{FOLDERS})/[\w./-]*\w)", text):
            pattern = re.sub(r"\bALGO\b", "*", path)  # which stands for one of several
            if path not in NOT_FILES and not list(ROOT.glob(pattern)):
                missing.append(f"{page}: {path}")
        for name in re.findall(r"(?<![\w./-])(fowt_env(?:\.\w+)+)", text.replace("fowt_env.NAME", "")):
            try:
                pkgutil.resolve_name(name)
            except (ImportError, AttributeError) as error:
                missing.append(f"{page}: {error}")
    assert not missing


def test_the_page_of_the_package_has_its_public_names_first():
    first = (DOCS / "reference" / "api" / "fowt_env.md").read_text().partition("\n## Further names\n")[0]
    names = re.findall(r"^::: [\w.]+\.(\w+)$(?!\n    options)", first, re.M)
    names += [name for group in re.findall(r"members: \[(.*)\]", first) for name in group.split(", ")]
    assert sorted(names) == fowt_env.__all__


PLACED = re.compile(r"`(\w+)`(?: in| of)? \(?`((?:fowt_env|controllers|training)/[\w/]+\.py)`")


def test_a_name_that_a_page_puts_into_a_file_is_defined_there():
    """As in "`rollout` in `fowt_env/plant/advance.py`", or with the file in brackets after it."""
    found = {place for page in LIVING for place in PLACED.findall((ROOT / page).read_text())}
    assert len(found) > 12
    assert not [(name, file) for name, file in found if name not in defined(ROOT / file)]


ENVIRONMENT = "fowt_env/OC3Hywind"


def makers():
    """{where it stands: text} of all examples and blocks of pages that make an environment by its name."""
    texts = {path.name: path.read_text() for path in (ROOT / "examples").glob("*.py")}
    for page in LIVING:
        for number, found in enumerate(FENCE.finditer((ROOT / page).read_text())):
            if found[1] == "python":
                texts[f"{page}, block {number}"] = found[3]
    return {where: text for where, text in texts.items() if ENVIRONMENT in text}


def test_a_program_that_makes_an_environment_registers_it_itself():
    """`import fowt_env` does, and so does the name with the module before it."""
    for where, text in makers().items():
        assert re.search(r"^import gymnasium$", text, re.M), where
        registered = re.search(r"^(import|from) fowt_env\b", text, re.M)
        assert registered or f"fowt_env:{ENVIRONMENT}" in text, where


def test_links_out_of_docs_lead_to_the_site_s_own_pages():
    pytest.importorskip("mkdocs", reason="mkdocs is not installed: the extra `docs` is missing")
    pytest.importorskip("ziamath")
    hooks = tool("site_hooks")
    text = "[a](../README.md#layout) `[b](../README.md)` [c](theory.md) [d](https://x.org)"
    assert hooks.linked(text, "page.md") == text.replace("../README.md#", "readme.md#")
    assert hooks.linked("[e](../examples/01_simulate.py)", "page.md") == "[e](examples/01_simulate.md)"
    assert hooks.linked("[`e`](01_simulate.py)", "examples/index.md") == "[`e`](01_simulate.md)"
    assert hooks.linked("![f](docs/figures/turbulence.gif)", "readme.md") == "![f](figures/turbulence.gif)"
    assert hooks.linked("[g](../../CONTRIBUTING.md)", "reference/envs.md") == "[g](../contributing.md)"


def test_docstrings_keep_their_lists_of_names_and_their_signs():
    pytest.importorskip("griffe", reason="mkdocstrings is not installed: the extra `docs` is missing")
    as_markdown = tool("docstrings").as_markdown
    listed = "wind      m/s, as\n          given\nsea, seed still: `x[0]`"
    assert as_markdown(listed) == "- `wind`: m/s, as given\n- `sea`, `seed`: still: `x[0]`"
    assert as_markdown("wind      m/s\nRises with height.") == "- `wind`: m/s\n\nRises with height."
    assert as_markdown("As in\n\n    x[0]") == "As in\n\n    x[0]"
    for prose in ("A table\nof two lines.\n\nRaises: an error", "u: m/s\nand no list of names"):
        assert as_markdown(prose) == prose
    assert as_markdown("a[i] < *b*") == r"a\[i\] &lt; \*b\*"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return the folder of the built site."""
    pytest.importorskip("mkdocs", reason="mkdocs is not installed: the extra `docs` is missing")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file", ".mkdocs.yml"]
    variables = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(
        [*command, "--site-dir", str(folder)], cwd=ROOT, env=variables, capture_output=True, text=True
    )
    assert done.returncode == 0 and "warning" not in done.stderr.lower(), done.stderr
    return folder


@pytest.mark.nightly
def test_the_search_of_a_site_in_a_folder_finds_a_page(site, browser):  # noqa: F811
    with offline_page(browser, site / "guides" / "faq.html", ".md-search__input") as page:
        page.keyboard.press("/")
        page.wait_for_selector(".md-search__input:focus")
        page.keyboard.type("bubblewrap")
        page.wait_for_selector(".md-search-result__link")
        found = page.locator(".md-search-result__link").first.get_attribute("href")
    assert found.endswith("guides/leaderboard.html")


@pytest.mark.nightly
def test_the_site_is_built_without_a_warning_and_needs_no_network(site):
    pages = list(site.rglob("*.html"))
    assert {"index.html", "theory.html", "readme.html", "contributing.html"} <= {page.name for page in pages}
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r'<(script|img|iframe)[^>]+src="https?:', text), page
        assert not re.search(r'<link[^>]+rel="(stylesheet|preconnect|icon)"[^>]+href="https?:', text), page
        assert 'class="arithmatex"' not in text, page  # a formula that was not drawn
    theory = (site / "explanation" / "theory.html").read_text(encoding="utf-8")
    assert theory.count('class="number"') == len(
        re.findall(r"\\tag\{", (DOCS / "explanation/theory.md").read_text())
    )
    assert 'aria-label="' + html.escape(r"v = R^T \dot r") + '"' in theory
