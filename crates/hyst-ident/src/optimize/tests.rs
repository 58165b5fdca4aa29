//! Tests of all searches.

use std::ops::ControlFlow;

use super::*;
use proptest::prelude::*;

fn keep_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn cube(dimensions: usize, half: f64) -> Space {
    let variable = |d| Variable::linear(&format!("x{d}"), "", -half, 1.3 * half);
    Space::new((0..dimensions).map(variable).collect()).unwrap()
}

/// Rosenbrock function, minimum 0 at (1, …, 1).
fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2).map(|p| 100.0 * (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2)).sum()
}

/// Rastrigin function with its minimum 0 at (0.7, …) and hundreds of local minima.
fn rastrigin(x: &[f64]) -> f64 {
    let one = |x: &f64| {
        let d = x - 0.7;
        d * d - 10.0 * (std::f64::consts::TAU * d).cos() + 10.0
    };
    x.iter().map(one).sum()
}

fn search(name: &str, f: &(dyn Fn(&[f64]) -> f64 + Sync), dimensions: usize, evaluations: u64, seed: u64) -> Found {
    let space = cube(dimensions, 5.0);
    let mut optimizer = Method::named(name, dimensions).unwrap().build(dimensions, evaluations, seed).unwrap();
    minimize(&space, &|x: &[f64]| f(x), optimizer.as_mut(), &Stop::after(evaluations), &mut keep_on).unwrap()
}

#[test]
fn each_search_finds_the_minimum_of_a_sphere() {
    let sphere = |x: &[f64]| x.iter().map(|x| (x - 0.3).powi(2)).sum::<f64>();
    for (name, most) in [("de", 1e-20), ("de-rand-1-bin", 1e-8), ("pso", 1e-12), ("pso-xie", 1e-2), ("gwo", 1e-4)] {
        for seed in 0..5 {
            let found = search(name, &sphere, 6, 30_000, seed);
            assert!(found.cost < most, "{name} seed {seed}: {}", found.cost);
        }
    }
}

/// With the printed equations the search is drawn to the lower corner of the box: it is worse for an optimum far from
/// there.
#[test]
fn grey_wolves_as_printed_find_a_minimum_near_their_origin() {
    let sphere = |x: &[f64]| x.iter().map(|x| (x + 4.9).powi(2)).sum::<f64>();
    assert!(search("gwo-paper", &sphere, 6, 30_000, 1).cost < 1e-3);
}

#[test]
fn adaptive_differential_evolution_leaves_local_minima() {
    for seed in 0..5 {
        assert!(search("de", &rastrigin, 6, 60_000, seed).cost < 1e-9);
        assert!(search("de", &rosenbrock, 6, 60_000, seed).cost < 1e-9);
    }
}

#[test]
fn a_seed_gives_the_same_bits_on_one_thread_and_on_three() {
    let on_threads = |n: usize, name: &str| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| search(name, &rastrigin, 4, 5000, 11))
    };
    for name in Method::NAMES {
        assert_eq!(on_threads(1, name), on_threads(3, name), "{name}");
        assert_ne!(
            search(name, &rastrigin, 4, 5000, 11).values,
            search(name, &rastrigin, 4, 5000, 12).values,
            "{name}"
        );
    }
}

/// Stops every evaluation at its limit.
struct Abandoning;

impl Cost for Abandoning {
    fn width(&self) -> usize {
        3
    }
    fn costs(&self, points: &[f64], hopeless: &[f64], costs: &mut [f64]) {
        for ((cost, x), limit) in costs.iter_mut().zip(points.chunks_exact(4)).zip(hopeless) {
            let whole = rastrigin(x);
            *cost = if whole >= *limit { limit + 1e3 } else { whole };
        }
    }
}

#[test]
fn stopping_evaluations_at_the_limit_changes_nothing() {
    for name in Method::NAMES {
        let whole = search(name, &rastrigin, 4, 8000, 3);
        let mut optimizer = Method::named(name, 4).unwrap().build(4, 8000, 3).unwrap();
        let stopped =
            minimize(&cube(4, 5.0), &Abandoning, optimizer.as_mut(), &Stop::after(8000), &mut keep_on).unwrap();
        assert_eq!(whole, stopped, "{name}");
    }
}

#[test]
fn a_cost_that_is_not_a_number_is_the_worst() {
    let half = |x: &[f64]| if x[0] > 0.0 { f64::NAN } else { x[0] * x[0] + x[1] * x[1] };
    for name in ["de", "de-rand-1-bin", "pso", "gwo"] {
        let found = search(name, &half, 2, 6000, 5);
        assert!(found.cost < 1e-3 && found.values[0] <= 0.0, "{name}: {found:?}");
    }
}

