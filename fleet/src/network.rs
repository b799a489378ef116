//! Zenoh as the fleet uses it: explicit endpoints, no multicast scouting, no gossip, and passwords and
//! access rules beyond loopback.

use crate::acl::access_control;
use crate::clock::wait;
use crate::failure::{Failure, Kind};
use crate::fleet_file::FleetFile;
use crate::name::Name;
use crate::secret;
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use zenoh::{Config, Session, Wait as _};

/// An address to listen on or to connect to: `tcp/HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint(String);

/// Lease of a link without messages, milliseconds.
const LEASE_MS: u64 = 3_000;
/// Period of reconnecting, milliseconds.
const RETRY_MS: u64 = 1_000;
const PATIENCE: Duration = Duration::from_secs(10);

impl FromStr for Endpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let address = text.strip_prefix("tcp/").and_then(|address| address.rsplit_once(':'));
        let is_good = address.is_some_and(|(host, port)| {
            let known = |byte: u8| byte.is_ascii_alphanumeric() || b".:[]-_%".contains(&byte);
            !host.is_empty() && host.bytes().all(known) && port.parse::<u16>().is_ok()
        });
        if is_good { Ok(Self(text.into())) } else { Err("it must be tcp/HOST:PORT, as tcp/192.0.2.1:7447".into()) }
    }
}

impl Endpoint {
    /// True for an address that only this machine reaches; a name may be any.
    fn is_loopback(&self) -> bool {
        let address = self.0.strip_prefix("tcp/").unwrap_or_default();
        address.parse::<SocketAddr>().is_ok_and(|address| address.ip().is_loopback())
    }
}

/// Opens the hub's side: listens.
///
/// # Errors
/// Where more than this machine could come in without a password, or the address cannot be listened at.
pub fn listen(at: &Endpoint, site: &Name, fleet: &FleetFile, users: Option<&Path>) -> Result<Session, Failure> {
    if users.is_none() && !at.is_loopback() {
        let text = format!(
            "--listen {} accepts anyone on this machine's network: give --users a file with one line NAME:PASSWORD per robot, as \
             `(umask 077; echo \"kitchen:$(openssl rand -hex 32)\" >> users)` makes it, or listen on tcp/127.0.0.1:7447 and connect through `ssh -L`",
            at.0
        );
        return Err(Failure::new(Kind::Usage, text));
    }
    let mut config = common("router")?;
    set(&mut config, "listen/endpoints", &json!([at.0]))?;
    if let Some(path) = users {
        check_users(path, fleet)?;
        set(&mut config, "transport/auth/usrpwd/dictionary_file", &json!(path))?;
        set(&mut config, "access_control", &access_control(site, fleet.robots().keys()))?;
    }
    open(config, || format!("{} cannot be listened at; is another hub running?", at.0))
}

/// Opens a robot's side: waits until the hub is there, and connects again whenever it was lost.
///
/// # Errors
/// Where the password's file cannot be used.
pub fn connect(to: &Endpoint, robot: &Name, password: Option<&Path>) -> Result<Session, Failure> {
    let mut config = common("client")?;
    set(&mut config, "connect/endpoints", &json!([to.0]))?;
    set(&mut config, "connect/timeout_ms", &json!(-1))?;
    set(&mut config, "connect/exit_on_failure", &json!(false))?;
    let retry = json!({ "period_init_ms": RETRY_MS, "period_max_ms": RETRY_MS, "period_increase_factor": 1 });
    set(&mut config, "connect/retry", &retry)?;
    if let Some(path) = password {
        let password = secret::password(path).map_err(|error| Failure::new(Kind::Config, error.to_string()))?;
        set(&mut config, "transport/auth/usrpwd/user", &json!(robot))?;
        set(&mut config, "transport/auth/usrpwd/password", &json!(password))?;
    }
    let is_connected = Arc::<AtomicBool>::default();
    warn_once(to.clone(), Arc::clone(&is_connected));
    let session = open(config, || format!("{} cannot be connected to", to.0));
    is_connected.store(true, Ordering::Release);
    session
}

