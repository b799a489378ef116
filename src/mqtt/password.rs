//! The broker's password: read from a file, never shown.

use slamd_files::private;
use std::fmt;
use std::path::{Path, PathBuf};

/// A password; its debug form hides it.
#[derive(Clone)]
pub struct Password(String);

/// A password file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub struct PasswordError {
    /// The file.
    pub path: PathBuf,
    /// Why, and what to do about it.
    pub cause: String,
}

impl Password {
    /// Reads a password file: its first line is the password.
    ///
    /// # Errors
    /// When the file cannot be read, when other users may read it, or when its first line is empty.
    pub fn read(path: &Path) -> Result<Self, PasswordError> {
        let failure = |cause: String| PasswordError { path: path.into(), cause };
        let line = private::first_line(path).map_err(failure)?;
        if line.is_empty() {
            return Err(failure("its first line is empty: write the password into it".into()));
        }
        Ok(Self(line))
    }

    /// The password itself, for the broker.
    pub(super) fn reveal(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Password {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Password")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{Permissions, set_permissions, write};
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn a_file_for_its_owner_alone_holds_the_password() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("password");
        let read = |text: &str, mode| {
            write(&path, text).unwrap();
            set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            Password::read(&path)
        };
        let password = read("let me in \nnot this\n", 0o600).unwrap();
        assert_eq!((password.reveal(), format!("{password:?}").as_str()), ("let me in ", "Password"));
        assert!(read("secret", 0o644).unwrap_err().to_string().contains("chmod 600"));
        assert!(read("\n", 0o600).unwrap_err().to_string().contains("empty"));
        assert!(Password::read(&folder.path().join("none")).unwrap_err().to_string().contains("name a file"));
    }
}
