//! Examples and explanations that follow the options in the help of a command.

pub(super) const EXAMPLES: &str = "\
Examples (a simulated actuator, from the first record to the run that follows a reference):
  hystctl excite identification --high 120 -o u.csv
  hystctl run --daq sim:plant.toml --drive u.csv --record train.csv
  hystctl fit train.csv --model pi -o model.json
  hystctl diagnose train.csv --model model.json -o extended.json
  hystctl compensate --model extended.json reference.csv -o drive.csv
  hystctl run --daq sim:plant.toml --model extended.json --reference reference.csv --log run.mcap

An existing output file is kept: it is renamed to FILE.~1~ or the next free number, unless the new file has the same content.

Exit codes: 0 done, 1 failed, 2 bad arguments or input, 3 device lost or data at risk.";

pub(super) const FIT: &str = "\
Examples:
  hystctl fit train.csv --model pi -o model.json
  hystctl fit a.csv b.csv --model preisach --zero per-record -o model.json
  hystctl fit forc.csv --model preisach --from fod -o model.json
  hystctl fit slow.csv 20hz.csv 60hz.csv --model dpm -o model.json
  hystctl fit train.csv --model bouc-wen --optimizer gwo --seed 1 --trials 12 --trace t.csv --picture t.svg -o model.json";

pub(super) const CLOSE_LOOP: &str = "\
Examples:
  hystctl close-loop --daq sim:plant.toml --out loop
  hystctl close-loop --daq sim:plant.toml --out loop --until 0.95 --within 60s";

pub(super) const LEARN: &str = "\
Examples:
  hystctl learn --daq sim:plant.toml --model extended.json --reference triangle:2,12,10,1 -o learned.csv
  hystctl learn --daq serial:/dev/ttyACM0 --model extended.json --reference line.csv --max-error 2 --logs passes -o learned.csv
  hystctl run --daq sim:plant.toml --drive learned.csv --record measured.csv";

pub(super) const COMPARE: &str = "\
Examples:
  hystctl compare train.csv --test test.csv
  hystctl compare train.csv --models pi,bouc-wen,tanh --picture compare.svg
  hystctl compare slow.csv 20hz.csv 60hz.csv --test test.csv --json";

pub(super) const SIMULATE: &str = "\
Examples:
  hystctl simulate --model model.json test.csv -o predicted.csv
  hystctl simulate --model model.json multisine-period.csv --periodic -o predicted.csv";

pub(super) const DIAGNOSE: &str = "\
Examples:
  hystctl diagnose train.csv --model model.json
  hystctl diagnose train.csv --test test.csv --model model.json -o extended.json
  hystctl diagnose train.csv --test test.csv --model model.json --report report.html
  hystctl diagnose a.csv b.csv --model model.json --zero per-record --findings findings.json";

pub(super) const FLEET: &str = "\
Examples:
  hystctl fleet records/ -o results.parquet --page fleet.html --reports reports/
  hystctl fleet serials.csv -o results.parquet

A list, for example serials.csv:
  file,serial,date
  run0001.csv,P-1001,2026-05-02";

pub(super) const COMPENSATE: &str = "\
Example:
  hystctl compensate --model extended.json reference.csv -o drive.csv --limit 0,120 --slew 5000";

pub(super) const RUN: &str = "\
Examples:
  hystctl run --daq sim:plant.toml --drive u.csv --record train.csv
  hystctl run --daq sim:plant.toml --model extended.json --reference reference.csv --log run.mcap

The record has one row for each row of the drive. Its times are those of the device's clock. The device reaches and measures \
each value one sample period after the value was sent. Ramps and rests take time, too. The first row is at one period or later.";

pub(super) const RUN_USAGE: &str = "\
hystctl run [OPTIONS] --daq <DEVICE> --drive <DRIVE>
       hystctl run [OPTIONS] --daq <DEVICE> --model <MODEL> --reference <REFERENCE>";

pub(super) const PLANT: &str = "\
A simulated plant is described by a file like this. All sections after [sensor] are optional. They are the effects that \
diagnose can name. A [[disturbance]] is something else, which diagnose must not give one of these names:
  seed = 7
  noise_seed = 8           # default: seed
  [actuator]
  max_v = 120
  gain_um_per_v = 0.2
  loop_share = 0.12        # width of the hysteresis loop as a share of its height
  bed = \"relays\"           # random relays; or \"clumps\" of relays; or \"plays\" (symmetric loops)
  [sensor]
  range_um = [-12, 43]
  noise_um = 0.007
  [delay]
  seconds = 0.002
  [lag]
  seconds = 0.003
  [asymmetry]
  bend = 0.05              # slope at the upper end minus slope at the lower end
  hook = 0.01              # slope at both ends minus slope in the middle
  [viscosity]              # the effect rate-dependence
  volt_seconds = 0.002     # overdrive x time that switches a relay: the loop widens with rate
  [temperature]
  per_k = 0.005
  reference_degc = 22
  mean_degc = 23
  swing_k = 4
  period_s = 45
  [creep]
  strength = 0.08
  tau_min_s = 0.05
  tau_max_s = 80
  [load]
  newtons = 3
  um_per_n = 0.05
  period_s = 8
  shape = \"steps\"          # or sine, wander
  recorded = false         # default: true, the record has load_n
  [[mode]]                 # the effect resonance
  hz = 100
  damping = 0.02
  gain = 0.9
  [saturation]
  high_um = 24             # relative to rest; or low_um, or both
  knee_um = 0.5            # default: 0, a hard stop
  high_v = 110             # the amplifier gives no more; or low_v, or both
  [drift]
  um_per_s = 0.01
  [interference]
  amplitude_um = 0.1
  hz = 50
  [[disturbance]]
  kind = \"jump\"            # um at at_s of the reading; or gain-step (share, at_s),
  um = 0.2                 # bursts (um, seconds, every_s) of noise, wander (um, period_s)
  at_s = 12                # of the zero, slip (um, at_v) of the mount,
                           # slew-limit (v_per_s) of the amplifier";

pub(super) const RECORDS: &str = "\
A record is a file with one row per sample: time, input, output and, if measured, temperature and load. Columns are recognised \
by headings that state their unit, for example time_s, Voltage [mV] or \"Position (nm)\"; --map names others. An integer column \
segment numbers the segments, between which the device rested. Readable formats: text tables in any dialect, MATLAB, HDF5, \
TDMS, LVM, NumPy, Parquet, Arrow, Excel and MCAP.";
