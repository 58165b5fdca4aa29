"""Hysteresis models as estimators of scikit-learn.

``HysteresisRegressor`` works in pipelines, ``GridSearchCV`` and ``cross_val_score``. Rows are samples in time order:
split them with ``TimeSeriesSplit``, and do not shuffle. A prediction starts at rest at its first row.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin  # type: ignore[import-untyped]
from sklearn.utils.validation import check_is_fitted, validate_data  # type: ignore[import-untyped]

import hyst

__all__ = ["HysteresisRegressor"]

#: ``Any``, because Pyright derives the types of ``X`` and ``y`` from their default strings.
_validated: Any = validate_data


class HysteresisRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """A hysteresis model that is fitted to rows of input and output.

    Parameters
    ----------
    model : str
        Kind of the base model, as in ``hyst.fit``.
    period : float
        Sample period of the rows [s].
    diagnose : bool
        Whether missing effects are searched and added (``hyst.diagnose``).
    optimizer : str
        As in ``hyst.fit``.
    seed : int
        Seed of the random numbers.
    column : int
        Column of ``X`` with the input.
    temperature, load : int or None
        Columns of ``X`` with the temperature [°C] and the load [N].
    input_column, output_column : str
        Names and units of input and output, as in ``hyst.Record``.

    Attributes
    ----------
    model_ : hyst.Model
        The fitted model; with ``diagnose``, the extended model.
    diagnosis_ : hyst.Diagnosis
        The diagnosis; only with ``diagnose``.
    n_features_in_ : int
        Number of columns of ``X``.

    Examples
    --------
    >>> import numpy as np
    >>> from hyst.sklearn import HysteresisRegressor
    >>> u = 50 * (1 - np.cos(np.linspace(0, 60, 3000)))
    >>> y = 0.1 * u + 0.05 * np.clip(u, 20, 80)
    >>> HysteresisRegressor(period=1e-3).fit(u[:2000, None], y[:2000]).score(u[2000:, None], y[2000:]) > 0.9
    True
    """

    def __init__(
        self,
        model: str = "pi",
        *,
        period: float = 1.0,
        diagnose: bool = False,
        optimizer: str = "auto",
        seed: int = 0,
        column: int = 0,
        temperature: int | None = None,
        load: int | None = None,
        input_column: str = "voltage_v",
        output_column: str = "displacement_um",
    ) -> None:
        self.model = model
        self.period = period
        self.diagnose = diagnose
        self.optimizer = optimizer
        self.seed = seed
        self.column = column
        self.temperature = temperature
        self.load = load
        self.input_column = input_column
        self.output_column = output_column

    def _record(self, X: NDArray[np.float64], y: NDArray[np.float64] | None = None) -> hyst.Record:
        """Returns the rows as a record."""

        def column(at: int | None) -> NDArray[np.float64] | None:
            return None if at is None else X[:, at]

        return hyst.Record(
            self.period * np.arange(len(X)),
            column(self.column),
            y,
            temperature=column(self.temperature),
            load=column(self.load),
            input_column=self.input_column,
            output_column=self.output_column,
            name="X",
        )

    def fit(self, X: ArrayLike, y: ArrayLike) -> "HysteresisRegressor":
        """Fits the model.

        Parameters
        ----------
        X : array_like, shape (n, k)
            Input and, if used, temperature and load, one row per sample.
        y : array_like, shape (n,)
            Output.

        Returns
        -------
        self : HysteresisRegressor
        """
        rows: Any
        rows, measured = _validated(self, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=2)
        record = self._record(rows, np.asarray(measured, dtype=np.float64))
        self.model_ = hyst.fit(record, model=self.model, optimizer=self.optimizer, seed=self.seed)
        if self.diagnose:
            self.diagnosis_ = hyst.diagnose(record, self.model_, seed=self.seed)
            self.model_ = self.diagnosis_.extended
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """Returns the output of the model, from rest.

        Parameters
        ----------
        X : array_like, shape (n, k)
            Columns as in ``fit``.

        Returns
        -------
        y : ndarray of float64, shape (n,)
        """
        check_is_fitted(self)
        rows = np.asarray(_validated(self, X, dtype=np.float64, reset=False))
        if len(rows) == 1:
            # A record needs two rows for its sample period, so a single row is repeated.
            return self.predict(np.repeat(rows, 2, axis=0))[:1]
        return self.model_.simulate(self._record(rows)).outputs
