//! The version of the protocol, and the check of the board's version.

/// The major version. The host rejects a board with another one: see
/// [`crate::Hello::check_version`].
pub const VERSION_MAJOR: u8 = 1;

/// The minor version. It grows with each appended field or added message and never makes a board
/// incompatible.
pub const VERSION_MINOR: u8 = 1;

/// The board speaks another major version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VersionError {
    /// The board's version is older.
    #[error("the board speaks protocol {board}, slamd speaks {VERSION_MAJOR}: update the board's firmware")]
    BoardIsOlder {
        /// The board's major version.
        board: u8,
    },
    /// The host's version is older.
    #[error("the board speaks protocol {board}, slamd speaks {VERSION_MAJOR}: update slamd")]
    HostIsOlder {
        /// The board's major version.
        board: u8,
    },
}

/// Accepts only [`VERSION_MAJOR`].
pub(crate) fn check(board: u8) -> Result<(), VersionError> {
    match board.cmp(&VERSION_MAJOR) {
        core::cmp::Ordering::Less => Err(VersionError::BoardIsOlder { board }),
        core::cmp::Ordering::Equal => Ok(()),
        core::cmp::Ordering::Greater => Err(VersionError::HostIsOlder { board }),
    }
}
