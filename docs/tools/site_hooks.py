"""What the documentation site needs beyond mkdocs: pages from outside docs/, links to them, drawn formulas.

The pages are read on a repository's web site too, so their links and formulas are written for that; here
they are turned into what the built site needs. Formulas become drawings while the site is built: MathJax and
KaTeX would come from the network, and MathML needs a font for formulas that few Linux machines have.
"""

import posixpath
import re
import warnings
from hashlib import sha1
from html import escape, unescape
from pathlib import Path
from tempfile import TemporaryDirectory

from mkdocs.plugins import event_priority
from mkdocs.structure.files import File

from fowt_env.layout import link_packages

with warnings.catch_warnings():  # it still asks for its fonts by importlib.resources.path; mkdocs shows that
    warnings.simplefilter("ignore", DeprecationWarning)
    import ziamath

ROOT = Path(__file__).resolve().parents[2]
PAGES = {  # file of the repository: page of the site
    "README.md": "readme.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "examples/README.md": "examples/index.md",
}
EXAMPLES = {f"examples/{path.name}": f"examples/{path.stem}.md" for path in ROOT.glob("examples/*.py")}
CODE = r"^ *```.*?^ *```|`[^`\n]+`"
LINK = r"(?P<start>!?\[(?:`[^`\n]*`|[^\]`])*\]\()(?P<target>[^)\s]+)\)"
CODE_OR_LINK = re.compile(f"{CODE}|{LINK}", re.S | re.M)
EXAMPLE = re.compile(r"`(\d\d_\w+\.py)`")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.S)
SYMBOL = re.compile(r'<symbol id="([^"]+)"(.*?</symbol>)', re.S)
BOX = re.compile(r'<svg([^>]*?) width="([^"]+)" height="([^"]+)" viewBox="(\S+) (\S+) (\S+) (\S+)">')
SIZE = 18  # of a formula's letters in its drawing, to which its measures refer
SOURCES = TemporaryDirectory(prefix="fowt-docs-")  # removed when the site is built
TAG = re.compile(r"\\tag\{([^}]*)\}")


@event_priority(100)  # ahead of mkdocstrings, which reads its paths then
def on_config(config):
    """Return the configuration with the examples in the contents and the sources of the API pages."""
    link_packages(SOURCES.name)
    config.plugins["mkdocstrings"].config.handlers["python"]["paths"] = [SOURCES.name]
    (tutorials,) = (
        part["Tutorials"] for part in config.nav if isinstance(part, dict) and "Tutorials" in part
    )
    tutorials.append({"Examples": ["examples/index.md", *sorted(EXAMPLES.values())]})
    return config


def on_files(files, config):
    """The site's files with the repository's own pages and the examples among them."""
    for source, page in PAGES.items():
        text = (ROOT / source).read_text()
        if source == "examples/README.md":
            text = EXAMPLE.sub(r"[`\1`](\1)", text)
        files.append(File.generated(config, page, content=text))
    for source, page in EXAMPLES.items():
        text = (ROOT / source).read_text()
        content = f"# `{Path(source).name}`\n\n```python\n{text}```\n"
        files.append(File.generated(config, page, content=content))
    return files


def on_page_markdown(markdown, page, **_):
    """The page's text with links that hold in the site."""
    return linked(markdown, page.file.src_uri)


def on_page_content(html, **_):
    """The page with its formulas drawn, and the shapes of their letters, once each, at its head."""
    shapes = {}
    html = FORMULA.sub(lambda match: _drawn(match, shapes), html)
    if not shapes:
        return html
    return f'<svg class="shapes" aria-hidden="true">{"".join(shapes.values())}</svg>\n{html}'


def linked(markdown, page):
    """The text of a page (its path in the site) with the repository's links turned into the site's."""
    sources = {site: source for source, site in (PAGES | EXAMPLES).items()}
    folder = posixpath.dirname(sources.get(page, f"docs/{page}"))
    here = posixpath.dirname(page)

    def moved(match):
        path, sign, anchor = (match["target"] or "").partition("#")  # none: code
        if not path or ":" in path:
            return match.group()
        wanted = posixpath.normpath(posixpath.join(folder, path))
        at = (PAGES | EXAMPLES).get(wanted, wanted.removeprefix("docs/"))
        return f"{match['start']}{posixpath.relpath(at, here or '.')}{sign}{anchor})"

    return CODE_OR_LINK.sub(moved, markdown)


def _drawn(match, shapes):
    """One formula as SVG in units of the text around it; adds to shapes {name: symbol}."""
    element, bracket, text = match.group(1), match.group(2), unescape(match.group(3))
    number = TAG.search(text)
    text = TAG.sub("", text).strip()
    svg = ziamath.Latex(text, size=SIZE, inline=bracket == "(", color="currentColor").svg()
    for name, shape in SYMBOL.findall(svg):
        own = f"{name}-{sha1(shape.encode()).hexdigest()[:6]}"  # small capitals and others share a name
        shapes[own] = f'<symbol id="{own}"{shape}'
        svg = svg.replace(f'"#{name}"', f'"#{own}"')
    svg = SYMBOL.sub("", svg)
    label = escape(" ".join(text.split()))

    def measured(box):
        width, height, top = (float(box.group(i)) / SIZE for i in (2, 3, 5))
        view = " ".join(box.group(4, 5, 6, 7))
        style = f"width:{width:.3f}em;height:{height:.3f}em;vertical-align:{-(top + height):.3f}em"
        return f'<svg{box.group(1)} viewBox="{view}" style="{style}" role="img" aria-label="{label}">'

    drawing = BOX.sub(measured, svg)
    if bracket == "(":
        return drawing
    beside = f'<span class="number">({number.group(1)})</span>' if number else ""
    return f'<{element} class="formula"><span class="drawing">{drawing}</span>{beside}</{element}>'
