"""Plots of the objects."""

import hyst
import numpy as np
import pytest
from test_records import actuator

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402


@pytest.fixture(scope="module")
def record():
    return hyst.Record(*actuator(2000, 4), segment=[0] * 1200 + [1] * 800, name="bench 4")


def lines(ax):
    return [(line.get_label(), *line.get_data()) for line in ax.lines]


def test_a_record_is_plotted_as_loops_and_over_time(record):
    ax = record.plot()
    ((label, x, y),) = lines(ax)
    assert label == "bench 4" and (ax.get_xlabel(), ax.get_ylabel()) == ("Voltage [V]", "Displacement [µm]")
    # No line crosses the gap between segments.
    assert len(x) == 2001 and np.isnan(x[1200]) and np.array_equal(np.delete(x, 1200), record.inputs)
    assert np.array_equal(np.delete(y, 1200), record.outputs)
    ax = record.plot(kind="time", color="k", label="mine")
    assert ax.get_xlabel() == "Time [s]" and lines(ax)[0][0] == "mine"
    with pytest.raises(ValueError, match="loop"):
        record.plot(kind="sideways")
    with pytest.raises(ValueError, match="kind=\"time\""):
        hyst.Record(np.arange(9) / 10, np.ones(9)).plot()
    plt.close("all")


def test_results_are_plotted_over_a_record(record):
    ax = record.plot()
    model = hyst.fit(record)
    simulated = model.simulate(record)
    assert simulated.plot(ax=ax) is ax and model.plot(ax=ax, label="fit") is ax
    assert [label for label, _, _ in lines(ax)] == ["bench 4", "predicted", "fit"]
    _, x, y = lines(ax)[2]
    low, high = model.input_range
    assert x.min() == pytest.approx(low) and low < x.max() <= high and np.isfinite(y).all()
    wanted = hyst.Record(np.arange(600) / 500.0, outputs=5.0 + 4.0 * np.sin(np.arange(600) / 20.0))
    drive = model.compensate(wanted, slew=500.0)
    drawn = lines(drive.plot())
    assert np.array_equal(drawn[0][2], drive.inputs) and len(drawn[1][1]) == len(drive.slew_limited) > 0
    plt.close("all")


def test_a_diagnosis_is_plotted_as_its_residuals(record):
    found = hyst.diagnose(record, hyst.fit(record))
    drawn = lines(found.plot(color="k"))
    models = [hyst.fit(record), found.extended] if found.effects else [hyst.fit(record)]
    assert len(drawn) == len(models) and drawn[0][0] == "before"
    for (_, x, residual), model in zip(drawn, models, strict=True):
        simulated = model.simulate(record)
        counted = np.delete(residual, 1200)[~simulated.settling]
        assert np.sqrt(np.mean(counted**2)) == pytest.approx(simulated.errors["rmse"], rel=1e-9) and np.isnan(x[1200])
    plt.close("all")


def test_notebooks_show_tables_figures_and_the_report(record, tmp_path):
    page = record._repr_html_()
    for part in ("2000 in 2 segments", "Voltage [V]", "<svg", "bench 4"):
        assert part in page, part
    assert page.count("<polyline") == 2
    model = hyst.fit(record)
    assert "<polyline" in model._repr_html_() and "none" in model._repr_html_()
    found = hyst.diagnose(record, model)
    found.report(tmp_path / "report.html")
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert report.startswith("<!doctype html>".upper()) or report.lower().startswith("<!doctype html>")
    shown = found._repr_html_()
    assert shown.startswith("<iframe srcdoc=") and "&lt;" not in shown[:40] and shown.count("<iframe") == 1
    assert "bench 4" in report and "http://" not in report and "src=" not in report
