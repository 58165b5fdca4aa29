"""``python -m hyst`` is the command line ``hystctl``."""

from ._commands import main

main()
