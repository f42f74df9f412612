"""Writes the results of a board: an HTML page without network access, a CSV file and a history.

Every text of a submission is escaped, including invisible characters and characters that change the writing
direction; a URL becomes a link only if it begins with http.
"""

import html
from pathlib import Path

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.control import EXACT, PRIVILEGED_INPUTS, USUAL_LIDAR
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import read_table, write_table
from fowt_env.training.board.judge import inputs_of
from fowt_env.training.evaluation.bootstrap import LEVEL, holm
from fowt_env.training.evaluation.leaderboard import SCORES, leaderboard, limits_text
from fowt_env.training.evaluation.metrics import better
from fowt_env.training.reports.metric_words import about_metric
from fowt_env.training.reports.page_words import content_policy, table_rows

FIGURES = {  # heading: metric whose ratio to the baseline is shown
    "rotor speed": "RotSpeed_std_[rpm]",
    "platform pitch": "PtfmPitch_std_[deg]",
    "travel": "blade_pitch_travel_[deg/s]",
    "energy": "GenPwr_capped_mean_[kW]",
    "power std": "GenPwr_std_[kW]",
    "torque travel": "torque_travel_[kN-m/s]",
    "shaft DEL": "RotTorq_DEL_[kN-m]",
    "tower DEL": "TwrBsMyt_DEL_[kN-m]",
}
VERSION = f"fowt_env {fowt_env.__version__}"
LISTED = "listed"  # in the history: public seeds that were not drawn
PER_WIND = ("rotor speed", "platform pitch", "travel", "power std", "torque travel", "shaft DEL")
MODEL, PREVIEW, LIDAR = "plant_model", "wind_preview", "lidar"
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # first characters of a spreadsheet formula
PLANT = {"rotor_speed", "generator_speed", "blade_pitch", "generator_torque", "time"}
CANNOT = (
    "Whether a controller recognises listed seeds: compare its scores on drawn or secret seeds.",
    "On which seeds and with what budget a controller was tuned: this is declared by the author.",
    "Whether code accessed files or the network of the organiser's machine, unless run in a container.",
    "Submissions that differ only in name.",
)
STYLE = """
:root{color-scheme:light dark;--page:#fff;--ink:#1b2430;--soft:#5b6773;--line:#d7dde4;--head:#f2f5f8;
--accent:#0a63b0;--lost:#b3261e;--better:#0a5ea8;--worse:#a8480a}
@media (prefers-color-scheme:dark){:root{--page:#11151b;--ink:#e6eaf0;--soft:#9aa6b5;--line:#2c3540;
--head:#191f27;--accent:#6cb4f0;--lost:#ff8a80;--better:#7cc0f7;--worse:#f5a55a}}
body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:90rem;padding:0 1rem;color:var(--ink);
background:var(--page);overflow-wrap:anywhere}
a{color:var(--accent)}
.scroll{overflow-x:auto;margin:.6rem 0 1.4rem;background:
linear-gradient(to left,var(--page) 40%,transparent) right/3rem 100% no-repeat local,
linear-gradient(to left,color-mix(in srgb,var(--soft) 45%,transparent),transparent)
right/1.1rem 100% no-repeat}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;min-width:100%}
th,td{padding:.25rem .6rem;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}
th{border-bottom:2px solid var(--line);vertical-align:bottom}td code{white-space:nowrap}
td.text,th.text{text-align:left;white-space:normal;min-width:7rem}
th button{font:inherit;color:inherit;background:none;border:0;padding:0;cursor:help;text-align:inherit;
text-decoration:underline dotted;text-underline-offset:.2em}
[popover]{max-width:min(26rem,90vw);padding:.7rem 1rem;border:1px solid var(--line);border-radius:8px;
background:var(--head);color:var(--ink)}
.small{color:var(--soft);font-size:13px}.lost{color:var(--lost)}h2{margin-top:2.2rem}
.better{color:var(--better);font-weight:600}.worse{color:var(--worse);font-weight:600}
@media print{.scroll{overflow:visible}table{font-size:8pt}th,td{padding:.1rem .2rem}}
"""


def _visible(text):
    """Return a text of a submission with Python escapes for unprintable characters."""
    return "".join(c if c.isprintable() else " " if c.isspace() else ascii(c)[1:-1] for c in str(text))


def escaped(text):
    """Return a text of a submission as escaped HTML."""
    return html.escape(_visible(text))


def cell(text):
    """Return a text of a submission for a CSV file, quoted so that spreadsheets do not read a formula."""
    text = _visible(text)
    return f"'{text}" if text.lstrip().startswith(FORMULA) else text


