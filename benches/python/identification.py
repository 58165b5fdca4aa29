"""Compares identification with other packages: test error, fit time and time per sample, on two public records.

    python benches/python/identification.py [DATA]

Needs `hyst` from a release build and `pip install sysidentpy pysindy scipy`. DATA contains the records of
`docs/speed.md`; default: `$HYST_DATA/measured`. Every model is fitted to the training record and simulated on the test
records, both from the input only (the measured output is not fed back).

Of several settings of a package, the one with the smallest simulation error on the last quarter of the training record,
after a fit to the rest, is selected and fitted to all of it. The test records do not affect the selection. The zero of
a displacement is arbitrary: a constant is subtracted from each residual.
"""

import importlib.metadata
import os
import sys
import time
import warnings
from pathlib import Path

import hyst
import numpy as np
import pysindy
import scipy.optimize
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

FILES = {
    "micromanipulator": ("micromanipulator-train.csv", {"test": "micromanipulator-test.csv"}, "µm"),
    "Bouc-Wen benchmark": (
        "bouc-wen-benchmark-train.csv",
        {"multisine": "bouc-wen-benchmark-test-multisine.csv", "sweep": "bouc-wen-benchmark-test-sweep.csv"},
        "mm",
    ),
}
#: Records that are one period of a steady state.
PERIODIC = ("bouc-wen-benchmark-test-multisine.csv",)


def load(path):
    """Returns period, input and output of a record."""
    record = hyst.read_record(path)
    return record.period, record.inputs, record.outputs


class Narx:
    """A polynomial NARX model of SysIdentPy, with the sign of the input change as second input (usual for hysteresis)."""

    def __init__(self, degree, lags, terms):
        self.name = f"FROLS, degree {degree}, {lags} lags, {terms} terms"
        self.lags = lags
        self.model = FROLS(
            order_selection=False,
            n_terms=terms,
            ylag=lags,
            xlag=[list(range(1, lags + 1)), [1]],
            basis_function=Polynomial(degree=degree),
            estimator=LeastSquares(),
        )

    @staticmethod
    def inputs(u):
        # Row k contains the input of row k + 1. With a lag of one row it is the present input.
        now = np.append(u[1:], u[-1])
        return np.column_stack([now, np.sign(np.diff(now, prepend=now[0]))])

    def fit(self, period, u, y):
        self.first = float(y[0])
        self.model.fit(X=self.inputs(u), y=y.reshape(-1, 1))

    def simulate(self, period, u):
        start = np.full((self.lags, 1), self.first)
        return self.model.predict(X=self.inputs(u), y=np.vstack([start, np.zeros((len(u) - len(start), 1))])).ravel()


class Sindy:
    """A discrete model of PySINDy: y[k+1] is a polynomial of y[k], y[k−1], the input and the sign of its change."""

    def __init__(self, degree, threshold):
        self.name = f"degree {degree}, threshold {threshold}"
        self.library = pysindy.PolynomialLibrary(degree=degree)
        self.optimizer = pysindy.STLSQ(threshold=threshold)

    @staticmethod
    def controls(u):
        return np.column_stack([u[1:], u[:-1], np.sign(np.diff(u))])

    def fit(self, period, u, y):
        self.scale = np.abs(u).max(), y.mean(), y.std()
        u, y = u / self.scale[0], (y - self.scale[1]) / self.scale[2]
        self.first = y[0]
        states = np.column_stack([y[1:], y[:-1]])
        controls = self.controls(u)
        features = np.column_stack([states[:-1], controls[1:]])
        terms = self.library.fit(features).transform(features)
        self.optimizer.fit(terms, states[1:, :1])
        self.weights = np.asarray(self.optimizer.coef_).ravel()
        powers = np.asarray(self.library.powers_)
        kept = self.weights != 0.0
        self.weights, self.powers = self.weights[kept], powers[kept]

    def simulate(self, period, u):
        controls = self.controls(u / self.scale[0])
        y = np.empty(len(u))
        y[:2] = self.first
        for k in range(1, len(u) - 1):
            values = np.array([y[k], y[k - 1], *controls[k]])
            y[k + 1] = self.weights @ np.prod(values**self.powers, axis=1)
            if not abs(y[k + 1]) < 1e3:
                return np.full(len(u), np.inf)
        return self.scale[1] + self.scale[2] * y


