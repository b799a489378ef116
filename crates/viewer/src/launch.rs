//! Finds and starts the installed viewer.

use std::net::{Ipv4Addr, TcpListener};
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// The path of the viewer on this machine.
#[derive(Clone, Debug)]
pub struct Installed(PathBuf);

/// A started viewer. Dropping it ends the viewer and its child processes.
#[derive(Debug)]
pub struct Opened(Child);

impl Installed {
    /// The first `rerun` on the PATH.
    #[must_use]
    pub fn find() -> Option<Self> {
        let path = std::env::var_os("PATH")?;
        let is_program =
            |file: &PathBuf| file.metadata().is_ok_and(|it| it.is_file() && it.permissions().mode() & 0o111 != 0);
        std::env::split_paths(&path).map(|folder| folder.join("rerun")).find(is_program).map(Self)
    }

    /// Opens a window that shows the server at `url`. It stays open when the session ends.
    ///
    /// # Errors
    /// When the viewer cannot be started.
    pub(super) fn window(&self, url: &str) -> std::io::Result<()> {
        // Without a free port it would take our server for another viewer and send the data there.
        self.open(&["--port", "auto", "--hide-welcome-screen", "--memory-limit", "2GB", url]).map(drop)
    }

    /// Starts its web server on this machine, for the data served at `url`. Returns the link to open and the page's port.
    ///
    /// # Errors
    /// When the viewer cannot be started.
    pub(super) fn web(&self, url: &str) -> std::io::Result<(Opened, String, u16)> {
        let (page, proxy) = (free_port()?, free_port()?);
        let (page_port, proxy_port) = (page.to_string(), proxy.to_string());
        let ports = ["--web-viewer-port", &page_port, "--port", &proxy_port];
        let child = self.open(&[&["--serve-web", "--bind", "127.0.0.1"][..], &ports, &[url]].concat())?;
        let target = url.replace('+', "%2B");
        Ok((Opened(child), format!("http://127.0.0.1:{page}?url={target}&hide_welcome_screen=1"), page))
    }

    /// Starts the viewer in a process group of its own, so that the terminal's Ctrl-C does not end it.
    fn open(&self, arguments: &[&str]) -> std::io::Result<Child> {
        let mut command = Command::new(&self.0);
        command
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        // The `rerun` of the Python package is a script that runs the viewer in the same group.
        if let Ok(id) = i32::try_from(self.0.id())
            && let Some(group) = rustix::process::Pid::from_raw(id)
        {
            let _ = rustix::process::kill_process_group(group, rustix::process::Signal::TERM);
        }
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// True if a display is available.
#[must_use]
pub fn has_display() -> bool {
    ["DISPLAY", "WAYLAND_DISPLAY"].into_iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()))
}

fn free_port() -> std::io::Result<u16> {
    Ok(TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?.port())
}
