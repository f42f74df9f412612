"""Builds the HTML texts of a report page, escaped: title, case conditions, lost runs, provenance, policy."""

import base64
import hashlib
import html
import platform as machine
from importlib.metadata import version
from pathlib import Path

from fowt_env.descriptions.checks import is_number
from fowt_env.errors import InputError
from fowt_env.training.evaluation.conditions import sea_text, wind_text
from fowt_env.training.evaluation.run_case import OK
from fowt_env.training.reports.metric_words import counted, numbers_text, seeds_text

NAMED_CASES = 3  # maximum number of cases named in a title
WIND_KINDS = {
    "ntm": "normal turbulence (NTM)",
    "etm": "extreme turbulence (ETM)",
    "eog": "extreme operating gust (EOG)",
    "edc": "extreme direction change (EDC)",
    "ecd": "coherent gust with direction change (ECD)",
    "ews": "extreme wind shear (EWS)",
    "ewm": "extreme wind speed (EWM)",
    "mann": "Mann turbulence box",
}


def described_cases(manifest):
    """Return {case: mapping} of the cases of a manifest; entries that are not mappings are omitted."""
    cases = manifest.get("cases")
    items = cases.items() if isinstance(cases, dict) else ()
    return {name: case for name, case in items if isinstance(case, dict)}


def page_title(manifest, cases):
    """Return the title of the page: the platform, and the suite or the cases by name or number."""
    about = described_cases(manifest)
    platforms = {str(about[name].get("platform")) for name in cases if name in about} - {"None"}
    path = Path(min(platforms, default=""))
    one = path.parent.name if path.name == "platform.toml" else path.stem  # an imported deck is a folder
    where = f"{len(platforms)} platforms" if len(platforms) > 1 else one
    suite = manifest.get("suite")
    named = suite if isinstance(suite, dict) else {"name": suite} if isinstance(suite, str) else {}
    if named.get("name"):
        what = f"suite {named['name']}" + (f", version {named['version']}" if "version" in named else "")
    else:
        what = ", ".join(cases) if len(cases) <= NAMED_CASES else counted(len(cases), "load case")
    return f"Controllers{f' on {where}' if where else ''}: {what}"


def page_lead(table, manifest):
    """Return the size of an evaluation in one line."""
    parts = [counted(table[key].nunique(), key) for key in ("controller", "case")]
    parts += [seeds_text(sorted(set(table["seed"]))), counted(len(table), "run")]
    if isinstance(manifest.get("created"), str):
        parts.append(f"evaluated {manifest['created'][:10]}")
    return " · ".join(parts)


def case_conditions(table, manifest, shares=None):
    """Return [{heading: text}] of the conditions of the cases of a table, in the table's order.

    shares: {case: fraction of the lifetime}, or None. A case missing in the manifest has only its seeds.
    """
    about, rows = described_cases(manifest), []
    for name, runs in table.groupby("case", sort=False):
        case, row = about.get(name), {"case": name}
        if case is not None:
            row |= {"wind": _wind(case.get("wind")), "sea": _sea(case.get("sea")), "events": _events(case)}
            row["platform"] = Path(str(case.get("platform"))).stem
            row["duration (s)"], row["scored from (s)"] = (_number(case.get(k)) for k in ("duration", "skip"))
            row["sensors"] = str(case.get("sensors", ""))
        row["seeds"] = numbers_text(sorted(set(runs["seed"])))
        if shares is not None:
            row["fraction of lifetime"] = f"{100.0 * shares[name]:.1f} %"
        rows.append(row)
    return rows


def conditions_text(row):
    """Return the conditions of one case as a sentence, for tooltips."""
    parts = [row.get(key) for key in ("wind", "sea", "events")]
    if row.get("duration (s)"):
        parts.append(f"{row['duration (s)']} s, scored from {row.get('scored from (s)') or 0} s")
    parts += [f"{row['sensors']} sensors" if row.get("sensors") else None, f"seeds {row['seeds']}"]
    return "; ".join(filter(None, parts))


def conditions_table(rows):
    """Return the HTML rows of case_conditions, without empty columns and a common platform."""
    headings = list(dict.fromkeys(heading for row in rows for heading in row))
    kept = [name for name in headings if any(row.get(name) for row in rows)]
    if len({row.get("platform") for row in rows}) == 1 and "platform" in kept:
        kept.remove("platform")
    cells = [[html.escape(row.get(name) or "–") for name in kept] for row in rows]
    return table_rows(map(html.escape, kept), cells)


def table_rows(headings, rows, texts=()):
    """Return the head and body of an HTML table; texts: numbers of the columns of class "text"."""

    def line(row, tag, scope=""):
        marks = [' class="text"' if number in texts else "" for number in range(len(row))]
        cells = (f"<{tag}{scope}{mark}>{cell}</{tag}>" for mark, cell in zip(marks, row, strict=True))
        return f"<tr>{''.join(cells)}</tr>"

    head, body = line(list(headings), "th", ' scope="col"'), "".join(line(row, "td") for row in rows)
    return f"<thead>{head}</thead><tbody>{body}</tbody>"


def _wind(wind):
    """Return the text of a manifest's wind, with the full name of its kind."""
    text = wind_text(wind)
    kind = text.partition(" ")[0].rstrip(",")
    return WIND_KINDS.get(kind, kind) + text[len(kind) :]


