//! Serves the simulated plant as a device on a TCP port.
//!
//! Start it with `cargo run -p hyst-hw --example served -- plant.toml 127.0.0.1:4000 [RATE]`, then run
//! `hystctl run --daq tcp:127.0.0.1:4000 …`. The default rate is 1000 Hz.

use std::net::TcpListener;

use hyst_hw::wire::{Device, Follower};
use hyst_hw::{Plant, PlantBoard, PlantConfig, serve_at};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(address)) = (arguments.next(), arguments.next()) else {
        return Err("expected a plant file and an address, for example: plant.toml 127.0.0.1:4000".into());
    };
    let rate_hz = arguments.next().map_or(Ok(1000.0), |rate| rate.parse())?;
    let config = std::fs::read_to_string(&file)
        .map_err(|error| error.to_string())
        .and_then(|text| PlantConfig::from_toml(&text).map_err(|error| error.to_string()))
        .map_err(|error| format!("{file}: {error}"))?;
    let mut board = PlantBoard::new(Plant::new(config)?, rate_hz)?;
    let mut device: Device<Follower, 512, 4096> = Device::new(board.identity(rate_hz, true), Follower::new());
    let listener = TcpListener::bind(&address).map_err(|error| format!("{address}: {error}; give another port"))?;
    println!("listening at {}", listener.local_addr()?);
    Ok(serve_at(&listener, &mut device, &mut board, || false)?)
}
