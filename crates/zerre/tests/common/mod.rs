//! What several test binaries share.

use std::path::PathBuf;

/// A file of the real recordings, which lie beside the repository in `shared/data` or where `ZERRE_DATA` says. Where
/// there is none the test says so and passes, except in CI (`CI=true`): there it fails.
pub fn recording(relative: &str) -> Option<PathBuf> {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let path = std::env::var_os("ZERRE_DATA").map_or_else(beside, PathBuf::from).join(relative);
    if path.is_file() {
        return Some(path);
    }
    assert!(std::env::var("CI").as_deref() != Ok("true"), "no recording at {}", path.display());
    eprintln!("skipped: no recording at {} (set ZERRE_DATA)", path.display());
    None
}
