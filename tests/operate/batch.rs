//! `gyre batch`: after any kill, the same command completes the table, and the table distinguishes
//! failures.

mod drives;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use gyre_journal as journal;
use rustix::process::{Pid, Signal, kill_process_group};

use drives::Drives;

use crate::{
    PROGRAM, PROJECT,
    common::{
        Ended, assert_nothing_left, gyre, leftovers, poses_of, processes, recording, send,
        with_tmpfs,
    },
};

/// A batch takes seconds, far more only on a loaded machine.
const LIMIT: Duration = Duration::from_secs(180);
const LOOK: Duration = Duration::from_millis(2);
const SMALL: &str = "[raster]\nn = 127\ncell_m = 0.8\n";

/// A `gyre batch` command.
#[derive(Clone)]
pub(crate) struct Batch<'a> {
    drives: &'a Drives,
    pub out: PathBuf,
    options: Vec<String>,
}

impl Batch<'_> {
    pub fn with(mut self, options: &[&str]) -> Self {
        self.options.extend(options.iter().map(|&it| it.to_owned()));
        self
    }

    fn command(&self) -> Command {
        let mut command = gyre();
        command.arg("batch").arg(self.drives.path("list.csv"));
        command.arg("--config").arg(self.drives.path("small.toml"));
        command.arg("--out").arg(&self.out).args(&self.options);
        command
    }

    /// Runs it to its end, which leaves nothing behind.
    pub fn finish(&self) -> Ended {
        let ended = Ended::of(self.command());
        println!("{}{}", ended.stderr, ended.stdout);
        for name in &self.drives.names {
            assert_nothing_left(&self.results(name));
        }
        ended
    }

    /// Starts it as the leader of a process group.
    fn start(&self) -> Started<'_> {
        use std::os::unix::process::CommandExt;
        let mut command = self.command();
        command.process_group(0);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        Started {
            batch: self,
            process: command.spawn().unwrap(),
        }
    }

    fn results(&self, name: &str) -> PathBuf {
        self.out.join("drives").join(name)
    }

    fn rows(&self) -> usize {
        let rows = fs::read_dir(self.out.join("rows")).into_iter().flatten();
        let names = rows.map(|row| row.unwrap().file_name());
        // Not those that are about to be written.
        names
            .filter(|name| !name.as_encoded_bytes().starts_with(b"."))
            .count()
    }

    /// The drives that are being computed: their supervisors.
    fn supervisors(&self) -> Vec<u32> {
        let names = self.drives.names.iter();
        let running = names.filter(|name| self.poses(name) > 1);
        running.filter_map(|name| self.supervisor(name)).collect()
    }

    fn supervisor(&self, name: &str) -> Option<u32> {
        let root = leftovers::root(&self.results(name));
        let stage = processes::of_run(&root).into_iter().next()?;
        processes::parent_of(stage)
    }

    fn poses(&self, name: &str) -> usize {
        poses_of(&self.results(name))
    }

    pub fn table(&self) -> String {
        fs::read_to_string(self.out.join("results.csv")).unwrap()
    }

    /// `NAME OUTCOME` of each row.
    fn outcomes(&self) -> Vec<String> {
        let table = self.table();
        let mut reader = csv::Reader::from_reader(table.as_bytes());
        let row = |row: csv::StringRecord| format!("{} {}", &row[0], &row[2]);
        reader.records().map(|it| row(it.unwrap())).collect()
    }
}

/// A batch that is running.
struct Started<'a> {
    batch: &'a Batch<'a>,
    process: Child,
}

