//! Atomic replacement of all files of one result: `docs/decisions/0017-output-sets.md`.

use crate::error::Error;
use dynident_system::{TemporaryFolder, names, remove_folder};
use std::fs::{self, File};
use std::io;
use std::path::{Component, Path, PathBuf};
use std::time::Duration;

const STAGE_PREFIX: &str = ".dynident-set-";
/// Subfolders of a stage: new files, old files, and the final content of each file's place for either case.
const NEW: &str = "new";
const OLD: &str = "old";
const PLACE_NEW: &str = "place-new";
const PLACE_OLD: &str = "place-old";
/// Links at the places of the files; they lead through [`CURRENT`].
const LINKS: &str = "links";
/// A link to [`OLD`], later to [`NEW`]: changing this link switches all files in a single step.
const CURRENT: &str = "current";
const NEXT: &str = "next";
const NAMES: &str = "names";
/// On file systems without links: the old files, and a marker that all of them have been moved, so that the new files
/// can be moved to their places.
const MOVED: &str = "moved";
const DECIDED: &str = "decided";
/// Subfolders of a stage that contain files under the names of the set.
const PARTS: [&str; 6] = [NEW, OLD, PLACE_NEW, PLACE_OLD, LINKS, MOVED];
const MAX_NAMES_BYTES: u64 = 1 << 20;

/// Maximum waiting time for another program that writes a set to the same folder.
const LOCK_TIMEOUT: Duration = Duration::from_secs(20);
const LOCK_RETRY_INTERVAL: Duration = Duration::from_millis(20);

/// The files of one result in a folder. Other files in the folder are not changed.
///
/// At every moment, also after a kill or with a full disk, readers find the files of one set, either the old or the
/// new one. On a file system without links (FAT; Windows without the right to create them) a kill can leave an
/// incomplete set, but never a mixture of two sets; the next write cleans up.
#[derive(Clone, Debug)]
pub struct OutputSet {
    folder: PathBuf,
    files: Vec<(String, Option<Vec<u8>>)>,
}

impl OutputSet {
    /// Creates an empty set for a folder, which need not exist.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), files: Vec::new() }
    }

    /// Adds a file; `name` may contain subfolders (`study/arm.toml`).
    #[must_use]
    pub fn file(mut self, name: &str, contents: impl Into<Vec<u8>>) -> Self {
        self.files.push((name.to_owned(), Some(contents.into())));
        self
    }

    /// Marks a file that other sets contain and this set does not: an older file with this name is removed.
    #[must_use]
    pub fn absent(mut self, name: &str) -> Self {
        self.files.push((name.to_owned(), None));
        self
    }

    /// Replaces the old set.
    ///
    /// # Errors
    /// [`Error::Output`] with the reason from the operating system; all files are then unchanged.
    pub fn write(&self) -> Result<(), Error> {
        let cannot = |(path, source): Failed| Error::Output { path, source };
        fs::create_dir_all(&self.folder).map_err(|source| cannot((self.folder.clone(), source)))?;
        let lock = locked(&self.folder).map_err(cannot)?;
        if lock.is_some() {
            settle_interrupted(&self.folder);
        }
        let stage = Stage::fill(self).map_err(cannot)?;
        let done = if stage.has_links() { stage.exchange() } else { stage.put() };
        done.map_err(cannot)
    }
}

type Failed = (PathBuf, io::Error);

fn at(path: &Path) -> impl FnOnce(io::Error) -> Failed {
    move |source| (path.to_owned(), source)
}

/// Locks the folder against other programs that write a set to it; `None` if the operating system does not support
/// this.
fn locked(folder: &Path) -> Result<Option<File>, Failed> {
    let Ok(file) = File::open(folder) else { return Ok(None) };
    for _ in 0..LOCK_TIMEOUT.as_millis() / LOCK_RETRY_INTERVAL.as_millis() {
        match file.try_lock() {
            Ok(()) => return Ok(Some(file)),
            Err(fs::TryLockError::WouldBlock) => std::thread::sleep(LOCK_RETRY_INTERVAL),
            Err(fs::TryLockError::Error(_)) => return Ok(None),
        }
    }
    Err((folder.to_owned(), io::Error::new(io::ErrorKind::WouldBlock, "another program holds the folder locked")))
}

/// A set that is being written, in a hidden folder next to the files.
struct Stage {
    folder: PathBuf,
    path: PathBuf,
    names: Vec<String>,
}