def information_class(submission, turbine):
    """Return the information class of a submission, such as "sensors + plant model"."""
    used, preview = set(inputs_of(submission, turbine)), submission.card.preview
    words = ["rotor and blades" if used - set(PRIVILEGED_INPUTS) <= PLANT else "sensors"]
    words += ["exact weather"] if used & {"wind_speed", "wave_elevation"} else []
    words += ["plant model"] if MODEL in used else []
    words += ["exact preview" if preview == EXACT else f"lidar {preview}"] if PREVIEW in used else []
    words += [f"lidar {USUAL_LIDAR if preview == EXACT else preview}, raw"] if LIDAR in used else []
    return " + ".join(words)


def board_frame(judged):
    """Return a DataFrame of a Judged with a row per suite and submission, sorted by rank.

    Columns: regime, suite, version, rank (NaN without a score), name, author, licence, information, runs,
    failed (including lost power), tripped, ratio to the baseline and p-value for each of FIGURES, score with
    interval (of the score that ranks), score_lifetime, score_winds, score_secret, beyond (exceeded limits),
    undecided, limits (their state), slowest_call_[s] (Python files; NaN for others).
    """
    rows = []
    board = judged.board
    classes = {each.name: information_class(each, board.turbine) for each in judged.shown}
    cards = {each.name: each.card for each in judged.shown}
    for regime in board.settings.regime:
        for name in regime.suites:
            suite = board.suite(name)
            public = _compared(judged.public[name], suite, board)
            secret = _compared(judged.secret[name], suite, board) if judged.secret else {}
            for who, entry in public.items():
                row = {"regime": regime.name, "suite": name, "version": suite.version, "rank": entry["rank"]}
                row |= {"name": who, "author": cell(cards[who].author), "licence": cell(cards[who].licence)}
                row |= {"information": classes[who], "runs": entry["runs"]}
                row |= {"failed": entry["failed"] + entry["lost_power"], "tripped": entry["tripped"]}
                for heading, metric in FIGURES.items():
                    gap = entry["difference"][metric]
                    row |= {heading: 1.0 + gap["percent"] / 100.0, f"p({heading})": gap["p"]}
                for key, part in (("score", "mean"), ("score_low", "low"), ("score_high", "high")):
                    row[key] = (entry["score"] or {}).get(part)
                for key in SCORES.values():
                    row[f"score_{key}"] = ((entry["score"] or {}).get(key) or {}).get("mean")
                row["score_secret"] = (secret.get(who, {}).get("score") or {}).get("mean")
                row |= {key: "; ".join(entry[key]) for key in ("beyond", "undecided")}
                row["limits"] = limits_text(entry)
                row["slowest_call_[s]"] = judged.slowest.get((name, who))
                rows.append(row)
    numbers = ["score", "score_low", "score_high", *(f"score_{key}" for key in SCORES.values())]
    numbers += ["score_secret", "slowest_call_[s]"]
    return pd.DataFrame(rows).astype(dict.fromkeys(numbers, float))


def _compared(table, suite, board):
    """Return {name: entry of the leaderboard} of a suite's table, sorted by rank."""
    result = leaderboard(table, board.settings.baseline, suite.score, limits=suite.limits)
    return {entry["controller"]: entry for entry in result["controllers"]}


def write_board(judged):
    """Write index.html, board.csv and history.csv in the board's folder; return their paths."""
    folder = judged.board.folder
    frame = board_frame(judged)
    history = _history(folder / "history.csv", frame, judged)
    paths = folder / "index.html", folder / "board.csv", folder / "history.csv"
    write_table(frame, paths[1])
    write_table(history, paths[2])
    with replacing(paths[0]) as temporary:
        temporary.write_text(_page(judged, frame, history), encoding="utf-8")
    return paths


def _history(path, frame, judged):
    """Return the history with the rows of this evaluation, which replace rows of the same day and digest."""
    digests = {each.name: each.digest for each in judged.shown}
    here = frame[["suite", "version", "name", "rank", "score", "failed", "tripped"]].assign(
        date=judged.when,
        package=VERSION,
        digest=frame["name"].map(digests),
        seeds=judged.drawn or LISTED,
    )
    if not path.is_file():
        return here
    key = ["date", "suite", "version", "name", "digest", "seeds"]
    both = pd.concat([read_table(path), here], ignore_index=True).fillna({"seeds": LISTED})
    return both.drop_duplicates(key, keep="last", ignore_index=True)


