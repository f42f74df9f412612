"""Writes a self-contained HTML page: its texts, data, plotly.js and scripts in one file, no network."""

import json
from pathlib import Path
from string import Template

from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.training.reports import page_words

PAGE = Path(__file__).parent / "page"


def plotly_source():
    """Return the source of plotly.js. Raises: InputError naming the install command if plotly is missing."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise InputError(f'the report needs plotly ({error}): pip install "fowt-env[report]"') from error
    return get_plotlyjs()


def page_path(out):
    """Return the path of a page after a check of its ending. Raises: InputError."""
    out = Path(out)
    if out.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"report page {str(out)!r}: must end with .html")
    return out


def write_page(out, template, script, texts, data, plotly, style=""):
    """Write a page atomically; return its path.

    template, script   paths of the HTML and of the page's own script, which follows common.js
    texts              {placeholder: HTML} of the template and head.html, besides head, policy, style, plotly,
                       script and data
    data               mapping that the script reads as JSON, without NaN
    style              CSS that follows page.css
    """
    code = (PAGE / "common.js").read_text(encoding="utf-8") + script.read_text(encoding="utf-8")
    scripts = {"plotly": plotly, "script": code}
    texts = dict(texts)
    # plotly.js sets styles as it draws
    texts["policy"] = page_words.content_policy(scripts.values(), dynamic_styles=True)
    texts["style"] = (PAGE / "page.css").read_text(encoding="utf-8") + style
    # no NaN, and no < that could end the element
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    texts["head"] = _filled(PAGE / "head.html", texts)
    page = _filled(template, texts | {"data": text} | scripts)
    with replacing(out) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return out


def _filled(template, texts):
    """Return the text of a template file with its placeholders filled."""
    return Template(template.read_text(encoding="utf-8")).substitute(texts)
