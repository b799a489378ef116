//! Why the payload of a good frame was rejected.

/// The payload of a frame is invalid for its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// The other side is newer: count the frame and continue.
    #[error("message type {0:#04x} is unknown")]
    UnknownType(u8),
    /// The payload has the wrong length.
    #[error("payload of {message} has {got} bytes, expected {expected}")]
    Length {
        /// The message's name.
        message: &'static str,
        /// The payload's length.
        got: usize,
        /// The valid lengths.
        expected: &'static str,
    },
    /// A field has an invalid value.
    #[error("{field} is {got}, expected {expected}")]
    Value {
        /// The field and its message.
        field: &'static str,
        /// The field's value.
        got: i32,
        /// The valid values.
        expected: &'static str,
    },
    /// GEOMETRY places sensors that the ring does not have.
    #[error("GEOMETRY places {count} sensors from {first} on, expected at most {total} in all")]
    BeyondRing {
        /// The first sensor that it places.
        first: u8,
        /// How many sensors it places.
        count: usize,
        /// The number of sensors of the ring.
        total: u8,
    },
}
