//! Sources of the configuration, and `slamd config`, which shows it.
//!
//! A robot's configuration: the defaults, then files, then environment variables, then the command line; later sources override earlier ones.
//! A recording's: what the recording holds, or one file alone, so that a replay is the same on every machine.

mod files;
mod variables;

pub(super) use variables::{OPTIONS, unknown};

use super::{Failure, Kind, terminal};
use clap::{Args, Subcommand, ValueEnum};
use slamd_capture::CaptureInfo;
use slamd_core::{
    Config, ConfigError, Method,
    config::{Effective, Layers},
};
use slamd_files::regular;
use std::path::{Path, PathBuf};

/// Options of the estimator.
#[derive(Debug, Args)]
pub(crate) struct HowArgs {
    /// Estimation method for heading, position and map. The default is the configuration's `method`, or walls if it names none.
    #[arg(long, value_enum)]
    method: Option<MethodArg>,
    /// Robot configuration (TOML), see configs/README.md. The default is slamd/slamd.toml in XDG_CONFIG_HOME or /etc/slamd/slamd.toml if it
    /// exists, and for a capture the configuration that it holds.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum MethodArg {
    Walls,
    Paper,
}

impl From<MethodArg> for Method {
    fn from(arg: MethodArg) -> Self {
        match arg {
            MethodArg::Walls => Self::Walls,
            MethodArg::Paper => Self::Paper,
        }
    }
}

impl HowArgs {
    /// The configuration for a robot, from all sources.
    pub(super) fn of_robot(&self) -> Result<Config, Failure> {
        Ok(self.effective()?.config)
    }

    /// The configuration for a recording, with the method of the command line.
    pub(super) fn of_recording(&self, info: &CaptureInfo, capture: &Path) -> Result<Config, Failure> {
        let config = of_replay(self.config.as_deref(), info, capture)?;
        Ok(Config { method: self.method.map_or(config.method, Method::from), ..config })
    }

    /// The configuration file of the command line.
    pub(super) fn named(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    /// The configuration files of a robot.
    pub(super) fn files_of_robot(&self) -> Result<Vec<PathBuf>, Failure> {
        files::files(self.named(), &files::default_paths())
    }

    fn effective(&self) -> Result<Effective, Failure> {
        let mut layers = robot_layers(self.config.as_deref())?;
        if let Some(method) = self.method.and_then(|method| method.to_possible_value()) {
            layers.value("--method", "method", method.get_name());
        }
        Ok(layers.finish()?)
    }
}

/// The configuration for a robot, from all sources; `named` is the file from the command line.
pub(super) fn of_robot(named: Option<&Path>) -> Result<Config, Failure> {
    Ok(robot_layers(named)?.finish()?.config)
}

/// The configuration for a recording: from the file `named`, or else from the capture.
pub(super) fn of_recording(named: Option<&Path>, info: &CaptureInfo, capture: &Path) -> Result<Config, Failure> {
    let Some(named) = named else {
        return Config::from_toml(&info.config_toml).map_err(|error| {
            let text = format!("{}: its configuration: {error}; name another with --config", capture.display());
            Failure::new(Kind::Data, text)
        });
    };
    read(named)
}

/// The same for a replay, where no board takes a setting: of these, the recording's own hold, whose answers it has.
pub(super) fn of_replay(named: Option<&Path>, info: &CaptureInfo, capture: &Path) -> Result<Config, Failure> {
    let mut config = of_recording(named, info, capture)?;
    if named.is_some() {
        config.board = Config::from_toml(&info.config_toml).map(|recorded| recorded.board).unwrap_or_default();
    }
    Ok(config)
}

/// The configuration from files and environment variables.
fn robot_layers(named: Option<&Path>) -> Result<Layers, Failure> {
    let (mut layers, mut read) = (Layers::default(), Vec::new());
    for path in files::files(named, &files::default_paths())? {
        layers.text(Some(&path.display().to_string()), &text(&path)?);
        read.push(path.display().to_string());
    }
    for variable in variables::variables(std::env::vars_os())? {
        layers.value(&variable.name, &variable.key, &variable.value);
        read.push(variable.name);
    }
    if !read.is_empty() {
        tracing::info!("configuration: {}", read.join(", "));
    }
    Ok(layers)
}

/// A configuration from one file alone.
pub(super) fn read(path: &Path) -> Result<Config, Failure> {
    let mut layers = Layers::default();
    layers.text(Some(&path.display().to_string()), &text(path)?);
    Ok(layers.finish()?.config)
}

/// Largest configuration file.
const MAX_BYTES: u64 = 64 << 10;

fn text(path: &Path) -> Result<String, Failure> {
    let name = path.display();
    regular::read_text(path, MAX_BYTES).map_err(|error| match error.kind() {
        std::io::ErrorKind::InvalidData => Failure::new(Kind::Config, format!("{name}: it is no text in UTF-8")),
        _ => Failure::new(Kind::NoInput, format!("{name}: {error}; name a file that can be read")),
    })
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Self::new(Kind::Config, error.to_string())
    }
}

