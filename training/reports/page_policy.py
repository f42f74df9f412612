"""The Content-Security-Policy of pages with inline scripts and styles.

A script runs only if its hash is in the policy, so that a name that is not escaped as markup has no effect.
"""

import base64
import hashlib


def content_policy(scripts=(), styles=(), dynamic_styles=False):
    """Return the policy's meta tag: these scripts and styles, pictures made by the page, and no network.

    scripts, styles   contents of the page's elements, exactly as between their tags
    dynamic_styles    whether any style may be set, as plotting libraries do
    """
    style = "'unsafe-inline'" if dynamic_styles else _hashes(styles)
    parts = ["default-src 'none'", f"script-src {_hashes(scripts)}", f"style-src {style}"]
    return "; ".join([*parts, "img-src data: blob:", "base-uri 'none'", "form-action 'none'"])


def _hashes(texts):
    """Return the sources of inline texts, "'none'" for none; HTML parsers read line ends as line feeds."""
    plain = (text.replace("\r\n", "\n").replace("\r", "\n").encode("utf-8") for text in texts)
    digests = (base64.b64encode(hashlib.sha256(text).digest()).decode("ascii") for text in plain)
    return " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"
