//! The machine that a figure was measured on.

/// The processor by its own name; in words where the system does not tell.
#[must_use]
pub fn cpu() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| "an unnamed processor".into(), |(_, name)| name.trim().into())
}