const EXAMPLES: &str = "Examples:
  slamd config show                with the source of each value
  slamd config check robot.toml && scp robot.toml robot:/etc/slamd/slamd.toml
  SLAMD_ROBOT__WHEEL_BASE_M=0.3 slamd config show --config robot.toml";

/// Show and check the configuration.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ConfigCommand {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Print the configuration of `slamd run` as TOML, with the source behind each value that is not the default.
    Show(HowArgs),
    /// Check each named file by itself, or without one everything that `slamd run` would read; print all errors. Exit code 78 if there is one.
    Check {
        /// Configurations (TOML).
        #[arg(value_name = "FILE")]
        files: Vec<PathBuf>,
    },
    /// Print the JSON Schema of the configuration, with the range of each value.
    #[cfg(feature = "manual")]
    Schema,
}

impl ConfigCommand {
    pub(super) fn run(self) -> Result<(), Failure> {
        match self.what {
            What::Show(args) => {
                let text = args.effective()?.to_toml();
                terminal::say(text.trim_end());
                Ok(())
            }
            What::Check { files } if files.is_empty() => {
                let layers = robot_layers(None)?;
                layers.finish()?;
                let named = named_sources();
                terminal::say(if named.is_empty() {
                    "ok: the defaults; there is no file in ~/.config/slamd or /etc/slamd, and no variable is set".into()
                } else {
                    format!("ok: {}", named.join(", "))
                });
                Ok(())
            }
            What::Check { files } => check(&files),
            #[cfg(feature = "manual")]
            What::Schema => {
                let schema = serde_json::to_string_pretty(&slamd_core::config::schema());
                terminal::say(schema.map_err(|error| Failure::new(Kind::Data, error.to_string()))?);
                Ok(())
            }
        }
    }
}

/// What a checked file sets, for people.
fn contents(config: &Config) -> String {
    let text = config.to_toml_differences();
    let values = text.lines().filter(|line| line.contains(" = ")).count();
    match values {
        0 => "every value is the default".into(),
        1 => "1 value differs from the default".into(),
        _ => format!("{values} values differ from the defaults"),
    }
}

/// The files and variables that a robot's configuration comes from.
fn named_sources() -> Vec<String> {
    let files = files::files(None, &files::default_paths()).unwrap_or_default();
    let files = files.iter().map(|path| path.display().to_string());
    let variables = variables::variables(std::env::vars_os()).unwrap_or_default();
    files.chain(variables.into_iter().map(|variable| variable.name)).collect()
}

/// Checks each file; the failure lists the errors of all files.
fn check(files: &[PathBuf]) -> Result<(), Failure> {
    let mut failures: Vec<Failure> = Vec::new();
    for path in files {
        match read(path) {
            Ok(config) => terminal::say(format_args!("{}: ok, {}", path.display(), contents(&config))),
            Err(failure) => failures.push(failure),
        }
    }
    let Some(first) = failures.first() else { return Ok(()) };
    let is_wrong = failures.iter().any(|failure| failure.kind == Kind::Config);
    let kind = if is_wrong { Kind::Config } else { first.kind };
    let texts: Vec<String> = failures.iter().map(Failure::to_string).collect();
    Err(Failure::new(kind, texts.join("\n")))
}
