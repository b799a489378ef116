//! `slamd completions` and `slamd man`: files that a package of slamd installs.

use super::outputs::ForceArg;
use super::{Failure, Kind, terminal};
use clap::{Args, Command};
use clap_complete::Shell;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

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
        terminal::put(&script);
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
    #[command(flatten)]
    force: ForceArg,
}

impl ManArgs {
    /// Writes the pages; `program` is slamd's complete command line.
    pub(super) fn run(self, program: Command) -> Result<(), Failure> {
        let name = self.out.display();
        let failure = |error: std::io::Error| {
            Failure::new(Kind::CantCreate, format!("{name}: {error}; choose a folder that can be written with --out"))
        };
        let made = tempfile::tempdir().map_err(failure)?;
        clap_mangen::generate_to(program, made.path())
            .and_then(|()| examples_as_written(made.path()))
            .map_err(failure)?;
        std::fs::create_dir_all(&self.out).map_err(failure)?;
        let mut guard = self.force.guard();
        let mut pages = Vec::new();
        for entry in std::fs::read_dir(made.path()).map_err(failure)? {
            let page = entry.map_err(failure)?;
            let output = guard.output_replacing(&self.out.join(page.file_name()), is_page_of_slamd)?;
            pages.push((output, std::fs::read(page.path()).map_err(failure)?));
        }
        for (output, page) in pages {
            let path = output.path().to_owned();
            output.write(&page)?;
            // Everybody may read a manual.
            std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o644)).map_err(failure)?;
        }
        terminal::say(self.out.join("slamd.1").display());
        Ok(())
    }
}

/// A larger page is another program's.
const MAX_PAGE_BYTES: u64 = 1 << 20;

/// True if an earlier slamd has written the page: it can be made again.
fn is_page_of_slamd(path: &Path) -> bool {
    slamd_files::regular::read_text(path, MAX_PAGE_BYTES)
        .is_ok_and(|page| page.lines().take(5).any(|line| line.starts_with(".TH slamd")))
}

/// Names the section of the examples in each page, and keeps their lines as they are.
fn examples_as_written(folder: &Path) -> std::io::Result<()> {
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
        let text = examples.trim_end().trim_start_matches("Examples:").trim_start_matches('\n');
        // What follows the examples is text, which the reader's terminal wraps.
        let (examples, words) = text.split_once("\n\n").unwrap_or((text, ""));
        let paragraphs = words.split("\n\n").filter(|words| !words.is_empty());
        let words: String = paragraphs.map(|words| format!(".PP\n{}\n", words.trim())).collect();
        std::fs::write(&path, format!("{before}.SH EXAMPLES\n.nf\n{examples}\n.fi\n{words}{after}"))?;
    }
    Ok(())
}
