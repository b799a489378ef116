//! The message types. Those of the host have the high bit, so that a line that echoes shows.

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident = $code:literal,)*) => {
        $($(#[$doc])* pub const $name: u8 = $code;)*

        /// The name of a message type in the specification; `None` where this version does not know it.
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
    /// Board: who I am.
    HELLO = 0x01,
    /// Board: where the sensors sit.
    GEOMETRY = 0x02,
    /// Board: the echoes of one group.
    SONAR = 0x10,
    /// Board: the wheels.
    ENCODER = 0x11,
    /// Board: how I fare.
    STATUS = 0x12,
    /// Board: a sensor broke or recovered.
    FAULT = 0x13,
    /// Board: the answer to a TIME_REQUEST.
    TIME_RESPONSE = 0x20,
    /// Board: what became of a command.
    ACK = 0x30,
    /// Board: the value of a configuration key.
    CONFIG_VALUE = 0x31,
    /// Board: a line of text for people.
    LOG = 0x3F,
    /// Host: who are you?
    HELLO_REQUEST = 0x81,
    /// Host: begin to fire.
    START = 0x82,
    /// Host: cease to fire.
    STOP = 0x83,
    /// Host: give a configuration key a value.
    CONFIG_SET = 0x84,
    /// Host: what is the value of a configuration key?
    CONFIG_GET = 0x85,
    /// Host: where do the sensors sit?
    GEOMETRY_REQUEST = 0x86,
    /// Host: what time is it?
    TIME_REQUEST = 0x90,
    /// Host: I am here and have nothing else to say.
    HEARTBEAT = 0x91,
}
