//! What coverage-guided fuzzing found: one file for each target in `fuzz/found/`, of inputs that each follow on their length in four bytes,
//! little end first.

use std::path::PathBuf;

fn path(target: &str) -> PathBuf {
    crate::root().join("fuzz/found").join(target)
}

/// The inputs kept for a target; none where none were found.
///
/// # Panics
/// Where the file ends in the middle of an input.
pub fn found(target: &str) -> Vec<Vec<u8>> {
    let bytes = std::fs::read(path(target)).unwrap_or_default();
    let (mut rest, mut inputs) = (&bytes[..], Vec::new());
    while let Some((length, behind)) = rest.split_first_chunk::<4>() {
        let (input, behind) = behind.split_at(u32::from_le_bytes(*length) as usize);
        inputs.push(input.to_vec());
        rest = behind;
    }
    assert!(rest.is_empty(), "fuzz/found/{target} is damaged");
    inputs
}

/// Keeps these inputs for a target. Bytes of the file.
///
/// # Panics
/// Where `fuzz/` cannot be written.
pub fn keep(target: &str, inputs: &[Vec<u8>]) -> usize {
    let mut bytes = Vec::new();
    for input in inputs {
        bytes.extend(u32::try_from(input.len()).expect("an input is short").to_le_bytes());
        bytes.extend(input);
    }
    let path = path(target);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("fuzz/ can be written");
    std::fs::write(path, &bytes).expect("fuzz/ can be written");
    bytes.len()
}
