
use hyst_benches::task::Task;
use hyst_ident::optimize::*;
use std::ops::ControlFlow;
fn cube(d: usize) -> Space { Space::new((0..d).map(|d| Variable::linear(&format!("x{d}"), "", -5.0, 6.5)).collect()).unwrap() }
fn valley(x: &[f64]) -> f64 { x.windows(2).map(|p| 100.0 * (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2)).sum() }
fn egg(x: &[f64]) -> f64 { x.iter().map(|x| { let d = x - 0.7; d * d - 10.0 * (std::f64::consts::TAU * d).cos() + 10.0 }).sum() }
fn turned(x: &[f64]) -> f64 { let n = x.len(); (0..n).map(|i| { let s: f64 = (0..n).map(|j| ((i * j + i + 2 * j) as f64 * 1.7).sin() * (x[j] - 0.3)).sum(); s * s * 10f64.powf(6.0 * i as f64 / (n - 1) as f64) }).sum() }
fn run(name: &str, space: &Space, cost: &dyn Cost, floor: f64, seeds: u64) {
    let d = space.dimensions() as u64;
    for (budget, cut) in [(750 * d, 0), (1500 * d, 0), (5000 * d, 0)] {
        let _ = cut;
        for pop in std::env::args().skip(1).map(|x| x.parse::<f64>().unwrap()) {
            let pop = if pop == 0.0 { 0 } else if pop < 0.0 { ((budget as f64 / -pop) as usize).clamp(20, 18 * d as usize) } else { (pop * d as f64) as usize };
            let mut c: Vec<f64> = (0..seeds).map(|s| {
                let mut o = Method::Shade { population: (pop > 0).then_some(pop) }.build(d as usize, budget, 100 + s).unwrap();
                minimize(space, cost, o.as_mut(), &Stop::after(budget), &mut |_| ControlFlow::Continue(())).unwrap().cost / floor
            }).collect();
            c.sort_by(f64::total_cmp);
            let n = c.len() - 1;
            println!("{name:9} {budget:6} pop {pop:3}: min {:.5e} med {:.5e} q3 {:.5e} max {:.5e}", c[0], c[n / 2], c[3 * n / 4], c[n]);
        }
    }
}
fn main() {
    let which = std::env::var("WHICH").unwrap_or("tbver".into());
    if which.contains('t') { let t = Task::td_pi(); run("td-pi", &t.space, &*t.cost(), t.floor, 15); }
    if which.contains('b') { let t = Task::bouc_wen(500); run("bouc-wen", &t.space, &*t.cost(), t.floor, 15); }
    if which.contains('v') { run("valley6", &cube(6), &valley, 1.0, 31); }
    if which.contains('e') { run("egg6", &cube(6), &egg, 1.0, 31); }
    if which.contains('r') { run("turned8", &cube(8), &turned, 1.0, 31); }
}
