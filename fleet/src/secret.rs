//! Password files, which only their owner may read.

use slamd_files::private;
use std::path::{Path, PathBuf};

/// A file of passwords that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub struct SecretError {
    path: PathBuf,
    cause: String,
}

/// Minimum length. A shorter password can be guessed from one recorded login.
const SHORTEST: usize = 16;
const LONGEST: usize = 1_024;
const HOW: &str = "16 to 1,024 printable ASCII characters, as `openssl rand -hex 32` makes them";

/// The password in a file: its first line.
///
/// # Errors
/// Where it cannot be read, others than its owner may read it, or it holds no password.
pub fn password(path: &Path) -> Result<String, SecretError> {
    let text = read(path)?;
    let word = text.lines().next().unwrap_or_default().trim();
    if is_password(word) { Ok(word.into()) } else { Err(error(path, format!("its first line must be {HOW}"))) }
}

/// The users in a file of lines `NAME:PASSWORD`.
///
/// # Errors
/// As [`password`], with the line.
pub fn users(path: &Path) -> Result<Vec<String>, SecretError> {
    let text = read(path)?;
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let user = |(place, line): (usize, &str)| match line.trim().split_once(':') {
        Some((user, word)) if is_password(word.trim()) => Ok(user.trim().to_owned()),
        // The line itself is not repeated: logs are read by others.
        _ => Err(error(path, format!("line {} must be NAME:PASSWORD, the password {HOW}", place + 1))),
    };
    let users: Vec<String> = lines.map(user).collect::<Result<_, _>>()?;
    if users.is_empty() {
        Err(error(path, "it names nobody: a line for each robot, NAME:PASSWORD".into()))
    } else {
        Ok(users)
    }
}

fn read(path: &Path) -> Result<String, SecretError> {
    private::secret(path).map_err(|cause| error(path, cause))
}

fn is_password(word: &str) -> bool {
    (SHORTEST..=LONGEST).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_graphic())
}

fn error(path: &Path, cause: String) -> SecretError {
    SecretError { path: path.into(), cause }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{Permissions, set_permissions, write};
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn a_file_for_its_owner_alone_holds_passwords() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("users");
        let put = |text: &str, mode| {
            write(&path, text).unwrap();
            set_permissions(&path, Permissions::from_mode(mode)).unwrap();
        };
        put("kitchen:0123456789abcdef\n\nattic: fedcba9876543210\n", 0o600);
        assert_eq!(users(&path).unwrap(), ["kitchen", "attic"]);
        put("0123456789abcdef\n", 0o600);
        assert_eq!(password(&path).unwrap(), "0123456789abcdef");
        assert!(users(&path).unwrap_err().to_string().contains("line 1"));
        put("0123456789abcdef\n", 0o640);
        assert!(password(&path).unwrap_err().to_string().contains("chmod 600"));
        put("kitchen:short\n", 0o600);
        let said = users(&path).unwrap_err().to_string();
        assert!(said.contains("openssl") && !said.contains("short"), "{said}");
        put("\n", 0o600);
        assert!(users(&path).unwrap_err().to_string().contains("nobody"));
    }
}
