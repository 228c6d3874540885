//! The places that a user names for what commands write: nothing of others is replaced there.

use std::{
    fs,
    os::unix::fs::FileTypeExt,
    path::{Path, PathBuf},
    process::Command,
    thread,
    time::SystemTime,
};

use crate::common::{Ended, Run, folder, gyre};

/// Names of files that commands write, in a folder of somebody else.
const NAMES: &str = "config.toml map.png fixes.csv masks.png calibration.toml trajectory.svg report.json results.csv dataset.toml shadow.csv";
/// By these words a command refuses a place.
const REFUSALS: &str = "was not written by|has the files of|fills a folder|exist|is not a page of";

/// Each command that writes to a place that is named, without the place.
fn commands(run: &Run, files: &Path) -> Vec<String> {
    let (run, files) = (run.out().display(), files.display());
    let played = format!("{run}/config.toml --set slam.kind=none --set source.scans=3");
    vec![
        format!("report {run} --to"),
        format!("map {run} --format=png --out"),
        format!("localise {played} --map {files}/map --out"),
        format!("masks {played} --scans 0 --out"),
        format!("calibrate {played} --out"),
        format!("evaluate {run} --plots"),
        format!("stress {played} --set raster.m=1 --out"),
        format!("batch {files}/list.txt --out"),
        "simulate --scans 2 --out".to_owned(),
        format!("run {played} --out"),
        "shadow masking --command true --report".to_owned(),
        format!("export {run} --scans none --mcap"),
        format!("run {played} --fresh --out {files}/recorded --record"),
        "radar-server --radar 127.0.0.1:1 --capture".to_owned(),
        "new stage masking --python".to_owned(),
    ]
}

/// The first of the commands whose place must be new.
const NEW_FROM: usize = 11;

fn execute(command: &str, place: &Path) -> Ended {
    let mut process = gyre();
    process.args(command.split(' ')).arg(place);
    Ended::of(process)
}

fn is_refused(command: &str, place: &Path) -> bool {
    let ended = execute(command, place);
    let mut words = REFUSALS.split('|');
    ended.code() != Some(0) && words.any(|it| ended.stderr.contains(it))
}

/// The files in a folder with their sizes and the times at which they were written.
fn state(folder: &Path) -> Vec<(PathBuf, u64, SystemTime)> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let described = entries.map(|it| (it.path(), it.metadata().unwrap()));
    let described = described.map(|(path, it)| (path, it.len(), it.modified().unwrap()));
    let mut described: Vec<_> = described.collect();
    described.sort();
    described
}

fn make(program: &str, place: &Path, numbers: &[&str]) -> bool {
    let made = Command::new(program).arg(place).args(numbers).status();
    made.is_ok_and(|status| status.success())
}

#[test]
fn no_command_replaces_what_is_not_its_own() {
    let run = Run::of_recording().set("slam.kind=graph");
    run.complete();
    let (folder, out) = (folder(), run.out());
    let files = folder.path();
    let map = format!("map {} --format=folder --out", out.display());
    execute(&map, &files.join("map")).succeeded();
    fs::write(files.join("list.txt"), "/nowhere\n").unwrap();
    let results = state(out);
    for (number, command) in commands(&run, files).iter().enumerate() {
        let at = |name: &str| files.join(format!("{number}-{name}.mcap"));
        // A new place, and what the command has written there.
        assert!(!is_refused(command, &at("new")), "{command}");
        assert!(
            number >= NEW_FROM || !is_refused(command, &at("new")),
            "{command}"
        );
        // The folder of a run: a run resumes it, and it may have the plots of its own evaluation.
        if !command.starts_with("evaluate") && !command.starts_with("run") {
            assert!(
                is_refused(command, out) && state(out) == results,
                "{command}"
            );
        }
        // A file, and a folder with files of the same names, of somebody else.
        fs::write(at("file"), "mine").unwrap();
        fs::create_dir(at("folder")).unwrap();
        let names = NAMES.split(' ').map(|name| at("folder").join(name));
        names.for_each(|file| fs::write(file, "mine").unwrap());
        let before = state(&at("folder"));
        assert!(is_refused(command, &at("file")), "{command}");
        assert!(is_refused(command, &at("folder")), "{command}");
        assert_eq!(state(&at("folder")), before, "{command}");
        assert_eq!(fs::read(at("file")).unwrap(), b"mine", "{command}");
        // A FIFO and a device like /dev/null, to which a page is written.
        assert!(make("mkfifo", &at("fifo"), &[]));
        match command.starts_with("report ") {
            true => {
                let fifo = at("fifo");
                let reader = thread::spawn(move || fs::read_to_string(fifo).unwrap());
                execute(command, &at("fifo")).succeeded();
                assert!(reader.join().unwrap().ends_with("</html>\n"));
                if make("mknod", &at("null"), &["c", "1", "3"]) {
                    execute(command, &at("null")).succeeded();
                    let kind = fs::metadata(at("null")).unwrap().file_type();
                    assert!(kind.is_char_device());
                }
            }
            false => assert!(is_refused(command, &at("fifo")), "{command}"),
        }
        assert!(
            fs::metadata(at("fifo")).unwrap().file_type().is_fifo(),
            "{command}"
        );
    }
}
