"""Runs the command line ``hystctl`` with ``python -m hyst``."""

from ._commands import main

main()