class Plays:
    """A Prandtl-Ishlinskii model in NumPy, with weights by the bounded least squares of scipy."""

    def __init__(self, count):
        self.name = f"lsq_linear, {count} plays"
        self.count = count

    def columns(self, u):
        played = np.empty((len(u), self.count))
        state = np.clip(0.0, u[0] - self.radii, u[0] + self.radii)
        for k, value in enumerate(u):
            state = np.minimum(np.maximum(state, value - self.radii), value + self.radii)
            played[k] = state
        return np.column_stack([played, np.ones(len(u))])

    def fit(self, period, u, y):
        self.radii = 0.5 * np.ptp(u) * np.arange(self.count) / self.count
        lower = np.append(np.zeros(self.count), -np.inf)
        self.weights = scipy.optimize.lsq_linear(self.columns(u), y, bounds=(lower, np.inf)).x

    def simulate(self, period, u):
        return self.columns(u) @ self.weights


class Ours:
    """A model of this project, optionally extended by its diagnosis."""

    def __init__(self, kind, diagnosed=False, **columns):
        self.name = kind + (", diagnosed" if diagnosed else "")
        self.kind, self.diagnosed, self.columns = kind, diagnosed, columns

    def fit(self, period, u, y):
        record = hyst.Record(period * np.arange(len(u)), u, y, **self.columns)
        self.model = hyst.fit(record, model=self.kind)
        if self.diagnosed:
            self.model = hyst.diagnose(record, self.model).extended

    def simulate(self, period, u):
        return self.model.simulate(hyst.Record(period * np.arange(len(u)), u, **self.columns)).outputs


CONTENDERS = {
    "micromanipulator": {
        "hyst": [lambda k=k, d=d: Ours(k, d) for k in ("pi", "preisach") for d in (False, True)],
        "SysIdentPy": [lambda d=d, n=n, t=t: Narx(d, n, t) for d in (1, 2, 3) for n in (1, 2) for t in (4, 8, 12)],
        "PySINDy": [lambda d=d, h=h: Sindy(d, h) for d in (1, 2, 3) for h in (1e-4, 1e-3, 1e-2)],
        "scipy": [lambda n=n: Plays(n) for n in (8, 16, 32)],
    },
    "Bouc-Wen benchmark": {
        "hyst": [lambda: Ours("bouc-wen-oscillator", input_column="force_in_n", output_column="displacement_mm")],
        "SysIdentPy": [lambda d=d, n=n, t=t: Narx(d, n, t) for d, n, t in ((1, 3, 6), (1, 6, 12), (3, 2, 10), (3, 3, 20))],
        "PySINDy": [lambda d=d, h=h: Sindy(d, h) for d in (1, 3) for h in (1e-5, 1e-3)],
    },
}


def rmse(measured, predicted):
    """Returns the RMS of the residual without its mean; infinite if the simulation diverges."""
    residual = measured - predicted
    return float(np.std(residual)) if np.isfinite(residual).all() else float("inf")


def chosen(makers, period, u, y):
    """Returns the setting with the smallest error on the last quarter of the training record."""
    if len(makers) == 1:
        return makers[0]
    cut = 3 * len(u) // 4
    errors = []
    for make in makers:
        model = make()
        try:
            model.fit(period, u[:cut], y[:cut])
            errors.append(rmse(y[cut:], model.simulate(period, u)[cut:]))
        except (ValueError, np.linalg.LinAlgError, hyst.HystError) as error:
            print(f"  {model.name}: {error}", file=sys.stderr)
            errors.append(float("inf"))
    return makers[int(np.argmin(errors))]


def main():
    """Prints a table for each record."""
    warnings.filterwarnings("ignore")
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(os.environ["HYST_DATA"]) / "measured"
    print(", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("hyst", "sysidentpy", "pysindy", "scipy", "numpy")))
    for task, (train, tests, unit) in FILES.items():
        period, u, y = load(data / train)
        print(f"\n{task}\n| | setting | {' | '.join(f'RMSE {test} [{unit}]' for test in tests)} | fit [s] | per sample [µs] |")
        print("|---|---|" + "---:|" * (len(tests) + 2))
        for package, makers in CONTENDERS[task].items():
            model = chosen(makers, period, u, y)()
            begun = time.perf_counter()
            model.fit(period, u, y)
            fitted = time.perf_counter() - begun
            errors, spent, rows = [], 0.0, 0
            for file in tests.values():
                step, drive, measured = load(data / file)
                if file in PERIODIC:
                    # The steady state: the second of two periods.
                    drive = np.tile(drive, 2)
                begun = time.perf_counter()
                predicted = model.simulate(step, drive)[-len(measured) :]
                spent, rows = spent + time.perf_counter() - begun, rows + len(drive)
                errors.append(f"{rmse(measured, predicted):.4g}")
            print(f"| {package} | {model.name} | {' | '.join(errors)} | {fitted:.3g} | {1e6 * spent / rows:.3g} |", flush=True)


if __name__ == "__main__":
    main()
