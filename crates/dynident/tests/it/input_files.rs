//! Input files: a file that changes during the job, or that is not a regular file, is an error.

use crate::common::{Job, Motion, Truth, format, header, plain, repository, write_log};
use dynident::{Error, Progress, ReduceSettings, RunOptions, Study, check, identify, reduce, validate_result};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

type RunJob<'a> = &'a dyn Fn(&RunOptions<'_>) -> Option<Error>;

/// Runs an action once, when a job starts to read logs.
struct Once<'a> {
    done: AtomicBool,
    what: &'a (dyn Fn() + Sync),
}

impl Once<'_> {
    fn now(&self) {
        if !self.done.swap(true, Ordering::SeqCst) {
            (self.what)();
        }
    }
}

impl Progress for Once<'_> {
    fn begin(&self, _: &str, _: Option<u64>) {
        self.now();
    }
    fn advance(&self, _: u64) {
        self.now();
    }
    fn end(&self) {}
}

fn job(folder: &Path) -> Job {
    std::fs::copy(repository("robots/planar2r.urdf"), folder.join("arm.urdf")).unwrap();
    let truth = Truth::near(&folder.join("arm.urdf"), 0.1, true);
    for (name, seed) in [("train.csv", 3), ("test.csv", 4)] {
        write_log(&folder.join(name), &truth, &Motion::new(2, seed), (100.0, 12.0), &header(2), plain);
    }
    let study = format!(
        "[robot]\nfile = \"arm.urdf\"\n[drive]\nfriction = \"stated\"\ndrive_inertia = false\n{}[[log]]\nfile = \"train.csv\"\n[[log]]\nfile = \"test.csv\"\nrole = \"validate\"\n",
        format(2)
    );
    Job::new(folder, &study)
}

/// Replaces a file by one of the same length, as a recorder or `rsync` does.
fn replace(path: &Path) {
    let other = path.with_extension("new");
    std::fs::copy(path, &other).unwrap();
    std::fs::rename(&other, path).unwrap();
}

/// Parameters never come with the hash of another file content: a changed file is an error in every job that reads
/// logs.
#[test]
fn a_file_that_is_replaced_during_a_job_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let job = job(folder.path());
    let result = job.identify().result;
    let run = |name: &str, work: RunJob<'_>, file: Option<&str>| {
        let what = || file.map_or((), |file| replace(&folder.path().join(file)));
        let progress = Once { done: AtomicBool::new(false), what: &what };
        let error = work(&RunOptions { data: None, threads: 1, progress: &progress });
        assert!(progress.done.load(Ordering::SeqCst), "{name}: {error:?}");
        error
    };
    let of_study = (&job.study, &*job.path);
    let jobs: [(&str, RunJob<'_>); 4] = [
        ("identify", &|options| identify(&job.study, &job.path, options).err()),
        ("check", &|options| check(&job.study, &job.path, options).err()),
        ("validate", &|options| {
            validate_result(&result, Path::new("result.json"), of_study.0, of_study.1, options).err()
        }),
        ("reduce", &|options| reduce(&job.study, &job.path, None, &ReduceSettings::default(), options).err()),
    ];
    for (name, work) in jobs {
        assert!(run(name, work, None).is_none(), "{name}");
        for file in ["train.csv", "arm.urdf", "study.toml"] {
            let error = run(name, work, Some(file)).unwrap_or_else(|| panic!("{name}: {file}"));
            let Error::Changed { path } = &error else { panic!("{name}, {file}: {error}") };
            assert_eq!(path.file_name().unwrap(), file, "{name}");
            assert!(error.to_string().contains("changed while it was read; run"), "{error}");
        }
    }
}

/// A pipe without a writer would block forever.
#[cfg(unix)]
#[test]
fn a_pipe_in_the_place_of_any_file_is_refused() {
    for file in ["train.csv", "arm.urdf", "study.toml"] {
        let folder = tempfile::tempdir().unwrap();
        let job = job(folder.path());
        let path = folder.path().join(file);
        std::fs::remove_file(&path).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let error = match file {
            "study.toml" => Study::load(&path).unwrap_err().into(),
            _ => identify(&job.study, &job.path, &Job::options(2)).unwrap_err(),
        };
        let message = error.to_string();
        assert!(message.contains(file) && message.contains("a pipe, not a regular file"), "{message}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("result.json");
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    assert!(dynident::ResultFile::read(&path).unwrap_err().to_string().contains("a pipe"));
}
