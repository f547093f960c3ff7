//! Where results go and where settings come from.

use std::env;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use super::finding::Finding;
use super::system::free_bytes;

/// A minute of raw packets in dual return mode is about 110 MB: this is ten minutes and a map.
const SPACE_WANTED: u64 = 2 << 30;
/// No configuration file is larger, bytes.
const LARGEST_CONFIG: u64 = 1 << 20;

pub(super) fn check() -> Vec<Finding> {
    let mut findings = vec![disk_space(), writable()];
    findings.extend(configuration());
    findings
}

fn disk_space() -> Finding {
    const NAME: &str = "disk space here";
    let Some(free) = free_bytes(Path::new(".")) else {
        return Finding::ok(NAME, "this system does not say");
    };
    let what = format!("{:.1} GB free", free as f64 * 1e-9);
    if free >= SPACE_WANTED {
        Finding::ok(NAME, what)
    } else {
        Finding::warn(NAME, what, "free some space, or give --out on another disk")
    }
}

fn writable() -> Finding {
    const NAME: &str = "writing here";
    let folder = env::current_dir().unwrap_or_else(|_| PathBuf::from("."));
    let probe = folder.join(format!(".hachi-doctor-{}", std::process::id()));
    let written = File::options().write(true).create_new(true).open(&probe);
    match written {
        Ok(_) => {
            let _ = fs::remove_file(&probe);
            Finding::ok(NAME, format!("allowed in {}", folder.display()))
        }
        Err(error) => Finding::warn(
            NAME,
            format!("not possible in {}: {error}", folder.display()),
            "give --out in a folder you may write to",
        ),
    }
}

/// Configuration files where hachi and its users keep them.
pub(super) fn configuration_files() -> Vec<PathBuf> {
    let mut folders = vec![PathBuf::from("config"), PathBuf::from("/etc/hachi")];
    if let Some(home) = env::var_os("XDG_CONFIG_HOME") {
        folders.push(Path::new(&home).join("hachi"));
    } else if let Some(home) = env::var_os("HOME") {
        folders.push(Path::new(&home).join(".config/hachi"));
    }
    let mut files: Vec<PathBuf> = [PathBuf::from("hachi.toml")]
        .into_iter()
        .filter(|path| path.is_file())
        .collect();
    for folder in folders {
        let entries = fs::read_dir(&folder).into_iter().flatten().flatten();
        let paths = entries.map(|entry| entry.path());
        let mut inside: Vec<PathBuf> = paths
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .collect();
        inside.sort();
        files.extend(inside);
    }
    files
}

/// Each configuration file, read and checked to be TOML.
fn configuration() -> Vec<Finding> {
    const NAME: &str = "configuration";
    let files = configuration_files();
    if files.is_empty() {
        return vec![Finding::ok(
            NAME,
            "no file found: built-in settings are used",
        )];
    }
    let finding = |path: &PathBuf| match read_toml(path) {
        Ok(()) => Finding::ok(NAME, path.display().to_string()),
        Err(reason) => Finding::warn(
            NAME,
            format!("{}: {reason}", path.display()),
            "mend or remove that file",
        ),
    };
    files.iter().map(finding).collect()
}

fn read_toml(path: &Path) -> Result<(), String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let mut text = String::new();
    file.take(LARGEST_CONFIG + 1)
        .read_to_string(&mut text)
        .map_err(|error| error.to_string())?;
    if text.len() as u64 > LARGEST_CONFIG {
        return Err("larger than 1 MiB".to_owned());
    }
    match text.parse::<toml::Table>() {
        Ok(_) => Ok(()),
        Err(error) => {
            let line = error.span().map_or(0, |span| {
                let before = text.get(..span.start).unwrap_or_default();
                before.matches('\n').count() + 1
            });
            Err(format!("line {line}: {}", error.message()))
        }
    }
}
