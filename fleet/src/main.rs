//! `slamd-fleet`: see [`slamd_fleet::cli`].

fn main() -> std::process::ExitCode {
    slamd_fleet::cli::main()
}