impl Stage {
    /// Writes and syncs the new files. Leaves nothing after a failure.
    fn fill(set: &OutputSet) -> Result<Self, Failed> {
        // Readers need access to this folder during the exchange.
        let temporary = TemporaryFolder::create_open_in(&set.folder, STAGE_PREFIX).map_err(at(&set.folder))?;
        let names: Vec<String> = set.files.iter().map(|(name, _)| name.clone()).collect();
        let path = temporary.path().to_owned();
        for folder in [NEW, OLD, PLACE_NEW, PLACE_OLD, LINKS] {
            fs::create_dir(path.join(folder)).map_err(at(&path))?;
        }
        for (name, contents) in &set.files {
            let place = set.folder.join(name);
            if fs::symlink_metadata(&place).is_ok_and(|found| found.is_dir()) {
                return Err((place, io::Error::new(io::ErrorKind::IsADirectory, "a folder has this name")));
            }
            if let Some(contents) = contents {
                write_synced(&path.join(NEW).join(name), contents).map_err(|source| (place.clone(), source))?;
            }
            if let Some(above) = place.parent() {
                fs::create_dir_all(above).map_err(at(above))?;
            }
        }
        write_synced(&path.join(NAMES), names.join("\n").as_bytes()).map_err(at(&path))?;
        let stage = Self { folder: set.folder.clone(), path: temporary.keep(), names };
        stage.synced(&[NEW]).map_err(|failed| stage.given_up(failed))?;
        Ok(stage)
    }

    /// Whether the file system supports symbolic and hard links. A full disk is ignored here, because the exchange
    /// reports it.
    fn has_links(&self) -> bool {
        let (soft, hard) = (self.path.join("soft"), self.path.join("hard"));
        let full = |error: io::Error| matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
        let made = soft_link(Path::new(NAMES), &soft).and_then(|()| fs::hard_link(self.path.join(NAMES), &hard));
        let has = made.is_ok() || made.is_err_and(full);
        let _ = (fs::remove_file(soft), fs::remove_file(hard));
        has
    }

    /// Redirects every name to its old file through one link, switches this link to the new files, and replaces the
    /// links by the new files. All steps that need disk space come before the first change of a file.
    fn exchange(self) -> Result<(), Failed> {
        self.prepare().map_err(|failed| self.given_up(failed))?;
        for name in &self.names {
            let (link, place) = (self.path.join(LINKS).join(name), self.folder.join(name));
            if fs::symlink_metadata(&link).is_ok() {
                fs::rename(&link, &place).map_err(at(&place)).map_err(|failed| self.given_up(failed))?;
            }
        }
        self.places_synced().map_err(|failed| self.given_up(failed))?;
        let turned = fs::rename(self.path.join(NEXT), self.path.join(CURRENT)).map_err(at(&self.path));
        turned.map_err(|failed| self.given_up(failed))?;
        // The new set is now valid. If a later step fails, the next write cleans up.
        if self.synced(&[""]).is_ok() {
            self.settle();
        }
        Ok(())
    }

    /// Steps of the exchange that need disk space.
    fn prepare(&self) -> Result<(), Failed> {
        let of = |part: &str, name: &str| self.path.join(part).join(name);
        for name in &self.names {
            let place = self.folder.join(name);
            for part in [OLD, PLACE_NEW, PLACE_OLD, LINKS] {
                if let Some(above) = of(part, name).parent() {
                    fs::create_dir_all(above).map_err(at(above))?;
                }
            }
            let is_new = of(NEW, name).is_file();
            if is_new {
                fs::hard_link(of(NEW, name), of(PLACE_NEW, name)).map_err(at(&place))?;
            }
            let found = fs::symlink_metadata(&place).ok();
            if let Some(found) = &found {
                keep_old(&place, found.is_symlink(), &of(OLD, name), &of(PLACE_OLD, name)).map_err(at(&place))?;
            }
            if is_new || found.is_some() {
                soft_link(&self.link_of(name), &of(LINKS, name)).map_err(at(&place))?;
            }
        }
        soft_link(Path::new(OLD), &self.path.join(CURRENT)).map_err(at(&self.path))?;
        soft_link(Path::new(NEW), &self.path.join(NEXT)).map_err(at(&self.path))?;
        self.synced(&[OLD, PLACE_OLD, PLACE_NEW, LINKS, ""])
    }

    /// Target of the link that replaces a file: a relative path to the stage, so that the folder can be moved or
    /// copied.
    fn link_of(&self, name: &str) -> PathBuf {
        let depth = Path::new(name).components().count() - 1;
        let up: PathBuf = std::iter::repeat_n("..", depth).collect();
        up.join(self.path.file_name().unwrap_or_default()).join(CURRENT).join(name)
    }

