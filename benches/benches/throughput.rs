//! Samples a second of a run with its log, and frames a second to a device at the other end of a line, with the time that an answer takes.
//! `cargo bench -p hyst-benches --bench throughput` prints the tables.

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

/// Drive samples of a run, and runs of which the fastest counts.
const SAMPLES: usize = 400_000;
const RUNS: usize = 5;
const RATE_HZ: f64 = 10_000.0;

/// What a run has to reach with its log, on an echo and on a simulated plant \[samples/s\].
const LEAST_ECHO: f64 = 200e3;
const LEAST_PLANT: f64 = 50e3;

/// A run as `hystctl run` makes it; gives samples a second.
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

fn fastest(mut once: impl FnMut() -> Outcome<f64>) -> Outcome<f64> {
    (0..RUNS).try_fold(0.0, |best: f64, _| Ok(best.max(once()?)))
}

fn runs() -> Outcome {
    let folder = tempfile::tempdir()?;
    let log = folder.path().join("run.mcap");
    println!("\n| device | samples/s with the log | without | least | bytes a sample |\n|---|---:|---:|---:|---:|");
    let table = |name: &str, least: f64, one: &mut dyn FnMut(Option<&Path>) -> Outcome<f64>| -> Outcome {
        let with = fastest(|| one(Some(&log)))?;
        let without = fastest(|| one(None))?;
        let bytes = std::fs::metadata(&log)?.len() as f64 / SAMPLES as f64;
        println!("| {name} | {with:.0} | {without:.0} | {least:.0} | {bytes:.1} |");
        if with < least {
            Err(format!("{name}: {with:.0} samples/s with its log, {least:.0} are asked for").into())
        } else {
            Ok(())
        }
    };
    let top_v = |v: f64| -> Vec<f64> {
        let at = |k: usize| std::f64::consts::TAU * 3.7 * k as f64 / RATE_HZ;
        (0..SAMPLES).map(|k| v * 0.5 * (1.0 - at(k).cos())).collect()
    };
    let drive = top_v(100.0);
    table("echo", LEAST_ECHO, &mut |log| run(&mut Echo::default(), &drive, log))?;
    let named: Vec<&str> = EFFECTS.to_vec();
    for (name, effects) in [("plant, hysteresis alone", &[][..]), ("plant, every effect", &named)] {
        let config = PlantConfig::random_with(7, effects)?;
        let drive = top_v(config.actuator.max_v);
        table(name, LEAST_PLANT, &mut |log| run(&mut Plant::new(config.clone())?, &drive, log))?;
    }
    Ok(())
}

/// Asks over a line, and waits for the answer.
fn answered(line: &mut impl Line, deframer: &mut Deframer, request: &Request) -> Outcome<Tell> {
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

/// Requests of some seconds, one at a time, full of drives, with answers full of samples; gives what each took \[s\], in order.
fn requests(mut line: impl Line) -> Outcome<Vec<f64>> {
    let (mut deframer, mut heard, mut first, mut took) = (Deframer::new(), 0, 0, Vec::new());
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
    answered(&mut line, &mut deframer, &Request { number: u32::MAX, ask: Ask::Start(start) })?;
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(3) {
        let drives = std::iter::repeat_n(10.0, MOST_DRIVES).collect();
        let exchange = Exchange { session: 1, heard, first, drives };
        let request = Request { number: took.len() as u32, ask: Ask::Exchange(exchange) };
        let sent = Instant::now();
        let tell = answered(&mut line, &mut deframer, &request)?;
        took.push(sent.elapsed().as_secs_f64());
        let Tell::Samples { status, first: from, samples } = tell else { return Err("no samples".into()) };
        (heard, first) = (from + samples.len() as u32, status.received);
    }
    took.sort_by(f64::total_cmp);
    Ok(took)
}

/// Samples a second of a run over a line, whose device's clock is faster than any line.
fn streamed(line: impl Line) -> Outcome<f64> {
    let mut remote = Remote::open(line, "bench", RemoteOptions::with_session(2))?;
    let drive = vec![10.0; 20_000];
    let options = RecordOptions { slew_v_per_s: 1e5, ..RecordOptions::at(f64::from(identity().max_rate_hz)) };
    let began = Instant::now();
    let recording = record_with(&mut remote, &[drive], &options, |_| {}, |_| ControlFlow::Continue(()))?;
    Ok(recording.segments[0].samples.len() as f64 / began.elapsed().as_secs_f64())
}

/// What `does` gives of a device behind `device`, in a thread of its own.
fn with_device<H: Line, T>(
    (host, mut device): (H, impl Line + Send + 'static),
    does: impl FnOnce(H) -> Outcome<T>,
) -> Outcome<T> {
    let thread = std::thread::spawn(move || {
        let mut device_itself: Device<Open, 2048, 0> = Device::new(identity(), Open);
        // The host's end of the line ends it.
        let _ = serve(&mut device_itself, &mut EchoBoard::default(), &mut device, || false);
    });
    let outcome = does(host);
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
        "\n| line | requests/s | p50 [µs] | p90 | p99 | longest | samples/s of a run |\n|---|---:|---:|---:|---:|---:|---:|"
    );
    let row = |name: &str, took: Vec<f64>, samples: f64| {
        let total: f64 = took.iter().sum();
        let at = |share: f64| 1e6 * took[((took.len() - 1) as f64 * share) as usize];
        let [p50, p90, p99, longest] = [0.5, 0.9, 0.99, 1.0].map(at);
        let rate = took.len() as f64 / total;
        println!("| {name} | {rate:.0} | {p50:.0} | {p90:.0} | {p99:.0} | {longest:.0} | {samples:.0} |");
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
