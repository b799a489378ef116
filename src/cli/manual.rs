//! `slamd completions` and `slamd man`: files that a package of slamd installs.

use super::{Failure, Kind, terminal};
use clap::{Args, Command};
use clap_complete::Shell;
use std::io::Write as _;
use std::path::PathBuf;

const COMPLETIONS: &str = "Examples:
  slamd completions bash > /usr/share/bash-completion/completions/slamd
  slamd completions zsh > /usr/share/zsh/vendor-completions/_slamd
  slamd completions fish > ~/.config/fish/completions/slamd.fish";

/// Print a shell's completion script for slamd.
#[derive(Debug, Args)]
#[command(after_help = COMPLETIONS)]
pub(super) struct CompletionsArgs {
    /// The shell.
    shell: Shell,
}

impl CompletionsArgs {
    /// Prints the script; `program` is slamd's complete command line.
    pub(super) fn run(self, mut program: Command) {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut program, "slamd", &mut script);
        // A closed pipe is no failure.
        let _ = std::io::stdout().write_all(&script);
    }
}

const MAN: &str = "Examples:
  slamd man --out /usr/local/share/man/man1 && man slamd-run
  slamd man --out man && man -l man/slamd.1";

/// Write manual pages, one for each command.
#[derive(Debug, Args)]
#[command(after_help = MAN)]
pub(super) struct ManArgs {
    /// Folder for the pages, created if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl ManArgs {
    /// Writes the pages; `program` is slamd's complete command line.
    pub(super) fn run(self, program: Command) -> Result<(), Failure> {
        let written = std::fs::create_dir_all(&self.out)
            .and_then(|()| clap_mangen::generate_to(program, &self.out))
            .and_then(|()| examples_as_written(&self.out));
        let name = self.out.display();
        written.map_err(|error| {
            Failure::new(Kind::CantCreate, format!("{name}: {error}; choose a folder that can be written with --out"))
        })?;
        terminal::say(self.out.join("slamd.1").display());
        Ok(())
    }
}

/// Names the section of the examples in each page, and keeps their lines as they are.
fn examples_as_written(folder: &std::path::Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let is_ours = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("slamd"));
        if !is_ours || path.extension().is_none_or(|extension| extension != "1") {
            continue;
        }
        let page = std::fs::read_to_string(&path)?;
        let Some((before, extra)) = page.split_once(".SH EXTRA\n") else { continue };
        let (examples, after) = match extra.split_once("\n.SH ") {
            Some((examples, after)) => (examples, format!(".SH {after}")),
            None => (extra, String::new()),
        };
        let examples = examples.trim_end().trim_start_matches("Examples:").trim_start_matches('\n');
        std::fs::write(&path, format!("{before}.SH EXAMPLES\n.nf\n{examples}\n.fi\n{after}"))?;
    }
    Ok(())
}
