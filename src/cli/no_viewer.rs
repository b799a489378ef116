//! `--viewer` in builds without the viewer: it takes `off`, so that scripts and services work with every build.

use clap::Args;

/// Viewer options of a build without viewers.
#[derive(Debug, Args)]
pub(super) struct NoViewerArgs {
    /// This build has no viewer: only `off` is possible.
    #[arg(long, value_name = "off", value_parser = off)]
    viewer: Option<String>,
}

fn off(text: &str) -> Result<String, String> {
    if text == "off" {
        return Ok(text.into());
    }
    Err("this build of slamd has no viewer: give `off`, or build it without --no-default-features".into())
}

impl NoViewerArgs {
    /// Nothing is shown, whatever the option says.
    pub(super) const fn is_any() -> bool {
        false
    }
}