impl Started<'_> {
    /// Waits until there are so many rows and one more drive is being computed, and returns its
    /// supervisor.
    fn await_run_after(&mut self, rows: usize) -> u32 {
        self.await_some(|batch| {
            // In this order: the row of a run that is seen may be written before rows are counted.
            let has_rows = batch.rows() >= rows;
            let running = batch.supervisors();
            running.first().filter(|_| has_rows).copied()
        })
    }

    /// Waits until `look` returns a value.
    fn await_some<T>(&mut self, look: impl Fn(&Batch<'_>) -> Option<T>) -> T {
        let since = Instant::now();
        loop {
            if let Some(found) = look(self.batch) {
                return found;
            }
            assert!(self.process.try_wait().unwrap().is_none(), "it has ended");
            assert!(since.elapsed() < LIMIT, "waited in vain for a run");
            thread::sleep(LOOK);
        }
    }

    fn pid(&self) -> Pid {
        Pid::from_child(&self.process)
    }

    fn wait(mut self) -> Option<i32> {
        self.process.wait().unwrap().code()
    }
}

/// A batch with a drive for each way to fail.
fn drives_with_failures() -> Drives {
    let drives = Drives::new().recordings(&[20, 22, 24]);
    let folder = drives.folder.path().to_owned();
    let corrupt = recording::linked(recording::small(), |scan| scan < 12).keep();
    for image in recording::images(&corrupt).iter().skip(4) {
        recording::truncate(image, 100);
    }
    fs::rename(corrupt, folder.join("corrupt")).unwrap();
    fs::create_dir(folder.join("empty")).unwrap();
    let simulation = format!("[simulation]\nscans = 4\nseed = 7\n{SMALL}");
    fs::write(folder.join("simulated.toml"), simulation).unwrap();
    drives
        .line("corrupt", &folder.join("corrupt"), "")
        .line("missing", &folder.join("nowhere"), "")
        .line("empty", &folder.join("empty"), "")
        .line("refused", &folder.join("part-20"), "raster.m=3")
        .line("unsure", &folder.join("part-24"), "masking.threshold=250")
        // Relative to the list.
        .line("simulated", Path::new("simulated.toml"), "")
}

const OUTCOMES: [&str; 9] = [
    "part-20 complete",
    "part-22 complete",
    "part-24 complete",
    "corrupt corrupt",
    "missing failed",
    "empty failed",
    "refused failed",
    "unsure unsure",
    "simulated complete",
];

fn kill_all_then_the_batch_then_a_run(batch: &Batch<'_>) {
    let mut started = batch.start();
    started.await_run_after(0);
    kill_process_group(started.pid(), Signal::KILL).unwrap();
    assert_eq!(started.wait(), None);
    let mut started = batch.start();
    started.await_run_after(1);
    send(started.pid().as_raw_pid() as u32, Signal::KILL);
    assert_eq!(started.wait(), None);
    let mut started = batch.start();
    let supervisor = started.await_run_after(2);
    send(supervisor, Signal::KILL);
    assert_eq!(started.wait(), Some(1));
}

#[test]
#[ignore = ".ci/nightly: kills at many moments"]
fn a_batch_that_is_killed_gives_the_table_of_one_that_is_not() {
    let drives = drives_with_failures();
    // So that there is time to kill a run.
    let paced = ["--set", "run.rate='12'", "--jobs", "1"];
    let calm = drives.batch("calm").with(&paced);
    let ended = calm.finish();
    assert_eq!(ended.code(), Some(1));
    assert_eq!(calm.outcomes(), OUTCOMES);
    let said = "9 drives: 4 complete, 1 corrupt, 1 unsure, 3 failed";
    ended.prints(said);
    // A line for each.
    let lines = |words: &str| ended.stderr.lines().filter(|it| it.contains(words)).count();
    for words in [
        "corrupt: corrupt: 8 of the 12 scans",
        "missing: failed: there is nothing at",
        "empty: failed: ",
        "refused: failed: [raster] has no key `m`",
        "unsure: unsure: 0 weak and 23 predicted motions of 23",
    ] {
        assert_eq!(lines(words), 1, "{words}:\n{}", ended.stderr);
    }
    assert_eq!(ended.stderr.lines().count(), 9, "{}", ended.stderr);

    let killed = drives.batch("killed").with(&paced);
    kill_all_then_the_batch_then_a_run(&killed);
    assert!(killed.outcomes().iter().any(|it| it.ends_with(" killed")));
    let last = killed.finish();
    last.prints(said).prints("had been computed before");
    assert_eq!(killed.table(), calm.table());
}

