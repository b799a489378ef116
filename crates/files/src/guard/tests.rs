use super::*;
use std::os::unix::fs::{PermissionsExt as _, symlink};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("drive.csv"), "input").unwrap();
        fs::write(folder.path().join("old.mcap"), "old").unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn guard(&self, force: bool) -> OutputGuard {
        OutputGuard::new(force).reads(&self.path("drive.csv"))
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }
}

#[test]
fn an_input_is_never_written_whatever_it_is_called() {
    let folder = Folder::new();
    symlink("drive.csv", folder.path("link")).unwrap();
    fs::hard_link(folder.path("drive.csv"), folder.path("hard")).unwrap();
    fs::create_dir(folder.path("sub")).unwrap();
    for name in ["drive.csv", "link", "hard", "sub/../drive.csv", "./drive.csv"] {
        for force in [false, true] {
            let refusal = folder.guard(force).output(&folder.path(name)).unwrap_err();
            assert!(refusal.is_usage() && refusal.to_string().contains("would be written over"), "{refusal}");
        }
    }
    let refusal = folder.guard(true).check_folder(folder.0.path(), &["map.png", "drive.csv"]).unwrap_err();
    assert!(matches!(refusal, Refusal::Input(_)));
}

#[test]
fn an_existing_file_is_kept_unless_forced() {
    let folder = Folder::new();
    let old = folder.path("old.mcap");
    assert!(matches!(folder.guard(false).output(&old), Err(Refusal::Exists(_))));
    symlink("nowhere", folder.path("dangling")).unwrap();
    assert!(matches!(folder.guard(false).output(&folder.path("dangling")), Err(Refusal::Exists(_))));
    let own = folder.guard(false).output_replacing(&old, |path| path.ends_with("old.mcap"));
    own.unwrap().write(b"own").unwrap();
    assert_eq!(folder.text("old.mcap"), "own");
    folder.guard(true).output(&old).unwrap().write(b"forced").unwrap();
    assert_eq!(folder.text("old.mcap"), "forced");
    fs::set_permissions(&old, fs::Permissions::from_mode(0o444)).unwrap();
    assert!(matches!(folder.guard(true).output(&old), Err(Refusal::ReadOnly(_))));
}

#[test]
fn folders_missing_folders_and_second_uses_are_named() {
    let folder = Folder::new();
    fs::create_dir(folder.path("dir")).unwrap();
    let mut guard = folder.guard(true);
    for name in ["dir", "new/"] {
        assert!(matches!(guard.output(&folder.path(name)), Err(Refusal::Folder(_))), "{name}");
    }
    let missing = guard.output(&folder.path("nowhere/x")).unwrap_err();
    assert!(!missing.is_usage() && missing.to_string().contains("nowhere/x: No such file"), "{missing}");
    assert!(guard.output(&folder.path("old.mcap/x")).unwrap_err().to_string().contains("Not a directory"));
    let mut coming = folder.guard(false).fills(&folder.path("a/out"), &["map.png"]);
    coming.output(&folder.path("a/home.session")).unwrap();
    assert!(coming.output(&folder.path("b/home.session")).is_err());
    guard.output(&folder.path("new")).unwrap();
    assert!(matches!(guard.output(&folder.path("dir/../new")), Err(Refusal::Twice(_))));
}

#[test]
fn pipes_sockets_and_devices_are_named_and_never_opened() {
    let folder = Folder::new();
    rustix::fs::mkfifoat(rustix::fs::CWD, folder.path("pipe"), rustix::fs::Mode::RWXU).unwrap();
    let _socket = std::os::unix::net::UnixListener::bind(folder.path("socket")).unwrap();
    symlink("/dev/zero", folder.path("zero")).unwrap();
    symlink("pipe", folder.path("link")).unwrap();
    for (name, what) in [
        ("pipe", "pipe is a pipe, not a file"),
        ("link", "link is a pipe, not a file"),
        ("socket", "socket is a socket, not a file"),
        ("zero", "zero is a device, not a file"),
        ("/dev/null", "/dev/null is a device, not a file"),
    ] {
        let path = folder.path(name);
        let mut guard = folder.guard(true);
        let refusals = [
            guard.output(&path).map(drop),
            guard.output_replacing(&path, |_| panic!("it is read")).map(drop),
            guard.check(&path),
            guard.claim(&path),
            guard.check_folder(folder.0.path(), &["map.png", name]),
        ];
        for refusal in refusals {
            let refusal = refusal.unwrap_err();
            assert!(refusal.to_string().contains(what) && !refusal.is_usage(), "{refusal}");
        }
    }
    folder.guard(false).check_name(&folder.path("socket")).unwrap();
    symlink("nowhere", folder.path("dangling")).unwrap();
    folder.guard(true).check_folder(folder.0.path(), &["dangling", "old.mcap"]).unwrap();
    fs::create_dir(folder.path("map.svg")).unwrap();
    let refusal = folder.guard(true).check_folder(folder.0.path(), &["map.svg"]).unwrap_err();
    assert!(refusal.to_string().contains("map.svg is a folder, not a file"), "{refusal}");
}

#[test]
fn a_claimed_name_is_no_other_outputs() {
    let folder = Folder::new();
    let mut guard = folder.guard(true).fills(&folder.path("a/out"), &["map.png"]);
    for name in ["old.mcap", "a/out/drive.mcap", "drive.csv"] {
        guard.claim(&folder.path(name)).unwrap();
        assert!(matches!(guard.claim(&folder.path(name)), Err(Refusal::Twice(_))), "{name}");
    }
    for name in ["./old.mcap", "a/out/map.png", "a/./out/map.png"] {
        assert!(matches!(guard.output(&folder.path(name)), Err(Refusal::Twice(_))), "{name}");
    }
    guard.output(&folder.path("a/out/other.session")).unwrap();
}

#[test]
fn numbered_files_are_no_other_outputs() {
    let folder = Folder::new();
    let mut guard = folder.guard(true);
    guard.claim_series(folder.0.path(), ["drive-".into(), ".mcap".into()]);
    let mut is_taken = |name: &str| matches!(guard.output(&folder.path(name)), Err(Refusal::Twice(_)));
    assert!(["drive-0002.mcap", "./drive-0003.mcap", "drive-10-0004.mcap"].into_iter().all(&mut is_taken));
    assert!(!["drive-2.session", "drive-a.mcap", "my-drive-0002.mcap"].into_iter().any(is_taken));
}

#[test]
fn a_file_that_appears_meanwhile_is_kept() {
    let folder = Folder::new();
    let mut file = folder.guard(false).output(&folder.path("new")).unwrap().begin().unwrap();
    file.append(b"ours");
    fs::write(folder.path("new"), "theirs").unwrap();
    let error = file.finish().unwrap_err();
    assert!(error.to_string().ends_with("new: File exists (os error 17)"), "{error}");
    assert_eq!(folder.text("new"), "theirs");
    assert_eq!(fs::read_dir(folder.0.path()).unwrap().count(), 3, "no half file is left");
}
