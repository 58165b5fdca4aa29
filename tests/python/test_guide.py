"""The Python code of the guide runs: each page from top to bottom in one folder."""

import re
from pathlib import Path

import pytest

GUIDE = Path(__file__).parents[2] / "docs" / "guide"
PAGES = {
    str(page.relative_to(GUIDE)): re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for page in sorted(GUIDE.rglob("*.md"))
}
WITH_CODE = [page for page, blocks in PAGES.items() if blocks]


@pytest.mark.parametrize("page", WITH_CODE)
def test_page(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "guide"}
    for number, block in enumerate(PAGES[page], 1):
        exec(compile(block, f"{page}, block {number}", "exec"), names)
