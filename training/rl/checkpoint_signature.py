"""Signs checkpoints: loading a checkpoint executes code from it, so the user's checkpoints are recognised.

A run signs every checkpoint with a keyed hash (HMAC-SHA256) of all files in it. The key is in the user's
configuration folder (FOWT_CONFIG_DIR, else XDG_CONFIG_HOME/fowt_env or ~/.config/fowt_env), readable by this
user only. A checkpoint without a valid signature is loaded only if the user trusts it explicitly.
"""

import hashlib
import hmac
import os
import secrets
import stat

from fowt_env.folders import distrust, make_private, user_folder

SEAL = "seal.txt"
KEY_FILE = "checkpoint_key"
KEY_BYTES = 32


def config_folder():
    """Return the user's configuration folder; None for a user without a home directory."""
    return user_folder("FOWT_CONFIG_DIR", "XDG_CONFIG_HOME", ".config")


def _key():
    """Return the user's key, created if missing; None if that fails or others can read the key."""
    folder = config_folder()
    if folder is None:
        return None
    path = folder / KEY_FILE
    try:
        make_private(folder)
        temporary = path.with_name(f".{KEY_FILE}-{os.getpid()}-{secrets.token_hex(4)}")
        if not path.exists():
            handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "wb") as file:
                file.write(secrets.token_bytes(KEY_BYTES))
            try:
                os.link(temporary, path)  # atomic: of several processes only the first creates the key
            except FileExistsError:
                pass
            finally:
                temporary.unlink()
        if distrust(path, stat.S_ISREG) or path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            return None
        key = path.read_bytes()
    except OSError:
        return None
    return key if len(key) == KEY_BYTES else None


def _hash(folder, key):
    """Return the keyed hash of the names and contents of a folder's files."""
    total = hmac.new(key, digestmod=hashlib.sha256)
    for path in sorted(folder.iterdir()):
        if path.name != SEAL:
            with path.open("rb") as file:
                content = hashlib.file_digest(file, "sha256").hexdigest()
            total.update(f"{path.name}\n{content}\n".encode())
    return total.hexdigest()


def seal(folder):
    """Sign a checkpoint folder; it stays unsigned if no key can be stored, as in a read-only home."""
    key = _key()
    if key is not None:
        (folder / SEAL).write_text(_hash(folder, key) + "\n", encoding="ascii")


def is_own(folder):
    """Return whether a checkpoint is signed by this user and unchanged since."""
    key = _key()
    try:
        signature = (folder / SEAL).read_text(encoding="ascii").strip()
        return key is not None and hmac.compare_digest(signature, _hash(folder, key))
    except (OSError, ValueError, TypeError):
        return False