    /// Replaces the links by the files of the valid set and removes the stage. Needs no disk space. A failure is
    /// harmless, because the links lead to the same files.
    fn settle(&self) {
        let in_force = fs::read_link(self.path.join(CURRENT)).unwrap_or_default();
        let places = if in_force == Path::new(NEW) { PLACE_NEW } else { PLACE_OLD };
        let mut settled = true;
        for name in &self.names {
            let place = self.folder.join(name);
            if fs::read_link(&place).is_ok_and(|link| link == self.link_of(name)) {
                let file = self.path.join(places).join(name);
                let there = fs::symlink_metadata(&file).is_ok();
                settled &= if there { fs::rename(file, &place) } else { fs::remove_file(&place) }.is_ok();
            }
        }
        if settled && self.places_synced().is_ok() {
            let _ = remove_folder(&self.path);
        }
    }

    fn given_up(&self, failed: Failed) -> Failed {
        self.settle();
        failed
    }

    /// On file systems without links: moves all old files away before the first new file is moved to its place, so
    /// that two sets are never mixed.
    fn put(self) -> Result<(), Failed> {
        for name in &self.names {
            let (place, old) = (self.folder.join(name), self.path.join(MOVED).join(name));
            let moved = old.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| match fs::rename(&place, &old) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
                moved => moved,
            });
            moved.map_err(at(&place)).map_err(|failed| self.put_back(failed))?;
        }
        let decided = self.path.join(DECIDED);
        write_synced(&decided, b"").map_err(at(&self.path)).map_err(|failed| self.put_back(failed))?;
        self.put_rest().map_err(|failed| {
            for name in &self.names {
                let place = self.folder.join(name);
                if !self.path.join(MOVED).join(name).exists() {
                    let _ = fs::remove_file(place);
                }
            }
            let _ = fs::remove_file(&decided);
            self.put_back(failed)
        })
    }

    fn put_back(&self, failed: Failed) -> Failed {
        let back = |name: &String| {
            let old = self.path.join(MOVED).join(name);
            !old.exists() || fs::rename(old, self.folder.join(name)).is_ok()
        };
        if self.names.iter().all(back) {
            let _ = remove_folder(&self.path);
        }
        failed
    }

    fn put_rest(&self) -> Result<(), Failed> {
        for name in &self.names {
            let (file, place) = (self.path.join(NEW).join(name), self.folder.join(name));
            if file.is_file() {
                fs::rename(&file, &place).map_err(at(&place))?;
            }
        }
        let _ = remove_folder(&self.path);
        Ok(())
    }

    fn synced(&self, parts: &[&str]) -> Result<(), Failed> {
        for part in parts {
            let base = self.path.join(part);
            sync_folder(&base).map_err(at(&base))?;
            for below in self.folders_below() {
                let path = base.join(below);
                if !part.is_empty() && path.is_dir() {
                    sync_folder(&path).map_err(at(&path))?;
                }
            }
        }
        Ok(())
    }

    fn places_synced(&self) -> Result<(), Failed> {
        sync_folder(&self.folder).map_err(at(&self.folder))?;
        for below in self.folders_below() {
            let path = self.folder.join(below);
            sync_folder(&path).map_err(at(&path))?;
        }
        Ok(())
    }

    fn folders_below(&self) -> std::collections::BTreeSet<&Path> {
        let above = self.names.iter().flat_map(|name| Path::new(name).ancestors().skip(1));
        above.filter(|path| !path.as_os_str().is_empty()).collect()
    }
}

/// Cleans up after a killed program: replaces links by the files of the valid set.
fn settle_interrupted(folder: &Path) {
    let stages =
        names(folder).unwrap_or_default().into_iter().filter(|name| name.to_string_lossy().starts_with(STAGE_PREFIX));
    for stage in stages {
        let Some(names) = names_of_stage(folder, Path::new(&stage)) else { continue };
        let stage = Stage { folder: folder.to_owned(), path: folder.join(stage), names };
        if stage.path.join(DECIDED).exists() {
            let _ = stage.put_rest();
        } else if stage.path.join(MOVED).exists() {
            stage.put_back((folder.to_owned(), io::ErrorKind::Interrupted.into()));
        } else {
            stage.settle();
        }
    }
}

