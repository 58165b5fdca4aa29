"""Write files as laboratories have them, each by the program that people use, and what a reader has to find in them.

Usage: python write.py OUTDIR

OUTDIR gets one file a layout, `expected.json` (one entry a line; fields in `book.py`) and `truth/*.npy` (reference
columns in the units of the record: s, V, µm, °C, N). The values are the same in every run; a few libraries store the
time of writing. `readback.py OUTDIR` reads every file back with its own library. `check.py HYSTCTL OUTDIR` is the test.
"""

from __future__ import annotations

import sys
from pathlib import Path

import arrays
import bad
import hdf5
import instruments
import labview
import logs
import mat
import tables
import text
import trouble
from book import Book


def main() -> int:
    """Write all layouts."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    book = Book(Path(sys.argv[1]))
    for group in (mat, hdf5, labview, tables, arrays, logs, text, trouble, instruments, bad):
        before = len(book.entries)
        group.write(book)
        print(f"{group.__name__:12} {len(book.entries) - before:3} entries")
    book.save()
    files = {entry["file"] for entry in book.entries}
    readable = {entry["file"] for entry in book.entries if entry["outcome"] == "read" and "partial" not in entry}
    print(f"{len(files)} files, of them {len(readable)} readable; {len(book.entries)} entries")
    return 0


if __name__ == "__main__":
    sys.exit(main())
