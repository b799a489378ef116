//! Maps a capture with `slamd-core` alone: `cargo run -p slamd-core --example replay -- replay/flat-paper-faults.mcap`
//! with the default robot. `slamd replay` takes the robot from the capture.
use slamd_core::{Config, Context, Driver, Estimate, Event, Pipeline, Record, Start, Timestamp, Update};

fn print(_: &Context<'_>, update: Update<'_>) {
    if let Update::Event(Event::Estimate(Estimate { at, pose, .. })) = update {
        println!("{:.3} s: {:.3} m, {:.3} m, {:.4} rad", at.seconds(), pose.x_m, pose.y_m, pose.theta_rad);
    }
}

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
        driver.feed(&record, print);
    }
    driver.end(print);
    let map = driver.pipeline().raster();
    println!("a map of {} x {} cells of {} m", map.width, map.height, map.cell_m);
    Ok(())
}
