"""A file that a model was made from, by its size and the digest of its content."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class SourceFile:
    """A file the model was made from."""

    role: str
    path: str
    bytes: int
    sha256: str

    @classmethod
    def of(cls, role: str, path: Path) -> SourceFile:
        return cls(role, path.name, path.stat().st_size, digest(path))


def digest(path: Path) -> str:
    """SHA-256 of a file's content."""
    found = hashlib.sha256()
    with path.open("rb") as file:
        for block in iter(lambda: file.read(1 << 22), b""):
            found.update(block)
    return found.hexdigest()
