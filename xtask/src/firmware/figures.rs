//! The costs of all models in `docs/firmware.md`.

use super::link;
use super::toolchain::Toolchain;
use std::fs;
use std::path::Path;

/// Relative deviation of a table row above which the table must be written again.
const TOLERANCE: f64 = 0.1;

const INTRODUCTION: &str = "\
# What the models cost on a Cortex-M4F

Measured by `cargo xtask firmware --table`. All models run over the same 1000 samples in QEMU (machine mps2-an386). Their
outputs are bit-identical to those of the host, in `f32` and in `f64`.

- **instructions**: instructions of one `step` minus an empty call, mean and maximum. These are instructions, not cycles:
  slow memory, branches, divisions and roots take more than one cycle each. The Cortex-M4F computes `f32` in hardware and
  `f64` in software.
- **flash**, in bytes: `reset` and `step` with all functions that they call, each model linked alone. A firmware with
  several models contains shared functions (`sinf`, the arithmetic of `f64`) only once. *opt-level s* is optimised for
  size. *with build* includes the conversion of parameters to coefficients, which a host can do instead.
- **RAM**, in bytes: coefficients (in flash if they are constant) and state, one of each per actuator. Models have no other
  data.
- **stack**, in bytes: the maximum of a `step`, including the call (16 to 32), and that of building and resetting.

The number in a name is the number of plays, cells along an edge, elements, states or samples of memory. Temperature, load and
time change at every sample. The drag of `pi_10_viscous` is proportional to the rate, that of `pi_10_root_viscous` to its root.
`td_em_10` computes a matrix exponential at every change of the temperature; `td_em_10_steady` has a constant temperature. `chain`
is delay, lag, 10 plays, temperature, 4 creep elements, a resonance, drift and a tone; `compensator` is its inverse with 129 taps.
`adaptation` corrects a reference and estimates six coefficients; its maximum is a sample with an update.

No function of a model can panic, at opt-level 3 and s: all of them link although the panic handler cannot be linked.
";

const HEADER: &str = "\
| model | instructions | maximum | flash | opt-level s | with build | coefficients | state | stack | to build |
|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|
";

/// One case in one precision.
struct Row {
    case: String,
    precision: String,
    mean: f64,
    worst: String,
    flash: u32,
    flash_small: u32,
    flash_with_build: u32,
    coefficients: String,
    state: String,
    stack: String,
    build_stack: String,
}

impl Row {
    fn line(&self) -> String {
        let Self {
            case,
            mean,
            worst,
            flash,
            flash_small,
            flash_with_build,
            coefficients,
            state,
            stack,
            build_stack,
            ..
        } = self;
        format!(
            "| `{case}` | {mean:.0} | {worst} | {flash} | {flash_small} | {flash_with_build} | {coefficients} | {state} | {stack} | {build_stack} |\n"
        )
    }
}

/// Figures of all cases.
pub(crate) struct Figures {
    compiler: String,
    rows: Vec<Row>,
}

impl Figures {
    /// Collects the figures from the output of the firmware and from linking.
    pub(crate) fn collect(toolchain: &Toolchain, library: &Path, small: &Path, printed: &Path) -> Result<Self, String> {
        let text = fs::read_to_string(printed).map_err(|error| format!("{}: {error}", printed.display()))?;
        let mut rows = Vec::new();
        for line in text.lines().filter_map(|line| line.strip_prefix("case ")) {
            let (case, rest) = line.split_once(' ').unwrap_or((line, ""));
            let (precision, rest) = rest.split_once(' ').unwrap_or((rest, ""));
            let figure = |name: &str| {
                let value = rest.split(' ').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='));
                value.map(str::to_owned).ok_or_else(|| format!("the firmware printed no {name} for {case}"))
            };
            let number =
                |name: &str| figure(name)?.parse::<f64>().map_err(|error| format!("{name} of {case}: {error}"));
            let [build, reset, step] = ["build", "reset", "step"].map(|f| format!("{f}.{case}.{precision}"));
            rows.push(Row {
                mean: number("instructions")? / number("steps")?,
                worst: figure("worst")?,
                flash: link::flash(toolchain, library, &[&reset, &step])?,
                flash_small: link::flash(toolchain, small, &[&reset, &step])?,
                flash_with_build: link::flash(toolchain, library, &[&build, &reset, &step])?,
                coefficients: figure("coefficients")?,
                state: figure("state")?,
                stack: figure("stack")?,
                build_stack: figure("build_stack")?,
                case: case.to_owned(),
                precision: precision.to_owned(),
            });
        }
        Ok(Self { compiler: format!("{}, opt-level 3, LTO", toolchain.version), rows })
    }

    /// Writes and prints the document.
    pub(crate) fn write(&self, document: &Path) -> Result<(), String> {
        let mut text = format!("{INTRODUCTION}\nCompiler: {}.\n", self.compiler);
        for precision in ["f32", "f64"] {
            text.push_str(&format!("\n## {precision}\n\n{HEADER}"));
            for row in self.rows.iter().filter(|row| row.precision == precision) {
                text.push_str(&row.line());
            }
        }
        print!("{text}");
        let folder = document.parent().map_or(Ok(()), fs::create_dir_all);
        folder.and_then(|()| fs::write(document, text)).map_err(|error| format!("{}: {error}", document.display()))
    }

    /// Returns an error if the document has no row for a model or, for the same compiler, other figures.
    pub(crate) fn compare(&self, document: &Path) -> Result<(), String> {
        const WRITE_AGAIN: &str = "type `cargo xtask firmware --table` to write it again";
        let text =
            fs::read_to_string(document).map_err(|error| format!("{}: {error}; {WRITE_AGAIN}", document.display()))?;
        let same_compiler = text.contains(&self.compiler);
        for precision in ["f32", "f64"] {
            let section = text.split("\n## ").find(|section| section.starts_with(precision)).unwrap_or_default();
            for row in self.rows.iter().filter(|row| row.precision == precision) {
                let start = format!("| `{}` | ", row.case);
                let line = section.lines().find_map(|line| line.strip_prefix(&start));
                let stated = line.and_then(|line| line.split(' ').next()?.parse::<f64>().ok());
                let off = stated.is_none_or(|stated| (stated - row.mean).abs() > TOLERANCE * row.mean + 1.0);
                if stated.is_none() || (same_compiler && off) {
                    let Row { case, mean, .. } = row;
                    let is = document.display();
                    return Err(format!(
                        "{is}: {case} takes {mean:.0} instructions in {precision}, not {stated:?}; {WRITE_AGAIN}"
                    ));
                }
            }
        }
        Ok(())
    }
}
