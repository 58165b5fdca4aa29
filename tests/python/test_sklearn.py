"""The estimator of scikit-learn."""

import numpy as np
import pytest

sklearn = pytest.importorskip("sklearn")

from hyst.sklearn import HysteresisRegressor  # noqa: E402
from sklearn.base import clone  # noqa: E402
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit, cross_val_score  # noqa: E402
from sklearn.pipeline import make_pipeline  # noqa: E402
from sklearn.preprocessing import FunctionTransformer  # noqa: E402
from sklearn.utils.estimator_checks import parametrize_with_checks  # noqa: E402
from test_records import RATE, actuator  # noqa: E402

#: Checks that an operator with memory cannot pass, with the reason.
MEMORY = {
    "check_methods_subset_invariance": "an output depends on the rows before it",
    "check_methods_sample_order_invariance": "an output depends on the order of the rows",
}
#: Checks with too few rows.
SHORT = dict.fromkeys(
    [
        "check_dict_unchanged",
        "check_dont_overwrite_parameters",
        "check_estimators_dtypes",
        "check_estimators_fit_returns_self",
        "check_estimators_nan_inf",
        "check_estimators_overwrite_params",
        "check_estimators_pickle",
        "check_f_contiguous_array_estimator",
        "check_fit2d_1feature",
        "check_fit2d_predict1d",
        "check_fit_score_takes_y",
        "check_n_features_in_after_fitting",
        "check_pipeline_consistency",
        "check_readonly_memmap_input",
        "check_regressors_no_decision_function",
        "check_supervised_y_2d",
    ],
    "`pi` with its 15 unknowns needs 45 rows; the check has fewer",
)
#: Random rows have no hysteresis: a model cannot explain half of their variance.
NOISE = {"check_regressors_train": "the rows are random: an actuator model does not explain half of their variance"}


def expected(estimator):
    return {**MEMORY, **NOISE, **(SHORT if estimator.model == "pi" else {})}


@parametrize_with_checks([HysteresisRegressor(), HysteresisRegressor("maxwell-slip")], expected_failed_checks=expected)
def test_checks_of_scikit_learn(estimator, check):
    check(estimator)


def data(n=4000):
    _, u, y = actuator(n, 5)
    return u[:, None], y


def test_it_predicts_rows_that_were_not_fitted():
    X, y = data()
    fitted = HysteresisRegressor(period=1 / RATE).fit(X[:3000], y[:3000])
    assert fitted.score(X[3000:], y[3000:]) > 0.99
    again = clone(fitted).fit(X[:3000], y[:3000])
    assert again.model_ == fitted.model_ and np.array_equal(again.predict(X), fitted.predict(X))


def test_it_works_in_a_pipeline_and_a_search():
    X, y = data()
    scaled = FunctionTransformer(lambda X: 10.0 * X)
    piped = make_pipeline(scaled, HysteresisRegressor(period=1 / RATE)).fit(X / 10.0, y)
    assert piped.score(X / 10.0, y) > 0.99
    folds = TimeSeriesSplit(3)
    assert cross_val_score(HysteresisRegressor(period=1 / RATE), X, y, cv=folds).min() > 0.9
    search = GridSearchCV(HysteresisRegressor(period=1 / RATE), {"model": ["pi", "preisach"]}, cv=folds).fit(X, y)
    assert search.best_params_["model"] in ("pi", "preisach") and search.best_score_ > 0.9


def test_a_temperature_column_can_be_selected():
    X, y = data()
    warm = np.column_stack([20.0 + np.linspace(0.0, 5.0, len(X)), X[:, 0]])
    fitted = HysteresisRegressor(period=1 / RATE, column=1, temperature=0).fit(warm, y)
    assert fitted.n_features_in_ == 2 and fitted.score(warm, y) > 0.99
    with pytest.raises(IndexError):
        HysteresisRegressor(column=3).fit(warm, y)