def _sea(sea):
    """Return the text of a manifest's sea, with its peak enhancement."""
    try:
        text = sea_text(sea)
    except InputError:
        return str(sea)
    gamma = sea.get("gamma") if isinstance(sea, dict) else None
    return f"{text}, gamma {gamma:g}" if is_number(gamma) and "Hs" in text else text


def _events(case):
    """Return the text of the faults, offsets and initial conditions of a manifest's case, "" for none."""
    parts = ["parked"] if case.get("parked") else []
    fault = case.get("fault")
    if isinstance(fault, dict):
        parts.append(f"{str(fault.get('kind')).replace('_', ' ')} at {_number(fault.get('time'))} s")
    for key in ("shift", "displaced", "initial"):
        if isinstance(case.get(key), dict):
            changes = (f"{name.replace('_', ' ')} {_number(value)}" for name, value in case[key].items())
            parts.append(f"{key} {', '.join(changes)}")
    return ", ".join(parts)


def _number(value):
    return f"{value:g}" if is_number(value) else "" if value is None else str(value)


def lost_runs(table):
    """Return [(controller, case, seed, text)] of lost runs, with status, time and reason in the text."""
    lost = []
    for row in table[table["status"] != OK].to_dict("records"):
        at, status, reason = row.get("stopped_[s]"), row["status"], row["reason"]
        when = f" at {at:.1f} s" if is_number(at) and at == at else ""
        text = f"{status}{'' if when in reason else when}{': ' if reason else ''}{reason}"
        text = reason if reason.startswith(f"{status}:") else text
        lost.append((row["controller"], row["case"], int(row["seed"]), text))
    return lost


def lost_list(lost, runs):
    """Return HTML of the list of lost runs, "" for none."""
    items = "".join(
        f"<li><b>{html.escape(who)}</b>, {html.escape(case)}, seed {seed}: {html.escape(text)}</li>"
        for who, case, seed, text in lost
    )
    summary = f'<summary class="bad">{len(lost)} of {counted(runs, "run")} lost</summary>'
    return f'<details open>{summary}<ul class="lost" tabindex="0">{items}</ul></details>' if lost else ""


def provenance(folder, table, manifest, board_file):
    """Return the HTML rows of the provenance table."""
    facts, suite = {"folder": folder.resolve().name}, manifest.get("suite")
    if manifest:
        facts["suite"], site = suite, None
        if isinstance(suite, dict):
            facts["suite"] = " ".join(str(suite[key]) for key in ("name", "version") if key in suite)
            site = suite.get("site")
        facts |= {"created": manifest.get("created"), "plant sources": manifest.get("plant")}
        trips = [case.get("trip") for case in described_cases(manifest).values()]
        thresholds = {f"{_number(trip)} times rated rotor speed": None for trip in trips if trip is not None}
        facts["overspeed trip"] = " or ".join(thresholds)
        if isinstance(site, dict):
            facts["site"] = f"Weibull A = {site.get('A')} m/s, k = {site.get('k')} ({site.get('source')})"
        for key in ("versions", "options", "controllers"):
            if isinstance(manifest.get(key), dict):
                facts[key] = ", ".join(f"{n} {_brief(n, value)}" for n, value in manifest[key].items())
    else:
        facts["evaluation"] = "the folder has no manifest.json: the versions of its runs are unknown"
    facts["baseline"] = None if board_file is None else board_file.baseline
    if "scored_[s]" in table.columns:
        lengths = sorted(table["scored_[s]"].dropna().unique())
        facts["scored"] = ", ".join(f"{value:g} s" for value in lengths)
    made = [f"{name} {version(name)}" for name in ("fowt-env", "numpy", "scipy", "pandas", "plotly")]
    facts["page made by"] = ", ".join([*made, f"Python {machine.python_version()}"])
    return "".join(
        f'<tr><th scope="row">{html.escape(name)}</th><td>{html.escape(str(value))}</td></tr>'
        for name, value in facts.items()
        if value not in (None, "")
    )


def _brief(label, value):
    """Return a value of the manifest as short text; a controller's name only if it differs from its label."""
    if not isinstance(value, dict):
        return str(value)
    words = [str(item) for key, item in value.items() if not (key == "name" and item == label)]
    return f"({', '.join(words)})"


def content_policy(scripts=(), styles=(), dynamic_styles=False):
    """Return the Content-Security-Policy: a script runs only if its hash is in it, and no network is used.

    scripts, styles: exact contents of the script and style elements of the page. dynamic_styles: whether
    any style may be set, as plotting libraries do.
    """
    style = "'unsafe-inline'" if dynamic_styles else _hashes(styles)
    parts = ["default-src 'none'", f"script-src {_hashes(scripts)}", f"style-src {style}"]
    return "; ".join([*parts, "img-src data: blob:", "base-uri 'none'", "form-action 'none'"])


def _hashes(texts):
    """Return the policy sources of inline texts, "'none'" for none; HTML parsers turn line ends into LF."""
    plain = (text.replace("\r\n", "\n").replace("\r", "\n").encode("utf-8") for text in texts)
    digests = (base64.b64encode(hashlib.sha256(text).digest()).decode("ascii") for text in plain)
    return " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"
