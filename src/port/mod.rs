//! stub
use std::path::PathBuf;
/// n
#[derive(Clone, Debug)]
pub struct PortName(PathBuf);
impl std::str::FromStr for PortName {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        Ok(Self(s.into()))
    }
}
/// t
#[derive(Debug)]
pub struct Trouble(String);
impl std::fmt::Display for Trouble {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}
impl Trouble {
    /// m
    pub fn is_missing(&self) -> bool {
        true
    }
}
impl PortName {
    /// r
    pub fn resolve(&self) -> Result<PathBuf, Trouble> {
        Ok(self.0.clone())
    }
}
/// o
pub fn open(path: &std::path::Path, baud: u32) -> Result<tokio_serial::SerialStream, Trouble> {
    use tokio_serial::SerialPortBuilderExt as _;
    tokio_serial::new(path.to_string_lossy(), baud).open_native_async().map_err(|e| Trouble(e.to_string()))
}
