"""Type checkers accept the package and code that uses it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[2] / "docs" / "python.ipynb"
#: python-control has no annotations: pyright infers the type of the signal from its default 0.0.
IGNORED = 'parameter "inputs" of type "float" in function "input_output_response"'

USE = '''
import hyst
import numpy as np
from hyst.sklearn import HysteresisRegressor

pi = hyst.Pi(gain=0.1, thresholds=[10.0, 20.0], weights=(0.02, 0.01))
y = pi.simulate([1, 2, 3])
z = pi.simulate(np.arange(5), temperature=20.0)
record = hyst.Record([0.0, 0.1, 0.2], [1, 2, 3], y, segment=[0, 0, 1])
model: hyst.Model = hyst.fit(record, model="pi")
found = hyst.diagnose(record, model, test="test.csv")
found.report("report.html")
again = hyst.Record.from_frame(record.to_frame("polars"), voltage="V")
ax = record.plot(kind="time", color="k")
error: dict[str, float] | None = model.simulate(again).errors
score = HysteresisRegressor("tanh", period=1e-3).fit([[1.0], [2.0]], [0.1, 0.2]).predict([[1.0]])
'''
WRONG = "import hyst\nhyst.fit(3, model=4)\nhyst.Play(radius='wide')\nhyst.Record([0.0]).inputs.sum()\n"


def checked(*arguments, cwd):
    pytest.importorskip("mypy")
    ran = subprocess.run([sys.executable, "-m", "mypy", "--strict", *arguments], capture_output=True, text=True, cwd=cwd)
    return ran.returncode, ran.stdout + ran.stderr


def test_the_package_and_its_use_are_typed(tmp_path):
    (tmp_path / "use.py").write_text(USE)
    for arguments in (["-p", "hyst"], ["use.py"]):
        code, output = checked(*arguments, cwd=tmp_path)
        assert code == 0, output


def test_mypy_finds_wrong_types(tmp_path):
    (tmp_path / "wrong.py").write_text(WRONG)
    code, output = checked("wrong.py", cwd=tmp_path)
    lines = {line.split(":")[1] for line in output.splitlines() if line.startswith("wrong.py:") and ": error:" in line}
    assert code == 1 and lines == {"2", "3", "4"}, output


def pyright(*paths):
    """Returns file, line and message of each error."""
    pytest.importorskip("pyright")
    call = [sys.executable, "-m", "pyright"]
    version = subprocess.run([*call, "--version"], capture_output=True, text=True)
    if version.returncode != 0:
        pytest.skip(f"pyright cannot be downloaded: {version.stderr.strip()[-200:]}")
    ran = subprocess.run([*call, "--outputjson", "--pythonpath", sys.executable, *map(str, paths)], capture_output=True, text=True)
    report = json.loads(ran.stdout)
    assert report["summary"]["filesAnalyzed"] > 0, ran.stdout
    found = [found for found in report["generalDiagnostics"] if found["severity"] == "error" and IGNORED not in found["message"]]
    return {(Path(one["file"]).name, one["range"]["start"]["line"] + 1, one["message"]) for one in found}


def test_pyright_accepts_the_package_and_its_use(tmp_path):
    import hyst

    cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    (tmp_path / "notebook.py").write_text("\n\n".join("".join(cell["source"]) for cell in cells))
    (tmp_path / "use.py").write_text(USE)
    assert not pyright(Path(hyst.__file__).parent, tmp_path / "use.py", tmp_path / "notebook.py")


def test_pyright_finds_wrong_types(tmp_path):
    (tmp_path / "wrong.py").write_text(WRONG)
    assert {line for _, line, _ in pyright(tmp_path / "wrong.py")} == {2, 3, 4}
