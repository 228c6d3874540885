//! The places that a user names for what commands write: nothing of others is replaced there.

use std::{fs, os::unix::fs::FileTypeExt, path::Path, process::Command, thread};

use crate::common::{Ended, Run, finished, folder};

const NAMES: &str = "config.toml map.png fixes.csv masks.png calibration.toml trajectory.svg report.json results.csv dataset.toml shadow.csv";
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
        "new stage masking --python".to_owned(),
    ]
}

const NEW_FROM: usize = 11; // The places of the commands from here on must be new.

fn execute(command: &str, place: &Path) -> Ended {
    finished![; command.split(' '); [place]]
}

fn expect(is_refused: bool, command: &str, place: &Path) {
    let ended = execute(command, place);
    let mut words = REFUSALS.split('|');
    let found = ended.code() != Some(0) && words.any(|it| ended.stderr.contains(it));
    assert_eq!(found, is_refused, "{command}: {}", ended.stderr);
}

/// Makes a FIFO and, as root, a device like /dev/null, else a second FIFO.
fn make_pipe_and_device(places: [std::path::PathBuf; 2]) {
    let make = "mkfifo \"$0\" && (mknod \"$1\" c 1 3 || mkfifo \"$1\")";
    let mut made = Command::new("sh");
    made.args(["-c", make]).args(places);
    assert!(made.status().unwrap().success());
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
    let state = || ["config.toml", "map.png"].map(|it| fs::read(out.join(it)).unwrap());
    let before = state();
    for (number, command) in commands(&run, files).iter().enumerate() {
        let at = |name: &str| files.join(format!("{number}-{name}.mcap"));
        // A new folder, then the folder that the command has written.
        expect(false, command, &at("new"));
        if number < NEW_FROM {
            expect(false, command, &at("new"));
        }
        // A run, which may have the plots of its own evaluation.
        if !command.starts_with("evaluate") && !command.starts_with("run") {
            expect(true, command, out);
            assert!(state() == before, "{command}");
        }
        // A file, and a folder with files of the same names, of somebody else.
        fs::create_dir(at("folder")).unwrap();
        let names = NAMES.split(' ').map(|name| at("folder").join(name));
        let theirs: Vec<_> = names.chain([at("file")]).collect();
        let write = |file| fs::write(file, "mine").unwrap();
        theirs.iter().for_each(write);
        expect(true, command, &at("file"));
        // The pictures of masks have no lock.
        if !command.starts_with("masks") {
            expect(true, command, &at("folder"));
        }
        let is_kept = |file| fs::read(file).unwrap() == b"mine";
        assert!(theirs.iter().all(is_kept), "{command}");
        // A page is written to them.
        make_pipe_and_device([at("fifo"), at("null")]);
        let fifo = at("fifo");
        let is = |name| fs::metadata(at(name)).unwrap().file_type();
        if command.starts_with("report ") {
            let reader = thread::spawn(move || fs::read_to_string(fifo).unwrap());
            execute(command, &at("fifo")).succeeded();
            assert!(reader.join().unwrap().ends_with("</html>\n"));
            assert!(is("null").is_fifo() || execute(command, &at("null")).code() == Some(0));
        } else {
            expect(true, command, &fifo);
        }
        assert!(is("fifo").is_fifo() && !is("null").is_file(), "{command}");
    }
}
