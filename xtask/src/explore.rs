//! `cargo xtask explore`: the explorer drives simulated homes by its own map, faster than real time. Prints a Markdown page.

mod drive;
mod judge;
mod table;

use crate::seeds::Seeds;
use drive::{Case, explore, reference};
use std::path::PathBuf;

/// Explore random homes by the estimated map, judged against the truth
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Seeds of the homes: tune on 1-20, report on 101-110
    #[arg(long, default_value = "101-110")]
    seeds: Seeds,
    /// Rings of so many sensors
    #[arg(long, value_delimiter = ',', default_value = "8,16,32")]
    rings: Vec<u8>,
    /// A drive is ended after so many seconds of robot time
    #[arg(long, default_value_t = 2400.0)]
    limit: f64,
    /// Write the page to this file instead of standard output
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print what each robot does on standard error
    #[arg(long)]
    verbose: bool,
    /// Write each map to this folder, as PGM
    #[arg(long)]
    maps: Option<PathBuf>,
    /// Do not drive by the truth, too
    #[arg(long)]
    alone: bool,
}

pub(crate) fn run(options: &Options) {
    let mut rows = Vec::new();
    for &sensors in &options.rings {
        for seed in options.seeds.0.clone() {
            let case = Case { seed, sensors, limit_s: options.limit };
            let outcome = explore(case, options.verbose);
            if let Some(folder) = &options.maps {
                table::picture(&outcome.raster, &outcome.trail, &folder.join(format!("{sensors}-{seed}.pgm")));
            }
            let reference = (!options.alone).then(|| reference(case, outcome.time_s));
            eprintln!("{}", table::line(case, &outcome, reference.as_ref()));
            rows.push((case, outcome, reference));
        }
    }
    let page = table::page(options, &rows);
    match &options.out {
        Some(path) => std::fs::write(path, page).expect("the page can be written"),
        None => print!("{page}"),
    }
}