/// Names of the files in a stage in `folder`. The folder can come from an untrusted source. If a name or a symbolic
/// link leads out of the stage or of `folder`, returns `None`, and the stage remains: moving its files could
/// overwrite or remove other files.
fn names_of_stage(folder: &Path, stage: &Path) -> Option<Vec<String>> {
    let is_through_link = |way: &Path| {
        let mut above = way.ancestors().skip(1).filter(|above| !above.as_os_str().is_empty());
        above.any(|above| fs::symlink_metadata(folder.join(above)).is_ok_and(|found| found.is_symlink()))
    };
    let is_inside = |name: &String| {
        Path::new(name).components().all(|part| matches!(part, Component::Normal(_)))
            && !is_through_link(Path::new(name))
            && PARTS.iter().all(|part| !is_through_link(&stage.join(part).join(name)))
    };
    if is_through_link(&stage.join(NAMES)) {
        return None;
    }
    let text = dynident_files::read_text(&folder.join(stage).join(NAMES), MAX_NAMES_BYTES).unwrap_or_default();
    let names: Vec<String> = text.lines().map(str::to_owned).collect();
    names.iter().all(is_inside).then_some(names)
}

/// Keeps the content of a file under two names: one for readers, one for restoring. A symbolic link of the user is
/// restored as a link.
fn keep_old(place: &Path, is_link: bool, read: &Path, back: &Path) -> io::Result<()> {
    if is_link {
        let target =
            fs::canonicalize(place).or_else(|_| std::path::absolute(place).map(|path| path.join("nowhere")))?;
        soft_link(&target, read)?;
        return soft_link(&fs::read_link(place)?, back);
    }
    // If the system refuses a hard link to another user's file, its content is copied.
    for kept in [read, back] {
        fs::hard_link(place, kept).or_else(|_| fs::copy(place, kept).and_then(|_| File::open(kept)?.sync_all()))?;
    }
    Ok(())
}

#[cfg(unix)]
fn soft_link(to: &Path, path: &Path) -> io::Result<()> {
    std::os::unix::fs::symlink(to, path)
}

#[cfg(not(unix))]
fn soft_link(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

fn write_synced(path: &Path, contents: &[u8]) -> io::Result<()> {
    if let Some(above) = path.parent() {
        fs::create_dir_all(above)?;
    }
    let mut file = File::create(path)?;
    io::Write::write_all(&mut file, contents)?;
    file.sync_all()
}

/// Syncs the names in a folder, if the operating system supports it.
fn sync_folder(path: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(path)?.sync_all() } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(folder: &Path, name: &str) -> String {
        fs::read_to_string(folder.join(name)).unwrap_or_default()
    }

    /// Tests the fallback for file systems without links.
    #[test]
    fn without_links_a_set_still_replaces_a_set() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let first = OutputSet::new(path).file("a", "1").file("below/b", "1").absent("c");
        Stage::fill(&first).unwrap().put().unwrap();
        assert_eq!([read(path, "a"), read(path, "below/b"), read(path, "c")], ["1", "1", ""]);
        let second = OutputSet::new(path).file("a", "2").absent("below/b").file("c", "2");
        Stage::fill(&second).unwrap().put().unwrap();
        assert_eq!([read(path, "a"), read(path, "below/b"), read(path, "c")], ["2", "", "2"]);
        assert_eq!(fs::read_dir(path).unwrap().count(), 3);
    }

    /// Killed while old files are moved, and while new files are placed.
    #[test]
    fn without_links_an_interrupted_set_is_cleared_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let old = OutputSet::new(path).file("a", "1").file("b", "1");
        old.write().unwrap();
        let new = OutputSet::new(path).file("a", "2").file("b", "2");
        let stage = Stage::fill(&new).unwrap();
        fs::create_dir(stage.path.join(MOVED)).unwrap();
        fs::rename(path.join("a"), stage.path.join(MOVED).join("a")).unwrap();
        settle_interrupted(path);
        assert_eq!([read(path, "a"), read(path, "b")], ["1", "1"]);
        let stage = Stage::fill(&new).unwrap();
        fs::create_dir(stage.path.join(MOVED)).unwrap();
        for name in ["a", "b"] {
            fs::rename(path.join(name), stage.path.join(MOVED).join(name)).unwrap();
        }
        fs::write(stage.path.join(DECIDED), "").unwrap();
        fs::rename(stage.path.join(NEW).join("b"), path.join("b")).unwrap();
        settle_interrupted(path);
        assert_eq!([read(path, "a"), read(path, "b")], ["2", "2"]);
        assert_eq!(fs::read_dir(path).unwrap().count(), 2);
    }
}
