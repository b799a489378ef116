//! What the help says beside the options themselves: examples, groups, short options. In one place, so that all commands have them.

use clap::Command;

/// Examples of the commands whose own file has none.
const EXAMPLES: &[(&str, &str)] = &[
    (
        "replay",
        "  slamd replay drive.mcap                      map.png and more in slamd-out/
  slamd replay drive.mcap --config robot.toml  not as it was recorded
  slamd replay recordings/ -o maps             all captures of a folder
  slamd replay drive.mcap --json | jq .map_m2",
    ),
    (
        "simulate",
        "  slamd simulate --world flat --duration 120 --capture drive.mcap
  slamd simulate --world random --seed 7 --sensors 8 --capture home.mcap
  slamd simulate --fault 3:stuck@20 --fault 9:noisy@0 --capture faults.mcap
  slamd simulate --pty board & slamd --port board    no board needed
  slamd simulate --robot-fault wheels-swapped --robot-fault ticks=2 \\
      --pty crossed & slamd setup --port crossed",
    ),
    (
        "import ring",
        "  slamd import ring drive.csv --config robot.toml --capture drive.mcap
  slamd replay drive.mcap",
    ),
    (
        "import carmen",
        "  slamd import carmen robot.log --config robot.toml --capture drive.mcap
  slamd replay drive.mcap",
    ),
    (
        "import bag",
        "  slamd import bag rosbag2_drive/ --config robot.toml --capture drive.mcap
  slamd replay drive.mcap",
    ),
    (
        "calibrate",
        "  slamd --port auto --record drive.mcap       two minutes between walls
  slamd calibrate drive.mcap --out robot.toml
  slamd --port auto --config robot.toml",
    ),
    (
        "inspect",
        "  slamd inspect drive.mcap
  slamd inspect drive.mcap --json | jq '.frames, .refusals'",
    ),
    ("bench", "  slamd bench accuracy --seeds 101-105\n  slamd bench paper --out paper"),
    (
        "bench accuracy",
        "  slamd bench accuracy --seeds 101-105 -v    a line about each drive\n  slamd bench accuracy world=random sensors=8 faults=none",
    ),
    ("bench paper", "  slamd bench paper --out paper"),
    ("config show", "  slamd config show\n  slamd config show --config robot.toml"),
    (
        "config check",
        "  slamd config check robot.toml\n  slamd config check               all that `slamd run` would read",
    ),
    ("config schema", "  slamd config schema > slamd.schema.json"),
];

/// Groups of options, in the order of the help. The others stand first.
const GROUPS: &[(&str, &[&str])] = &[
    ("Port", &["baud", "exit_on_hangup", "realtime"]),
    ("Robot", &["config", "method"]),
    ("Output", &["out", "json", "viewer", "expose_viewer"]),
    ("Recording", &["record", "record_minutes", "record_mib", "record_keep", "record_free_mib"]),
    ("Saved map and calibration", &["resume", "localize", "save_session", "session", "save_calibration"]),
    (
        "Other programs",
        &[
            "listen",
            "socket",
            "metrics",
            "token_file",
            "drive",
            "drive_token_file",
            "mqtt",
            "mqtt_user",
            "mqtt_password_file",
        ],
    ),
    ("Log", &["log_format", "verbose", "quiet"]),
];
/// The commands with enough options for groups.
const GROUPED: &[&str] = &["run", "monitor", "replay"];

/// The command line with its examples, groups and short options.
pub(super) fn dressed(program: Command) -> Command {
    let names: Vec<String> = program.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    let log = group("log_format");
    let program = ["log_format", "verbose", "quiet"]
        .into_iter()
        .fold(program, |program, id| program.mut_arg(id, |arg| arg.help_heading(log)));
    names
        .into_iter()
        .fold(program, |program, name| program.mut_subcommand(name.clone(), |command| dress(command, &name)))
}

fn dress(mut command: Command, path: &str) -> Command {
    if let Some((_, examples)) = EXAMPLES.iter().find(|(of, _)| *of == path) {
        command = command.after_help(format!("Examples:\n{examples}"));
    }
    let ids: Vec<String> = command.get_arguments().map(|arg| arg.get_id().to_string()).collect();
    for id in ids {
        command = command.mut_arg(id.clone(), |mut arg| {
            if id == "out" && arg.get_short().is_none() {
                arg = arg.short('o');
            }
            if GROUPED.contains(&path) { arg.help_heading(group(&id)) } else { arg }
        });
    }
    let names: Vec<String> = command.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    names.into_iter().fold(command, |command, name| {
        command.mut_subcommand(name.clone(), |inner| dress(inner, &format!("{path} {name}")))
    })
}

/// The group of an option.
fn group(id: &str) -> Option<&'static str> {
    GROUPS.iter().find(|(_, ids)| ids.contains(&id)).map(|(name, _)| *name)
}

#[cfg(test)]
mod tests {
    /// Each command that does something, and its help.
    fn helps(command: &clap::Command, path: &str, found: &mut Vec<(String, String)>) {
        for inner in command.get_subcommands() {
            let path = format!("{path} {}", inner.get_name());
            let help = inner.get_after_help().map(ToString::to_string).unwrap_or_default();
            found.push((path.clone(), help));
            helps(inner, &path, found);
        }
    }

    #[test]
    fn every_command_has_examples_that_name_it() {
        let mut found = Vec::new();
        helps(&super::super::command(), "slamd", &mut found);
        assert!(found.len() > 15);
        for (path, help) in found {
            // `run` is the command that need not be named.
            let named = if path == "slamd run" { "slamd --port" } else { path.as_str() };
            assert!(help.starts_with("Examples:\n") && help.contains(named), "{path}: {help}");
        }
    }

    #[test]
    fn the_options_of_run_are_grouped() {
        let mut program = super::super::command();
        program.build();
        let help = program.find_subcommand_mut("run").expect("run").render_long_help().to_string();
        let headings: Vec<&str> = help.lines().filter(|line| line.ends_with(':') && !line.starts_with(' ')).collect();
        for (name, _) in super::GROUPS {
            assert!(headings.contains(&format!("{name}:").as_str()), "{name} is missing in {headings:?}");
        }
        assert!(help.contains("-o, --out <DIR>") && help.contains("[default: slamd-out]"), "{help}");
    }
}
