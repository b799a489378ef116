//! The program: see [`slamd::cli`].

fn main() -> std::process::ExitCode {
    slamd::cli::main()
}