def board_rows(folder, regime=None):
    """Return (title, headings, rows) from board.csv for one regime, to print in a terminal.

    Raises: InputError for a board that was not evaluated, or an unknown regime.
    """
    path = Path(folder) / "board.csv"
    if not path.is_file():
        raise InputError(f"board {str(folder)!r}: has no results: fowt dev leaderboard run --board {folder}")
    frame = read_table(path)
    names = list(dict.fromkeys(frame["regime"]))
    regime = regime or names[0]
    if regime not in names:
        raise unknown("regime", regime, names)
    frame = frame[frame["regime"] == regime]
    headings = ["suite", "rank", "name", "information", "lost runs", *FIGURES, "score"]
    rows = [
        [
            *(row["suite"], _rank_text(row["rank"]), row["name"], row["information"]),
            str(row["failed"] + row["tripped"]),
            *(_number(row[figure]) for figure in (*FIGURES, "score")),
        ]
        for row in frame.to_dict("records")
    ]
    return f"{regime}: ratios of lifetime means to the baseline's", headings, rows


def _rank_text(rank):
    """Return a rank as text; "-" without a rank, in a suite without a score."""
    return "-" if pd.isna(rank) else f"{rank:.0f}"


def _number(value, digits=3):
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def _page(judged, frame, history):
    """Return the page as HTML."""
    board, settings = judged.board, judged.board.settings
    title, baseline = html.escape(settings.title), html.escape(settings.baseline)
    count = len(settings.seeds)
    public = f"{count} public seeds per suite, drawn from <code>{judged.drawn}</code>"
    if not judged.drawn:
        seeds = ", ".join(map(str, settings.seeds))
        public = f"public seeds {seeds}, which are for development (a controller may recognise these seeds)"
    secret = "No secret seeds were used."
    if judged.secret:
        count = next(iter(judged.secret.values()))["seed"].nunique()
        secret = f"{count} secret seeds from a file with SHA-256 <code>{judged.seeds_hash}</code>."
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{content_policy(styles=[STYLE])}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>",
        f"<p>Evaluated {judged.when} with {html.escape(VERSION)}; baseline"
        f" <b>{baseline}</b>; {public}. {secret}</p>",
        "<details open><summary>How to read this page</summary><p class=small>Ratios: lifetime mean over"
        " the baseline's in the same wind and waves; less is better except for energy (power up to rated). In"
        " brackets: 95 % interval of the score; * significant: the p-value, after Holm's correction over the"
        ' row, is at most 0.05, and the difference <span class="better">✓ better</span> or <span'
        ' class="worse">✗ worse</span>. Ranks: controllers that exceed no limit, then those that do, then'
        " those with lost runs (failed, tripped, or with less than half of the reference's energy); within"
        " each group by score, in which a lost run counts as ten times the reference's metrics: by that of"
        " the lifetime, or the worse of it and of the mean of the winds, as the suite says. A limit is held"
        " if the 95 % bound of its interval is within it, exceeded if the mean is beyond it. Click a"
        " heading for the definition of its metric. Wide tables scroll sideways.</p></details>",
    ]
    for number, (heading, metric) in enumerate(FIGURES.items()):  # popovers open without a script
        parts.append(
            f'<div popover id="metric-{number}"><b>{heading}</b>, ratio to the baseline.'
            f" {html.escape(about_metric(metric))}</div>"
        )
    parts += _list("<p class=lost>Excluded:</p>", judged.left_out.items())
    for regime in settings.regime:
        parts.append(f"<h2>{html.escape(regime.name)}</h2>")
        for name in regime.suites:
            suite, rows = board.suite(name), frame[frame["suite"] == name]
            parts.append(f"<h3>{html.escape(name)}, version {suite.version}</h3>")
            parts.append(f"<p class=small>{html.escape(suite.description)}.</p>")
            parts.append(_ranking(rows, judged))
            beyond = [pair for pair in zip(rows["name"], rows["beyond"], strict=True) if pair[1]]
            parts += _list("<p class=small>Exceeded limits of the suite:</p>", beyond)
            undecided = [pair for pair in zip(rows["name"], rows["undecided"], strict=True) if pair[1]]
            parts += _list("<p class=small>Limits not decided:</p>", undecided)
            parts += _per_wind(_compared(judged.public[name], suite, board))
    parts += [_submissions(judged), _history_table(history)]
    listed = "".join(f"<li>{line}</li>" for line in CANNOT)
    parts.append(f"<h2>What this board cannot detect</h2><ul>{listed}</ul></body></html>")
    return "\n".join(parts)


