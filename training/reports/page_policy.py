"""The Content-Security-Policy of pages whose scripts and styles stand in the file itself.

A script runs only if its hash is in the policy, so that a name which slips through as markup does nothing.
"""

import base64
import hashlib


def content_policy(scripts=(), styles=(), dynamic_styles=False):
    """Text of the policy's meta tag: these scripts and styles, pictures made by the page, and no network.

    scripts, styles   texts of the page's elements, exactly as they stand between the tags
    dynamic_styles    whether any style may be set: a plotting library makes its own
    """
    style = "'unsafe-inline'" if dynamic_styles else _hashes(styles)
    parts = ["default-src 'none'", f"script-src {_hashes(scripts)}", f"style-src {style}"]
    return "; ".join([*parts, "img-src data: blob:", "base-uri 'none'", "form-action 'none'"])


def _hashes(texts):
    """Sources of inline texts, "'none'" for none; a parser of HTML reads every line end as a line feed."""
    plain = (text.replace("\r\n", "\n").replace("\r", "\n").encode("utf-8") for text in texts)
    digests = (base64.b64encode(hashlib.sha256(text).digest()).decode("ascii") for text in plain)
    return " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"
