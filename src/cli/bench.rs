//! `slamd bench`

use super::outputs::ForceArg;
use super::{Failure, Kind, MethodArg, terminal};
use clap::{Args, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use slamd_core::Method;
use slamd_eval::bench::case::{Case, Choice, Table};
use slamd_eval::bench::fleet::drive_all;
use slamd_eval::bench::{paper, report, table};
use slamd_files::{Output, OutputGuard, Refusal, regular};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct BenchArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Accuracy, faults, map, consistency and speed over many simulated drives.
    Accuracy(AccuracyArgs),
    /// The paper's experiment with its method: figures 1-5, processing time, where it works and where it fails.
    Paper(PaperArgs),
}

#[derive(Debug, Args)]
struct PaperArgs {
    /// Folder for the pictures; the page is written to the file of the same name with .md.
    #[arg(long, value_name = "DIR", default_value = "docs/paper")]
    out: PathBuf,
    /// Seeds of the table's simulations; the figures always use seed 101.
    #[arg(long, value_name = "FIRST-LAST", default_value = "101-110", value_parser = seeds)]
    seeds: Seeds,
    #[command(flatten)]
    force: ForceArg,
}

#[derive(Debug, Args)]
struct AccuracyArgs {
    /// KEY=VALUE[,VALUE...] of world, beam, faults, sensors, odometry; `all` is every value. With --table it filters the rows; without,
    /// every combination is a row. A world may be a TOML file.
    #[arg(value_name = "KEY=VALUE")]
    choices: Vec<Choice>,
    /// A set of rows.
    #[arg(long)]
    table: Option<TableArg>,
    /// Seeds of the simulations. Tune on 1-20, report on 101-120.
    #[arg(long, value_name = "FIRST-LAST", default_value = "101-120", value_parser = seeds)]
    seeds: Seeds,
    /// Length of each drive.
    #[arg(long, value_name = "SECONDS", default_value = "300", value_parser = super::seconds)]
    seconds: f64,
    /// How heading, position and map are found.
    #[arg(long, value_enum, default_value = "walls")]
    method: MethodArg,
    /// Also write the tables to this Markdown file. A page that this command wrote before is replaced; text after its line "<!-- by hand -->" is kept.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: ForceArg,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TableArg {
    /// Three worlds under usual conditions.
    Usual,
    /// The conditions of the project's targets.
    Issue,
    /// All combinations: takes hours.
    Grid,
}

#[derive(Clone, Debug)]
struct Seeds(std::ops::RangeInclusive<u64>);

fn seeds(text: &str) -> Result<Seeds, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let seed =
        |text: &str| text.parse().map_err(|_| format!("\"{text}\" is not a seed; give FIRST-LAST such as 101-120"));
    let seeds = seed(first)?..=seed(last)?;
    if seeds.is_empty() {
        Err(format!("\"{text}\" is an empty range; give FIRST-LAST such as 101-120"))
    } else {
        Ok(Seeds(seeds))
    }
}

impl BenchArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        match self.what {
            What::Accuracy(args) => args.run(),
            What::Paper(args) => args.run(),
        }
    }
}

impl AccuracyArgs {
    fn run(self) -> Result<(), Failure> {
        let table = self.table.map(|table| match table {
            TableArg::Usual => Table::Usual,
            TableArg::Issue => Table::Issue,
            TableArg::Grid => Table::Grid,
        });
        let method = Method::from(self.method);
        let mut cases = Case::rows(table, &self.choices);
        for case in &mut cases {
            (case.seconds, case.method) = (self.seconds.max(MIN_SECONDS), method);
        }
        let seeds: Vec<u64> = self.seeds.0.clone().collect();
        let mut guard = self.force.guard();
        let output = self.out.as_deref().map(|path| output(&mut guard, path)).transpose()?;
        let bar = bar(cases.len() * seeds.len());
        let runs = drive_all(&cases, &seeds, |case, run| {
            // With -v.
            if tracing::enabled!(tracing::Level::DEBUG) {
                bar.suspend(|| super::terminal::tell(table::run_line(case, run)));
            }
            bar.inc(1);
        });
        bar.finish_and_clear();
        let runs = runs.map_err(|error| Failure::new(Kind::NoInput, error))?;
        if let Some(output) = output {
            let before = regular::read_text(output.path(), MAX_PAGE_BYTES).unwrap_or_default();
            write(output, report::document(&command(), &cases, &runs, &before).as_bytes())?;
        }
        terminal::say(report::tables(&cases, &runs));
        Ok(())
    }
}

impl PaperArgs {
    fn run(self) -> Result<(), Failure> {
        let seeds: Vec<u64> = self.seeds.0.clone().collect();
        let bar = bar(paper::cases().len() * seeds.len());
        let folder = self.out.file_name().unwrap_or_default().to_string_lossy();
        let mut guard = self.force.guard();
        let markdown = output(&mut guard, &self.out.with_extension("md"))?;
        let page =
            paper::page(&seeds, &folder, &command(), || bar.inc(1)).map_err(|error| failure(&self.out, &error))?;
        bar.finish_and_clear();
        // The pictures belong to the page: where that may be replaced, they may.
        let is_own = markdown.path().exists();
        std::fs::create_dir_all(&self.out).map_err(|error| failure(&self.out, &error))?;
        let outputs: Result<Vec<Output>, Refusal> =
            page.pictures.iter().map(|(name, _)| guard.output_replacing(&self.out.join(name), |_| is_own)).collect();
        for (output, (_, png)) in outputs?.into_iter().zip(&page.pictures) {
            write(output, png)?;
        }
        write(markdown, page.markdown.as_bytes())?;
        terminal::say(self.out.with_extension("md").display());
        Ok(())
    }
}

/// A page, with missing folders above it. One that `slamd bench` wrote is replaced.
fn output(guard: &mut OutputGuard, path: &Path) -> Result<Output, Failure> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    std::fs::create_dir_all(folder).map_err(|error| failure(path, &error))?;
    let is_own = |path: &Path| {
        let text = regular::read_text(path, MAX_PAGE_BYTES).unwrap_or_default();
        text.lines().take(HEAD_LINES).any(|line| line.starts_with("Written by `slamd bench "))
    };
    Ok(guard.output_replacing(path, is_own)?)
}

/// A larger page is another program's.
const MAX_PAGE_BYTES: u64 = 16 << 20;
/// The command stands in the first lines of each page.
const HEAD_LINES: usize = 10;

fn write(output: Output, bytes: &[u8]) -> Result<(), Failure> {
    output.write(bytes).map_err(|error| Failure::new(Kind::CantCreate, error.to_string()))
}

fn failure(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(Kind::CantCreate, format!("{}: {error}", path.display()))
}

/// The command line as given, for the head of the written file.
fn command() -> String {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    format!("slamd {}", arguments.join(" "))
}

fn bar(drives: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} drives, {eta} left");
    ProgressBar::new(drives as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Shortest drive, seconds: the handshake with the board takes some time.
const MIN_SECONDS: f64 = 10.0;
