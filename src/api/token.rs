//! The token that authenticates a client.

use sha2::{Digest as _, Sha256};
use slamd_files::private;
use std::fmt;
use std::path::{Path, PathBuf};
use subtle::ConstantTimeEq as _;

/// A token; only its digest is kept.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Token([u8; 32]);

/// A token file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub struct TokenError {
    /// The file.
    pub path: PathBuf,
    /// Why, and what to do about it.
    pub cause: String,
}

/// Length limits, characters: a shorter token could be guessed.
const MIN_LENGTH: usize = 16;
const MAX_LENGTH: usize = 1_024;

impl Token {
    /// Reads a token file: its first line is the token.
    ///
    /// # Errors
    /// When the file cannot be read, when other users may read it, or when it holds no token.
    pub fn read(path: &Path) -> Result<Self, TokenError> {
        let failure = |cause: String| TokenError { path: path.into(), cause };
        let line = private::first_line(path).map_err(failure)?;
        let word = line.trim();
        if !(MIN_LENGTH..=MAX_LENGTH).contains(&word.len()) || !word.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(failure(format!(
                "its first line must be {MIN_LENGTH} to {MAX_LENGTH} printable ASCII characters; make one with `openssl rand -hex 32`"
            )));
        }
        Ok(Self::new(word))
    }

    /// The token of this text.
    #[must_use]
    pub fn new(word: &str) -> Self {
        Self(Sha256::digest(word.as_bytes()).into())
    }

    /// True if `word` is the token. The comparison takes constant time.
    #[must_use]
    pub fn is(&self, word: &str) -> bool {
        self.0.ct_eq(&Self::new(word).0).into()
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{Permissions, set_permissions, write};
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn a_file_for_its_owner_alone_holds_the_token() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        let read = |text: &str, mode| {
            write(&path, text).unwrap();
            set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            Token::read(&path)
        };
        let token = read("0123456789abcdef\nnot this\n", 0o600).unwrap();
        assert!(token.is("0123456789abcdef") && !token.is("0123456789abcdeF") && !token.is(""));
        let message = |text: &str, mode| read(text, mode).unwrap_err().to_string();
        assert!(message("0123456789abcdef", 0o640).contains("chmod 600"));
        assert!(message("short", 0o600).contains("openssl rand -hex 32"));
        assert!(message("0123456789 abcdef", 0o600).contains("printable"));
        assert!(Token::read(&folder.path().join("none")).unwrap_err().to_string().contains("name a file"));
    }
}
