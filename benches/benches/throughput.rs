//! Measures samples per second of a run with its log, and requests per second to a device over a line with their
//! response times. `cargo bench -p hyst-benches --bench throughput` prints the tables.

use std::error::Error;
use std::net::TcpListener;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use hyst_benches::echo::{Echo, EchoBoard, identity};
use hyst_cli::log::{LoggedSample, RunInfo, RunLog};
use hyst_hw::wire::{
    Ask, Deframer, Device, Exchange, MAX_FRAME, MOST_DRIVES, Mode, Open, Reply, Request, Start, Tell, encode,
};
use hyst_hw::{
    Daq, EFFECTS, Line, Phase, Plant, PlantConfig, RecordOptions, Remote, RemoteOptions, Serial, Tcp, record_with,
    serve,
};
use hyst_ident::record::OutputUnit;

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

/// Drive samples of a run, and number of runs. The fastest run counts.
const SAMPLES: usize = 400_000;
const RUNS: usize = 5;
const RATE_HZ: f64 = 10_000.0;

/// Minimum throughput of a run with its log, on an echo and on a simulated plant \[samples/s\].
const MIN_ECHO: f64 = 200e3;
const MIN_PLANT: f64 = 50e3;

/// Performs a run as `hystctl run` does and returns samples per second.
fn run<D: Daq>(daq: &mut D, drive: &[f64], log: Option<&Path>) -> Outcome<f64> {
    let began = Instant::now();
    let info = RunInfo { device: "bench", output: OutputUnit::Micrometre, sample_rate_hz: RATE_HZ, model: None };
    let mut log = log.map(|path| RunLog::create(path, &info)).transpose()?;
    let mut failed = None;
    let recording = record_with(
        daq,
        &[drive],
        &RecordOptions::at(RATE_HZ),
        |_| {},
        |news| {
            let first = news.done - if news.phase == Phase::Record { news.samples.len() } else { 0 };
            if let (Some(log), None) = (&mut log, &failed) {
                let mut samples = news.samples.iter().enumerate().map(|(k, sample)| {
                    let wanted = drive.get(first + k).map(|volts| 0.2 * volts);
                    LoggedSample::new(news.segment, news.phase, sample, wanted)
                });
                failed = samples.try_for_each(|sample| log.sample(&sample)).err();
            }
            if failed.is_none() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        },
    )?;
    if let Some(log) = log {
        log.finish()?;
    }
    Ok(recording.segments[0].samples.len() as f64 / began.elapsed().as_secs_f64())
}

/// Returns the maximum of all runs.
fn fastest(mut once: impl FnMut() -> Outcome<f64>) -> Outcome<f64> {
    (0..RUNS).try_fold(0.0, |best: f64, _| Ok(best.max(once()?)))
}

fn runs() -> Outcome {
    let folder = tempfile::tempdir()?;
    let log = folder.path().join("run.mcap");
    println!("\n| device | samples/s with the log | without | minimum | bytes per sample |\n|---|---:|---:|---:|---:|");
    let row = |name: &str, min: f64, one: &mut dyn FnMut(Option<&Path>) -> Outcome<f64>| -> Outcome {
        let with = fastest(|| one(Some(&log)))?;
        let without = fastest(|| one(None))?;
        let bytes = std::fs::metadata(&log)?.len() as f64 / SAMPLES as f64;
        println!("| {name} | {with:.0} | {without:.0} | {min:.0} | {bytes:.1} |");
        if with < min {
            Err(format!("{name}: {with:.0} samples/s with its log, expected at least {min:.0}").into())
        } else {
            Ok(())
        }
    };
    let sine = |v: f64| -> Vec<f64> {
        let at = |k: usize| std::f64::consts::TAU * 3.7 * k as f64 / RATE_HZ;
        (0..SAMPLES).map(|k| v * 0.5 * (1.0 - at(k).cos())).collect()
    };
    let drive = sine(100.0);
    row("echo", MIN_ECHO, &mut |log| run(&mut Echo::default(), &drive, log))?;
    let all: Vec<&str> = EFFECTS.to_vec();
    for (name, effects) in [("plant, hysteresis alone", &[][..]), ("plant, every effect", &all)] {
        let config = PlantConfig::random_with(7, effects)?;
        let drive = sine(config.actuator.max_v);
        row(name, MIN_PLANT, &mut |log| run(&mut Plant::new(config.clone())?, &drive, log))?;
    }
    Ok(())
}