/// Logs once that there is still no connection.
fn warn_once(to: Endpoint, is_connected: Arc<AtomicBool>) {
    std::thread::spawn(move || {
        wait(PATIENCE);
        if !is_connected.load(Ordering::Acquire) {
            let words = "is the hub there, and is the password the one in its --users, for this robot's name?";
            tracing::warn!("still not connected to {}, and trying on: {words}", to.0);
        }
    });
}

/// Every robot needs a password, and a password without a robot is a mistake.
fn check_users(path: &Path, fleet: &FleetFile) -> Result<(), Failure> {
    let users = secret::users(path).map_err(|error| Failure::new(Kind::Config, error.to_string()))?;
    let missing = fleet.robots().keys().find(|robot| !users.iter().any(|user| user == robot.as_ref()));
    let stranger = users.iter().find(|user| !fleet.robots().keys().any(|robot| robot.as_ref() == **user));
    match (missing, stranger) {
        (Some(robot), _) => Err(Failure::new(
            Kind::Config,
            format!("{}: no line for {robot}, which is in the fleet file", path.display()),
        )),
        (None, Some(_)) => Err(Failure::new(
            Kind::Config,
            format!("{}: a line for a user who is not in the fleet file", path.display()),
        )),
        (None, None) => Ok(()),
    }
}

/// What both sides have in common.
fn common(mode: &str) -> Result<Config, Failure> {
    let mut config = Config::default();
    set(&mut config, "mode", &json!(mode))?;
    set(&mut config, "listen/endpoints", &json!([]))?;
    set(&mut config, "scouting/multicast/enabled", &json!(false))?;
    set(&mut config, "scouting/gossip/enabled", &json!(false))?;
    set(&mut config, "transport/link/tx/lease", &json!(LEASE_MS))?;
    Ok(config)
}

fn set(config: &mut Config, key: &str, value: &Value) -> Result<(), Failure> {
    let text = value.to_string();
    // The value may hold a password: it is not repeated.
    config
        .insert_json5(key, &text)
        .map_err(|_| Failure::new(Kind::Config, format!("Zenoh does not take its setting {key}")))
}

fn open(config: Config, what: impl Fn() -> String) -> Result<Session, Failure> {
    zenoh::open(config).wait().map_err(|error| Failure::new(Kind::Unavailable, format!("{}: {error}", what())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{Permissions, set_permissions, write};
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn endpoints_are_explicit() {
        for bad in
            ["", "127.0.0.1:7447", "udp/224.0.0.224:7446", "tcp/host", "tcp/host:x", "tcp/:1", "tcp/a:1#iface=eth0"]
        {
            assert!(bad.parse::<Endpoint>().is_err(), "{bad}");
        }
        let is_loopback = |text: &str| text.parse::<Endpoint>().unwrap().is_loopback();
        assert!(is_loopback("tcp/127.0.0.1:7447") && is_loopback("tcp/[::1]:7447"));
        assert!(
            !is_loopback("tcp/0.0.0.0:7447") && !is_loopback("tcp/[::]:7447") && !is_loopback("tcp/localhost:7447")
        );
    }

    #[test]
    fn access_without_a_password_is_refused() {
        let (site, fleet) = ("home".parse().unwrap(), FleetFile::from_toml("[robots.kitchen]\n[robots.hall]").unwrap());
        let everywhere = "tcp/0.0.0.0:0".parse().unwrap();
        let failure = |users: Option<&Path>| listen(&everywhere, &site, &fleet, users).unwrap_err();
        assert_eq!(failure(None).kind, Kind::Usage);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("users");
        let said = |text: &str| {
            write(&path, text).unwrap();
            set_permissions(&path, Permissions::from_mode(0o600)).unwrap();
            failure(Some(&path)).to_string()
        };
        assert!(said("kitchen:0123456789abcdef\n").contains("no line for hall"));
        let three = "kitchen:0123456789abcdef\nhall:0123456789abcdef\nx:0123456789abcdef\n";
        assert!(said(three).contains("not in the fleet file"));
    }
}