def _list(heading, pairs):
    """Return [HTML of a heading and a list of (name, text)]; [] for an empty list."""
    lines = "".join(f"<li><b>{escaped(name)}</b>: {escaped(text)}</li>" for name, text in pairs)
    return [f"{heading}<ul class=small>{lines}</ul>"] if lines else []


def _table(headings, rows, texts=()):
    """Return HTML of a scrollable table; texts: indices of the left-aligned columns."""
    return f'<div class="scroll" tabindex="0"><table>{table_rows(headings, rows, texts)}</table></div>'


def ratio_text(ratio, metric, significant):
    """Return HTML of a ratio, marked as better or worse if significant."""
    if not significant:
        return _number(ratio)
    word, mark = ("better", "✓") if (ratio - 1.0) * better(metric) > 0.0 else ("worse", "✗")
    return f'<span class="{word}">{_number(ratio)} * {mark}</span>'


def _ranking(rows, judged):
    shown = []
    for row in rows.to_dict("records"):
        corrected = holm([row[f"p({figure})"] for figure in FIGURES])
        lost = int(row["failed"] + row["tripped"])
        score = _number(row["score"])
        if np.isfinite(row["score_low"]):
            score += f" <span class=small>[{row['score_low']:.3f}, {row['score_high']:.3f}]</span>"
        shown.append([
            _rank_text(row["rank"]), html.escape(row["name"]), html.escape(row["information"]),
            f'<span class="lost">{lost} of {row["runs"]}</span>' if lost else f"0 of {row['runs']}",
            *(
                ratio_text(row[figure], metric, p <= 1.0 - LEVEL)
                for (figure, metric), p in zip(FIGURES.items(), corrected, strict=True)
            ),
            score, *(_number(row[f"score_{key}"]) for key in SCORES.values()), row["limits"],
            _number(row["slowest_call_[s]"], 4),
            *([_number(row["score_secret"])] if judged.secret else []),
        ])  # fmt: skip
    explained = [
        f'<button popovertarget="metric-{number}" title="{html.escape(about_metric(metric))}">'
        f"{heading}</button>"
        for number, (heading, metric) in enumerate(FIGURES.items())
    ]
    calls = f"slowest call, s (limit {judged.board.settings.call_limit:g})"
    last = ["score", *SCORES, "limits", calls, *(["score, secret seeds"] if judged.secret else [])]
    return _table(["rank", "controller", "inputs", "lost runs", *explained, *last], shown, (1, 2))


def _per_wind(entries):
    """Return an HTML table of the ratios per case for each of PER_WIND."""
    cases = list(next(iter(entries.values()))["cases"])
    parts = []
    for heading in PER_WIND:
        rows = []
        for who, entry in entries.items():
            percentages = (entry["cases"][case]["difference"][FIGURES[heading]]["percent"] for case in cases)
            rows.append([html.escape(who), *(_number(1.0 + percent / 100.0, 2) for percent in percentages)])
        table = _table(["controller", *map(html.escape, cases)], rows, (0,))
        parts.append(f"<details><summary>{heading}, per case</summary>{table}</details>")
    return parts


def _submissions(judged):
    """Return an HTML table of the submissions' cards."""
    rows = []
    for each in judged.shown:
        card, name = each.card, escaped(each.card.name)
        if card.url.startswith(("https://", "http://")):
            name = f'<a href="{escaped(card.url)}" rel="nofollow noreferrer">{name}</a>'
        inputs = ", ".join(inputs_of(each, judged.board.turbine))
        texts = (card.author, card.licence, each.kind, inputs, card.description, card.tuning)
        rows.append([name, *map(escaped, texts), f"<code>{each.digest[:16]}</code>"])
    headings = ["name", "author", "licence", "kind", "inputs", "description", "tuning", "files"]
    return "<h2>Submissions</h2>" + _table(headings, rows, range(8))


def _history_table(history):
    """Return an HTML table of the scores of all evaluations, newest first."""
    rows = []
    for row in history.sort_values("date", ascending=False, kind="stable").to_dict("records"):
        words = [row[key] for key in ("date", "suite", "version", "seeds", "name", "package")]
        words += [_rank_text(row["rank"]), _number(row["score"]), int(row["failed"] + row["tripped"])]
        rows.append([html.escape(str(word)) for word in words])
    headings = "date,suite,version,seeds,controller,evaluated with,rank,score,lost runs".split(",")
    table = _table(headings, rows, (0, 1, 3, 4, 5))
    return f"<h2>History</h2><details><summary>all evaluations</summary>{table}</details>"
