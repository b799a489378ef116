//! The files of a robot's configuration.

use crate::cli::{Failure, Kind};
use std::path::{Path, PathBuf};

/// The default paths of a configuration: the user's, then the system's.
pub(super) fn default_paths() -> Vec<PathBuf> {
    let folder = |variable: &str| std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute());
    let user = folder("XDG_CONFIG_HOME").or_else(|| Some(folder("HOME")?.join(".config")));
    let folders = user.into_iter().chain(["/etc".into()]);
    folders.map(|folder| folder.join("slamd/slamd.toml")).collect()
}

/// The named file, or else the first default path that exists; then the `*.toml` files of `config.d` beside it, in the order of their names.
///
/// # Errors
/// When a path or folder cannot be read.
pub(super) fn files(named: Option<&Path>, paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let Some(first) = named.map_or_else(|| first(paths), |named| Ok(Some(named.into())))? else {
        return Ok(Vec::new());
    };
    let folder = first.with_file_name("config.d");
    let mut files = match std::fs::read_dir(&folder) {
        Ok(entries) => entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<PathBuf>>>(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(error),
    }
    .map_err(|error| unreadable(&folder, &error))?;
    files.retain(|path| is_configuration(path));
    files.sort();
    files.insert(0, first);
    Ok(files)
}

fn first(paths: &[PathBuf]) -> Result<Option<PathBuf>, Failure> {
    for path in paths {
        if path.try_exists().map_err(|error| unreadable(path, &error))? {
            return Ok(Some(path.clone()));
        }
    }
    Ok(None)
}

/// Files with a leading dot are left out: editors leave such files behind.
fn is_configuration(path: &Path) -> bool {
    let is_hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    !is_hidden && path.extension().is_some_and(|extension| extension == "toml")
}

fn unreadable(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(Kind::NoInput, format!("{}: {error}; let this user read it", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_existing_path_is_used_and_its_folder_follows_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let paths = [path("home/slamd/slamd.toml"), path("etc/slamd/slamd.toml")];
        assert_eq!(files(None, &paths).unwrap(), [""; 0].map(PathBuf::from));
        for name in
            ["config.d/20-wheels.toml", "config.d/3.toml", "config.d/readme.md", "config.d/.#3.toml", "slamd.toml"]
        {
            let path = path("etc/slamd").join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let system =
            ["slamd.toml", "config.d/20-wheels.toml", "config.d/3.toml"].map(|name| path("etc/slamd").join(name));
        assert_eq!(files(None, &paths).unwrap(), system);
        // A folder without the file beside it is ignored.
        std::fs::create_dir_all(path("home/slamd/config.d")).unwrap();
        assert_eq!(files(None, &paths).unwrap(), system);
        std::fs::write(path("home/slamd/slamd.toml"), "").unwrap();
        assert_eq!(files(None, &paths).unwrap(), [path("home/slamd/slamd.toml")]);
        assert_eq!(files(Some(Path::new("robot.toml")), &paths).unwrap(), [PathBuf::from("robot.toml")]);
    }
}
