"""Contents: files named by what is in them.

    file_hash(path) -> str      SHA-256 in hexadecimal digits
"""

from __future__ import annotations

import hashlib
import os


def file_hash(path: str | os.PathLike[str]) -> str:
    """Returns the SHA-256 of a regular file's bytes, 64 hexadecimal digits; "" where none can be seen.

    Raises: OSError where it cannot be read.
    """
    if not os.path.isfile(path):
        return ""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
