//! The message types. The host's types have the high bit set, so the host detects a line that
//! echoes.

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident = $code:literal,)*) => {
        $($(#[$doc])* pub const $name: u8 = $code;)*

        /// The name of a message type in the specification; `None` if this version does not know
        /// the type.
        #[must_use]
        pub const fn name(kind: u8) -> Option<&'static str> {
            match kind {
                $($code => Some(stringify!($name)),)*
                _ => None,
            }
        }
    };
}

kinds! {
    /// Board: its identity.
    HELLO = 0x01,
    /// Board: where the sensors sit.
    GEOMETRY = 0x02,
    /// Board: the echoes of one group.
    SONAR = 0x10,
    /// Board: the wheel encoders.
    ENCODER = 0x11,
    /// Board: its health.
    STATUS = 0x12,
    /// Board: a sensor failed or recovered.
    FAULT = 0x13,
    /// Board: what its motors do.
    MOTION = 0x14,
    /// Board: the answer to a TIME_REQUEST.
    TIME_RESPONSE = 0x20,
    /// Board: the result of a command.
    ACK = 0x30,
    /// Board: the value of a configuration key.
    CONFIG_VALUE = 0x31,
    /// Board: a line of text for the user.
    LOG = 0x3F,
    /// Host: asks for HELLO.
    HELLO_REQUEST = 0x81,
    /// Host: starts the firing.
    START = 0x82,
    /// Host: stops the firing.
    STOP = 0x83,
    /// Host: sets a configuration key.
    CONFIG_SET = 0x84,
    /// Host: asks for the value of a configuration key.
    CONFIG_GET = 0x85,
    /// Host: asks for GEOMETRY.
    GEOMETRY_REQUEST = 0x86,
    /// Host: the wheels' speeds, for a short time.
    DRIVE = 0x87,
    /// Host: asks for the board's time.
    TIME_REQUEST = 0x90,
    /// Host: says that it is there, so that a board that drives goes on.
    HEARTBEAT = 0x91,
}
