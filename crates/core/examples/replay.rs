//! Maps a capture with `slamd-core` alone: `cargo run -p slamd-core --example replay -- replay/flat-paper-faults.mcap`
use slamd_core::{Config, Driver, Pipeline, Record, Start, Timestamp};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::fs::read(std::env::args().nth(1).ok_or("name a capture")?)?;
    let mut driver = Driver::new(Pipeline::new(&Config::default(), Start::Fresh)?);
    for message in mcap::MessageStream::new(&file)? {
        let message = message?;
        let (at, bytes) = (Timestamp::from_us(message.log_time / 1_000), message.data.to_vec());
        let record = match message.channel.topic.as_str() {
            "/serial/rx" if bytes.is_empty() => Record::Opened { at },
            "/serial/rx" => Record::Received { at, bytes },
            "/serial/tx" => Record::Sent { at, bytes },
            _ => continue,
        };
        driver.feed(&record, |_, _| {});
    }
    driver.end(|_, _| {});
    let (map, wheels) = (driver.pipeline().raster(), driver.pipeline().calibration());
    println!("a map of {} x {} cells of {} m, and {wheels:?}", map.width, map.height, map.cell_m);
    Ok(())
}