/// The script of an array of Slurm.
#[test]
fn tasks_that_share_the_list_and_the_folder_alone_give_the_same_table() {
    let drives = Drives::new().recordings(&[4, 5, 6]);
    let nowhere = drives.path("nowhere");
    let drives = drives.line("missing", &nowhere, "");
    let [alone, shared] = ["alone", "shared"].map(|out| drives.batch(out));
    assert_eq!(alone.finish().code(), Some(1));
    let programs = Path::new(PROGRAM).parent().unwrap();
    let path = format!("{}:{}", programs.display(), env::var("PATH").unwrap());
    let task = |task: &str| {
        let mut script = Command::new("bash");
        script.arg(format!("{PROJECT}/examples/slurm/gyre.sbatch"));
        script.arg(drives.path("list.csv")).arg(&shared.out);
        script.arg("--config").arg(drives.path("small.toml"));
        script.env("PATH", &path).env("SLURM_ARRAY_TASK_ID", task);
        script.env("TASKS", "2").spawn().unwrap()
    };
    let tasks = ["0", "1"].map(task);
    let codes = tasks.map(|mut task| task.wait().unwrap().code());
    // The second one has the drive that is missing.
    assert_eq!(codes, [Some(0), Some(1)]);
    let collected = shared.clone().with(&["--collect"]).finish();
    assert_eq!(collected.code(), Some(1));
    assert_eq!(collected.stderr.lines().count(), 1, "{}", collected.stderr);
    assert_eq!(shared.table(), alone.table());
}

#[test]
fn what_is_complete_stays_when_its_recording_is_gone() {
    let drives = Drives::new().recordings(&[6]);
    let batch = drives.batch("out");
    batch.finish().succeeded();
    let table = batch.table();
    let (recording, aside) = (drives.path("part-6"), drives.path("aside"));
    fs::rename(&recording, &aside).unwrap();
    let again = batch.finish();
    again.succeeded().says("complete before");
    again.says("there is nothing at");
    assert_eq!(batch.table(), table);

    // A configuration that became invalid is no success, whatever there was before.
    fs::rename(&aside, &recording).unwrap();
    let small = drives.path("small.toml");
    fs::write(&small, "[raster]\nn = 0\n").unwrap();
    assert_eq!(batch.finish().code(), Some(1));
    assert_eq!(batch.outcomes(), ["part-6 failed"]);
    fs::write(&small, SMALL).unwrap();
    batch.finish().succeeded();
    assert_eq!(batch.table(), table);
    fs::rename(&recording, &aside).unwrap();

    // Without its results a row is worth nothing.
    fs::remove_dir_all(batch.results("part-6")).unwrap();
    let collected = batch.clone().with(&["--collect"]).finish();
    assert_eq!(collected.code(), Some(1));
    collected.says("part-6: not-run");
    assert_eq!(batch.finish().code(), Some(1));
    assert_eq!(batch.outcomes(), ["part-6 failed"]);
    fs::rename(&aside, &recording).unwrap();
    batch.finish().succeeded();
    assert_eq!(batch.table(), table);
}

#[test]
fn a_drive_is_computed_again_with_another_configuration_alone() {
    let drives = Drives::new().recordings(&[6]);
    let batch = drives.batch("out");
    let changed = || {
        let journal = journal::path(&batch.results("part-6"));
        fs::metadata(journal).unwrap().modified().unwrap()
    };
    batch.finish().succeeded();
    let first = changed();
    batch
        .finish()
        .succeeded()
        .prints("1 had been computed before");
    assert_eq!(changed(), first);

    let other = batch.clone().with(&["--set", "search.kind='exhaustive'"]);
    let collected = other.clone().with(&["--collect"]).finish();
    assert_eq!(collected.code(), Some(1));
    collected.says("part-6: not-run: it was computed with other settings");
    let ended = other.finish();
    let said = &ended.succeeded().stdout;
    assert!(!said.contains("before"), "{said}");
    assert!(changed() > first);

    // What another version has begun; a batch has no `--fresh`.
    let begun = drives.batch("begun");
    let path = journal::path(&begun.results("part-6"));
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, "gyre journal v9 and what follows").unwrap();
    begun.finish().succeeded();
}

