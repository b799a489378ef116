//! Who gets in, and what a robot may do: only what lies below its own key.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_fleet::clock::wait;
use slamd_fleet::fleet_file::FleetFile;
use slamd_fleet::name::Name;
use slamd_fleet::network::{Endpoint, connect, listen};
use std::fs::{Permissions, set_permissions, write};
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use zenoh::{Config, Session, Wait as _};

const SECRETS: [(&str, &str); 2] = [("attic", "0123456789abcdef0123"), ("kitchen", "fedcba9876543210fedc")];

struct Site {
    folder: tempfile::TempDir,
    at: Endpoint,
    address: String,
    has_users: bool,
    hub: Session,
    heard: Arc<Mutex<Vec<String>>>,
}

fn secret(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    write(&path, text).unwrap();
    set_permissions(&path, Permissions::from_mode(0o600)).unwrap();
    path
}

impl Site {
    /// A hub on loopback that listens to both robots.
    fn new(has_users: bool) -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let address = format!("tcp/127.0.0.1:{port}");
        let (at, folder) = (address.parse::<Endpoint>().unwrap(), tempfile::tempdir().unwrap());
        let lines: String = SECRETS.iter().map(|(name, word)| format!("{name}:{word}\n")).collect();
        let users = secret(folder.path(), "users", &lines);
        let fleet = FleetFile::from_toml("[robots.attic]\n[robots.kitchen]").unwrap();
        let hub = listen(&at, &"home".parse().unwrap(), &fleet, has_users.then_some(users.as_path())).unwrap();
        let heard = Arc::<Mutex<Vec<String>>>::default();
        for (robot, _) in SECRETS {
            let heard = Arc::clone(&heard);
            let hear = move |sample: zenoh::sample::Sample| {
                let text = sample.payload().try_to_string().unwrap().into_owned();
                heard.lock().unwrap().push(format!("{} {text}", sample.key_expr()));
            };
            hub.declare_subscriber(format!("slamd/home/{robot}/*")).callback(hear).background().wait().unwrap();
        }
        Self { folder, at, address, has_users, hub, heard }
    }

    fn robot(&self, name: &str) -> Session {
        let word = SECRETS.iter().find(|(known, _)| *known == name).unwrap().1;
        let password = secret(self.folder.path(), name, word);
        let password = self.has_users.then_some(password.as_path());
        connect(&self.at, &name.parse::<Name>().unwrap(), password).unwrap()
    }

    fn heard(&self) -> Vec<String> {
        let mut heard = self.heard.lock().unwrap().clone();
        heard.sort();
        heard.dedup();
        heard
    }
}

/// What the kitchen's robot tries, more than once, for links take a moment.
fn try_to_write_everywhere(robot: &Session) {
    for _ in 0..10 {
        for key in ["slamd/home/kitchen/pose", "slamd/home/attic/pose", "slamd/home/attic/status"] {
            robot.put(key, "kitchen").wait().unwrap();
        }
        wait(Duration::from_millis(100));
    }
}

#[test]
fn a_robot_writes_below_its_own_key_alone() {
    let open = Site::new(false);
    try_to_write_everywhere(&open.robot("kitchen"));
    let everything =
        ["slamd/home/attic/pose kitchen", "slamd/home/attic/status kitchen", "slamd/home/kitchen/pose kitchen"];
    assert_eq!(open.heard(), everything, "without rules all of it passes, so the rules are what is tested");

    let closed = Site::new(true);
    try_to_write_everywhere(&closed.robot("kitchen"));
    assert_eq!(closed.heard(), ["slamd/home/kitchen/pose kitchen"]);
}

fn answers(session: &Session, key: &str) -> Vec<String> {
    let answers = session.get(key).timeout(Duration::from_secs(2)).wait().unwrap();
    let text = |reply: zenoh::query::Reply| {
        reply.into_result().ok().map(|sample| sample.payload().try_to_string().unwrap().into_owned())
    };
    std::iter::from_fn(|| answers.recv().ok()).filter_map(text).collect()
}

fn answer(session: &Session, key: &'static str, words: &'static str) {
    let answer = move |query: zenoh::query::Query| drop(query.reply(key, words).wait());
    session.declare_queryable(key).callback(answer).background().wait().unwrap();
}

#[test]
fn robots_cannot_answer_for_others_and_only_the_hub_can_query() {
    for (has_users, for_kitchen) in [(false, vec!["attic's lie", "kitchen's own"]), (true, vec!["kitchen's own"])] {
        let site = Site::new(has_users);
        let (kitchen, attic) = (site.robot("kitchen"), site.robot("attic"));
        answer(&kitchen, "slamd/home/kitchen/map", "kitchen's own");
        answer(&attic, "slamd/home/kitchen/map", "attic's lie");
        answer(&attic, "slamd/home/attic/map", "attic's own");
        wait(Duration::from_millis(700));
        let all = |session: &Session| {
            let replies = session.get("slamd/home/kitchen/map").target(zenoh::query::QueryTarget::All);
            let replies = replies
                .consolidation(zenoh::query::ConsolidationMode::None)
                .timeout(Duration::from_secs(2))
                .wait()
                .unwrap();
            let mut words: Vec<String> = std::iter::from_fn(|| replies.recv().ok())
                .filter_map(|reply| Some(reply.into_result().ok()?.payload().try_to_string().unwrap().into_owned()))
                .collect();
            words.sort();
            words
        };
        assert_eq!(all(&site.hub), for_kitchen, "asked by the hub, users: {has_users}");
        let neighbour = answers(&kitchen, "slamd/home/attic/map");
        assert_eq!(neighbour, if has_users { vec![] } else { vec!["attic's own".to_owned()] }, "asked by the kitchen");
    }
}

#[test]
fn a_wrong_password_or_none_gets_no_connection() {
    let site = Site::new(true);
    let try_once = |credentials: &str| {
        let text = format!(
            r#"{{ mode: "client", connect: {{ endpoints: ["{}"], timeout_ms: 0 }}, scouting: {{ multicast: {{ enabled: false }} }}, {credentials} }}"#,
            site.address
        );
        zenoh::open(Config::from_json5(&text).unwrap()).wait().is_ok()
    };
    let user = |user: &str, word: &str| {
        try_once(&format!(r#"transport: {{ auth: {{ usrpwd: {{ user: "{user}", password: "{word}" }} }} }}"#))
    };
    assert!(user("kitchen", SECRETS[1].1), "the right one does");
    assert!(!user("kitchen", SECRETS[0].1), "another robot's does not");
    assert!(!user("cellar", SECRETS[1].1), "nor does a stranger's");
    assert!(!try_once(""), "nor none");
}
