"""Whose file is it? SB3's checkpoints, and kept results, hold pickles, which run code when loaded: only those signed here are.

The signature is an HMAC, of files over their SHA-256 sums, with a key of the user's own, which never leaves the machine's
configuration folder (``$XDG_CONFIG_HOME/tagtrack/key``, by default below ``~/.config``).
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import secrets
import time
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

KEY_LENGTH = 64  # hexadecimal digits


def key_file() -> Path:
    """Where the key lies."""
    base = os.environ.get("XDG_CONFIG_HOME")
    return (Path(base) if base else Path.home() / ".config") / "tagtrack" / "key"


def sign(files: Sequence[Path]) -> str | None:
    """The signature of files; None where no key can be kept."""
    return signature_of(_list(files))


def is_signed(files: Sequence[Path], signature: object) -> bool:
    """Whether the signature is this user's, and the files are those it was given for."""
    return is_signature(signature, _list(files))


def signature_of(content: bytes) -> str | None:
    """The signature of some bytes; None where no key can be kept."""
    try:
        key = _read_key() or _make_key()
    except (OSError, RuntimeError):  # a home that cannot be written, or none
        return None
    return None if key is None else hmac.new(key, content, "sha256").hexdigest()


def is_signature(signature: object, content: bytes) -> bool:
    """Whether a signature is this user's, of these bytes."""
    try:
        key = _read_key()
    except (OSError, RuntimeError):
        return False
    if key is None or not isinstance(signature, str) or not signature.isascii():
        return False
    return hmac.compare_digest(hmac.new(key, content, "sha256").hexdigest(), signature)


def _list(files: Sequence[Path]) -> bytes:
    """Names and sums of files, which stand for them."""
    lines = []
    for file in files:
        with file.open("rb") as content:
            lines.append(f"{file.name} {_sum(content)}\n")
    return "".join(lines).encode()


def _sum(content: BinaryIO) -> str:
    total = hashlib.sha256()
    while block := content.read(1 << 20):
        total.update(block)
    return total.hexdigest()


def _read_key() -> bytes | None:
    try:
        key = key_file().read_text(encoding="ascii").strip()
    except (FileNotFoundError, NotADirectoryError, UnicodeDecodeError):
        return None
    return key.encode() if len(key) == KEY_LENGTH else None


def _place(partial: Path, target: Path) -> None:
    """Give a whole file its name, never over another's. Raises FileExistsError."""
    try:
        os.link(partial, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links: of two processes that start together one may sign in vain
        if not target.exists():
            partial.rename(target)


def _make_key() -> bytes | None:
    """A new key, or the one that another process has just made."""
    target = key_file()
    target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    for left in target.parent.glob(f".{target.name}.*"):  # by a kill; a younger one may be in the making
        with contextlib.suppress(FileNotFoundError):  # another process's, just done
            if time.time() - left.stat().st_mtime > 60.0:
                left.unlink()
    partial = target.with_name(f".{target.name}.{secrets.token_hex(8)}")
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(secrets.token_hex(KEY_LENGTH // 2))
        with contextlib.suppress(FileExistsError):
            _place(partial, target)
    finally:
        partial.unlink(missing_ok=True)
    return _read_key()
