//! Relative paths.

use std::path::{Component, Path, PathBuf};

/// `path` relative to `folder` if both exist, with `/` as separator; otherwise unchanged.
pub(super) fn path_in_study(path: &Path, folder: &Path) -> String {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let seen = match (path.canonicalize(), folder.canonicalize()) {
        (Ok(path), Ok(folder)) => relative(&path, &folder),
        _ => None,
    };
    let seen = seen.unwrap_or_else(|| path.to_owned());
    seen.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/")
}

fn relative(path: &Path, folder: &Path) -> Option<PathBuf> {
    let (to, from): (Vec<Component<'_>>, Vec<Component<'_>>) =
        (path.components().collect(), folder.components().collect());
    let shared = to.iter().zip(&from).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return None;
    }
    let up = from[shared..].iter().map(|_| Component::ParentDir);
    Some(up.chain(to[shared..].iter().copied()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_go_up_and_down() {
        let seen = |path: &str, folder: &str| relative(Path::new(path), Path::new(folder)).unwrap();
        assert_eq!(seen("/a/b/c.csv", "/a/b"), Path::new("c.csv"));
        assert_eq!(seen("/a/b/c.csv", "/a/d/e"), Path::new("../../b/c.csv"));
        assert_eq!(path_in_study(Path::new("nowhere/x.csv"), Path::new("nor_here")), "nowhere/x.csv");
    }
}
