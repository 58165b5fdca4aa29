"""The code of the package's README runs."""

import re
from pathlib import Path

import pytest

README = Path(__file__).parents[2] / "crates" / "hyst-py" / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_block(block):
    exec(compile(block, str(README), "exec"), {})