#[test]
fn the_error_of_a_model_that_is_never_finite_contains_the_bounds() {
    let space = Space::new(vec![Variable::log("tau", "s", 1e-4, 1e-2)]).unwrap();
    let mut optimizer = Method::named("de", 1).unwrap().build(1, 100_000, 1).unwrap();
    let stop = Stop::after(100_000);
    let error = minimize(&space, &|_: &[f64]| f64::NAN, optimizer.as_mut(), &stop, &mut keep_on).unwrap_err();
    assert!(error.to_string().contains("tau 0.0001 … 0.01"), "{error}");
}

#[test]
fn settings_out_of_range_are_errors_with_the_name() {
    let said = |m: Method| m.build(3, 1000, 1).err().unwrap().to_string();
    assert!(said(Method::Shade { population: Some(0) }).starts_with("population = 0"));
    assert!(said(Method::De { population: 20, factor: 3.0, crossover: 0.5 }).starts_with("factor = 3"));
    assert!(
        said(Method::Pso { population: 20, inertia: f64::NAN, own: 1.0, common: 1.0 }).starts_with("inertia = NaN")
    );
    assert!(Method::named("genetic", 3).unwrap_err().to_string().contains("de-rand-1-bin"));
    let (space, mut tiny) = (cube(2, 1.0), Method::named("pso", 2).unwrap().build(2, 10, 1).unwrap());
    let too_few = minimize(&space, &|_: &[f64]| 0.0, tiny.as_mut(), &Stop::after(10), &mut keep_on);
    assert_eq!(too_few, Err(SearchError::TooFew { evaluations: 10, population: 40 }));
}

#[test]
fn each_stop_condition_stops() {
    let sphere = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let space = cube(2, 1.0);
    let run = |stop: Stop| {
        let mut optimizer = Method::named("de-rand-1-bin", 2).unwrap().build(2, 1000, 1).unwrap();
        minimize(&space, &|x: &[f64]| sphere(x), optimizer.as_mut(), &stop, &mut keep_on).unwrap()
    };
    let budget = run(Stop { tolerance: -1.0, ..Stop::after(500) });
    assert!(budget.stopped == Stopped::Budget && budget.evaluations == 500);
    assert_eq!(run(Stop { target: 1e-3, ..Stop::after(100_000) }).stopped, Stopped::Target);
    assert_eq!(run(Stop { tolerance: 1e-3, ..Stop::after(100_000) }).stopped, Stopped::Converged);
    let flat = run(Stop { stall: 30, tolerance: -1.0, ..Stop::after(10_000_000) });
    assert_eq!(flat.stopped, Stopped::Stalled);
}

#[test]
fn trials_scatter_and_their_quartiles_are_in_order() {
    let space = cube(4, 5.0);
    let method = Method::named("pso", 4).unwrap();
    let found =
        trials(&space, &|x: &[f64]| rastrigin(x), &method, &Stop::after(2000), 7, 8, &mut |_, p| keep_on(p)).unwrap();
    let s = found.costs().unwrap();
    assert!(s.lowest < s.highest && s.lower_quartile <= s.median && s.median <= s.upper_quartile);
    assert_eq!(found.best().unwrap().cost, s.lowest);
    assert_eq!(Spread::of(&[4.0, 1.0, 3.0, 2.0]).unwrap().median, 2.5);
}

proptest! {
    /// All points are in the box, and the best cost never rises.
    #[test]
    fn points_stay_in_the_box(seed in 0u64..1000, which in 0usize..6, dimensions in 1usize..6) {
        let method = Method::named(Method::NAMES[which], dimensions).unwrap();
        let mut optimizer = method.build(dimensions, 2000, seed).unwrap();
        let mut before = f64::INFINITY;
        for _ in 0..20 {
            let asked = optimizer.ask();
            prop_assert!(asked.points.iter().all(|x| (0.0..=1.0).contains(x)));
            let costs: Vec<f64> = asked.points.chunks_exact(dimensions).map(|p| rastrigin(p) + p[0] * 0.1).collect();
            optimizer.tell(&costs).unwrap();
            let best = optimizer.best().unwrap().1;
            prop_assert!(best <= before);
            before = best;
        }
        prop_assert!(optimizer.tell(&[1.0]).is_err());
    }
}

/// A population that exceeds the memory is an error before it is allocated.
#[test]
fn a_population_beyond_the_budget_is_an_error_at_once() {
    let (space, stop) = (cube(2, 1.0), Stop::after(1000));
    let sphere = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    for name in Method::NAMES {
        let method = Method::named(name, 2).unwrap().with_population(usize::MAX / 2);
        let refused = trials(&space, &sphere, &method, &stop, 1, 1, &mut |_, _| ControlFlow::Continue(()));
        assert_eq!(
            refused.err(),
            Some(SearchError::TooFew { evaluations: 1000, population: usize::MAX / 2 }),
            "{name}"
        );
    }
}
