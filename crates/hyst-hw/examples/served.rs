//! The simulated plant as a device at a socket: `cargo run -p hyst-hw --example served -- plant.toml 127.0.0.1:4000 [RATE]`, then
//! `hystctl run --daq tcp:127.0.0.1:4000 …`.

use std::net::TcpListener;

use hyst_hw::wire::{Device, Open};
use hyst_hw::{Plant, PlantBoard, PlantConfig, Tcp, serve};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(address)) = (arguments.next(), arguments.next()) else {
        return Err("give the plant's file and an address, as plant.toml 127.0.0.1:4000".into());
    };
    let rate_hz = arguments.next().map_or(Ok(1000.0), |rate| rate.parse())?;
    let config = PlantConfig::from_toml(&std::fs::read_to_string(file)?)?;
    let mut board = PlantBoard::new(Plant::new(config)?, rate_hz)?;
    let mut device: Device<Open, 512, 0> = Device::new(board.identity(rate_hz), Open);
    let listener = TcpListener::bind(address)?;
    println!("listening at {}", listener.local_addr()?);
    loop {
        let (stream, peer) = listener.accept()?;
        eprintln!("{peer} is here");
        // A host that goes leaves the device to its watchdog, which acts as soon as the next one comes; a real one does so by itself.
        let gone = serve(&mut device, &mut board, &mut Tcp::over(stream)?, || false);
        eprintln!("{peer} is gone: {gone:?}");
    }
}