#[test]
fn a_drive_that_was_killed_while_it_replaced_another_one_is_computed() {
    let drives = Drives::new().recordings(&[6]);
    let batch = drives.batch("out");
    batch.finish().succeeded();
    let other = batch.clone().with(&["--set", "search.kind='exhaustive'"]);
    // No second scan for a long time.
    let slow = other.clone().with(&["--set", "run.rate='0.001'"]);
    let mut started = slow.start();
    let supervisor = started.await_some(|batch| batch.supervisor("part-6"));
    let aside = batch.results("part-6").join("journal.replaced");
    assert!(aside.exists());
    send(supervisor, Signal::KILL);
    assert_eq!(started.wait(), Some(1));
    assert!(aside.exists());
    other.finish().succeeded();
    assert!(!aside.exists());
    // Nor does it stay for ever when nothing is computed.
    fs::create_dir(&aside).unwrap();
    other.finish().succeeded().prints("computed before");
    assert!(!aside.exists());
}

#[test]
fn an_interrupted_batch_keeps_what_it_has_and_goes_on() {
    let drives = Drives::new().recordings(&[24]);
    let batch = drives.batch("out").with(&["--set", "run.rate='4'"]);
    let mut started = batch.start();
    started.await_run_after(0);
    send(started.pid().as_raw_pid() as u32, Signal::TERM);
    assert_eq!(started.wait(), Some(130));
    assert_eq!(batch.outcomes(), ["part-24 interrupted"]);
    assert_nothing_left(&batch.results("part-24"));
    let poses = batch.poses("part-24");
    assert!((1..24).contains(&poses), "{poses}");
    batch.finish().succeeded();
    let mut times = csv::Reader::from_path(batch.out.join("times.csv")).unwrap();
    let header = times.headers().unwrap().clone();
    let column = header.iter().position(|it| it == "resumed_after").unwrap();
    let row = times.records().next().unwrap().unwrap();
    assert_eq!(&row[column], poses.to_string());
}

#[test]
fn a_batch_that_cannot_be_is_refused_in_a_sentence() {
    let drives = Drives::new().recordings(&[2]);
    let batch = |options: &[&str]| drives.batch("out").with(options).finish();
    fs::create_dir_all(drives.path("out/rows").parent().unwrap()).unwrap();
    batch(&["--collect"]).refused_with(&["is not the folder of a batch"]);
    fs::remove_file(drives.path("list.csv")).unwrap();
    batch(&[]).refused_with(&["list of drives", "list.csv"]);
}

/// The end of a batch with a disk of this size at a place; `None` if that is not permitted here.
fn on_small_disk(batch: &Batch<'_>, place: &Path, size: &str) -> Option<Ended> {
    fs::create_dir_all(place).unwrap();
    with_tmpfs(&batch.command(), place, &format!("size={size}")).map(Ended::of)
}

#[test]
fn a_full_disk_fails_a_drive_with_its_reason() {
    let drives = Drives::new().recordings(&[24]);
    let batch = drives.batch("out");
    let Some(ended) = on_small_disk(&batch, &batch.results("part-24"), "64k") else {
        return;
    };
    assert_eq!(ended.code(), Some(1), "{}", ended.stderr);
    assert_eq!(batch.outcomes(), ["part-24 failed"]);
    assert!(batch.table().contains("No space left"), "{}", batch.table());
}

#[test]
fn a_full_disk_of_the_whole_batch_ends_it_and_the_same_command_continues() {
    let drives = Drives::new().recordings(&[3, 4, 5]);
    let batch = drives.batch("out");
    // Folders, and not much more.
    let Some(ended) = on_small_disk(&batch, &batch.out, "24k") else {
        return;
    };
    assert_eq!(ended.code(), Some(1), "{}", ended.stderr);
    ended.says("No space left on device");
    batch.finish().succeeded();
}