/// Sends a request over a line and waits for the answer.
fn answer_of(line: &mut impl Line, deframer: &mut Deframer, request: &Request) -> Outcome<Tell> {
    let (mut frame, mut bytes, sent) = ([0; MAX_FRAME], [0; 4096], Instant::now());
    line.send(encode(request, &mut frame).map_err(|error| error.to_string())?)?;
    while sent.elapsed() < Duration::from_secs(5) {
        let came = line.receive(&mut bytes, Duration::from_millis(100))?;
        let mut fresh = &bytes[..came];
        while let Some(reply) = deframer.next::<Reply>(&mut fresh) {
            if let Ok(reply) = reply
                && reply.number == request.number
            {
                return Ok(reply.tell);
            }
        }
    }
    Err("no answer within 5 s".into())
}

/// Sends requests for three seconds, one at a time, with the maximum number of drive and measured samples. Returns the
/// sorted response times \[s\].
fn requests(mut line: impl Line) -> Outcome<Vec<f64>> {
    let (mut deframer, mut heard, mut first, mut times) = (Deframer::new(), 0, 0, Vec::new());
    let who = identity();
    let start = Start {
        session: 1,
        mode: Mode::Voltage,
        rate_hz: who.max_rate_hz,
        low_v: who.min_v,
        high_v: who.max_v,
        slew_v_per_s: who.max_slew_v_per_s,
        hottest_degc: f32::INFINITY,
        error: f32::INFINITY,
        silence_s: 1.0,
        force: false,
    };
    answer_of(&mut line, &mut deframer, &Request { number: u32::MAX, ask: Ask::Start(start) })?;
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(3) {
        let drives = std::iter::repeat_n(10.0, MOST_DRIVES).collect();
        let exchange = Exchange { session: 1, heard, first, drives };
        let request = Request { number: times.len() as u32, ask: Ask::Exchange(exchange) };
        let sent = Instant::now();
        let tell = answer_of(&mut line, &mut deframer, &request)?;
        times.push(sent.elapsed().as_secs_f64());
        let Tell::Samples { status, first: from, samples } = tell else { return Err("no samples".into()) };
        (heard, first) = (from + samples.len() as u32, status.received);
    }
    times.sort_by(f64::total_cmp);
    Ok(times)
}

/// Returns samples per second of a run over a line. The clock of the device is faster than any line.
fn streamed(line: impl Line) -> Outcome<f64> {
    let mut remote = Remote::open(line, "bench", RemoteOptions::with_session(2))?;
    let drive = vec![10.0; 20_000];
    let options = RecordOptions { slew_v_per_s: 1e5, ..RecordOptions::at(f64::from(identity().max_rate_hz)) };
    let began = Instant::now();
    let recording = record_with(&mut remote, &[drive], &options, |_| {}, |_| ControlFlow::Continue(()))?;
    Ok(recording.segments[0].samples.len() as f64 / began.elapsed().as_secs_f64())
}

/// Runs `test` with the host's end of a line and a device thread at the other end.
fn with_device<H: Line, T>(
    (host, mut device): (H, impl Line + Send + 'static),
    test: impl FnOnce(H) -> Outcome<T>,
) -> Outcome<T> {
    let thread = std::thread::spawn(move || {
        let mut echo: Device<Open, 2048, 0> = Device::new(identity(), Open);
        // Ends when the host closes its end of the line.
        let _ = serve(&mut echo, &mut EchoBoard::default(), &mut device, || false);
    });
    let outcome = test(host);
    let _ = thread.join();
    outcome
}

fn socket() -> Outcome<(Tcp, Tcp)> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let host = Tcp::connect(listener.local_addr()?)?;
    Ok((host, Tcp::over(listener.accept()?.0)?))
}

#[cfg(unix)]
fn terminal() -> Outcome<(Serial, Serial)> {
    let (host, device) = serialport::TTYPort::pair()?;
    Ok((Serial::over(Box::new(host)), Serial::over(Box::new(device))))
}

fn lines() -> Outcome {
    println!(
        "\n| line | requests/s | p50 [µs] | p90 | p99 | maximum | samples/s of a run |\n|---|---:|---:|---:|---:|---:|---:|"
    );
    let row = |name: &str, times: Vec<f64>, samples: f64| {
        let total: f64 = times.iter().sum();
        let at = |share: f64| 1e6 * times[((times.len() - 1) as f64 * share) as usize];
        let [p50, p90, p99, max] = [0.5, 0.9, 0.99, 1.0].map(at);
        let rate = times.len() as f64 / total;
        println!("| {name} | {rate:.0} | {p50:.0} | {p90:.0} | {p99:.0} | {max:.0} | {samples:.0} |");
    };
    row("loopback TCP", with_device(socket()?, requests)?, with_device(socket()?, streamed)?);
    #[cfg(unix)]
    row("pseudo terminal", with_device(terminal()?, requests)?, with_device(terminal()?, streamed)?);
    Ok(())
}

fn main() -> Outcome {
    runs()?;
    lines()
}
