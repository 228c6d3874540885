use std::{
    os::unix::fs::{PermissionsExt, symlink},
    thread,
};

use super::*;

fn acquire(out: &Path) -> Result<RunRoot, RunError> {
    RunRoot::acquire(out, &Signals::install().unwrap())
}

fn directory(mode: u32) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    fs::set_permissions(directory.path(), Permissions::from_mode(mode)).unwrap();
    directory
}

#[test]
fn a_run_locks_its_root_and_removes_all_files() {
    let out = tempfile::tempdir().unwrap();
    let root = acquire(out.path()).unwrap();
    let refused = acquire(out.path()).unwrap_err();
    assert!(refused.to_string().contains("process "), "{refused}");
    let segment = Path::new(SHARED_MEMORY).join(format!("{}leftover", root.prefix()));
    fs::write(&segment, b"").unwrap();
    let path = root.path().to_owned();
    drop(root);
    assert!(!segment.exists() && !path.exists() && !lock_of(&path).exists());
    assert!(acquire(out.path()).is_ok());
}

fn dead_run(number: u64) -> (PathBuf, PathBuf) {
    let name = format!("gyre{number:010x}");
    let dead = user_directory().unwrap().join(&name);
    let segment = Path::new(SHARED_MEMORY).join(format!("{name}_leftover"));
    let lock = try_lock(&lock_of(&dead)).unwrap();
    fs::create_dir(&dead).unwrap();
    fs::write(dead.join("manifest.json"), b"").unwrap();
    fs::write(&segment, b"").unwrap();
    drop(lock);
    (dead, segment)
}

#[test]
fn a_dead_run_is_removed_by_the_next_one() {
    let (out, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    // Keeps the user's directory.
    let _other = acquire(other.path()).unwrap();
    let (dead, segment) = dead_run(std::process::id().into());
    drop(acquire(out.path()).unwrap());
    await_removal(&dead, &segment);
}

/// A run of another test, or of another program, may be removing the dead run.
fn await_removal(dead: &Path, segment: &Path) {
    let since = Instant::now();
    while segment.exists() || dead.exists() || lock_of(dead).exists() {
        assert!(since.elapsed() < 10 * LIMIT, "the dead run stays");
        thread::sleep(PAUSE);
    }
}

#[test]
fn one_dead_run_is_removed_and_no_living_one() {
    let out = tempfile::tempdir().unwrap();
    let living = acquire(out.path()).unwrap();
    let (dead, segment) = dead_run((1 << 32) + u64::from(std::process::id()));
    sweep_run(living.path());
    sweep_run(out.path());
    assert!(living.path().exists() && out.path().exists());
    sweep_run(&dead);
    await_removal(&dead, &segment);
}

#[test]
fn nothing_but_runs_is_removed() {
    let (out, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    // Keeps the user's directory.
    let _other = acquire(other.path()).unwrap();
    let runs = user_directory().unwrap();
    let foreign = [
        "iox2x",
        "gyre012345678",
        "gyre01234567890",
        "gyre012345678X",
    ];
    let segment = |name: &str| Path::new(SHARED_MEMORY).join(format!("{name}_foreign"));
    for name in foreign {
        fs::create_dir_all(runs.join(name)).unwrap();
        fs::write(segment(name), b"").unwrap();
    }
    drop(acquire(out.path()).unwrap());
    for name in foreign {
        assert!(segment(name).exists() && runs.join(name).exists(), "{name}");
        fs::remove_file(segment(name)).unwrap();
        fs::remove_dir(runs.join(name)).unwrap();
    }
}

fn mode_of(path: &Path) -> u32 {
    fs::metadata(path).unwrap().mode() & 0o7777
}

#[test]
fn a_directory_in_which_others_could_write_is_refused_and_another_one_is_put_right() {
    for mode in [0o777, 0o775, 0o702, 0o720, 0o1700, 0o2700] {
        let directory = directory(mode);
        let refused = make_owner_only(directory.path()).unwrap_err().to_string();
        assert!(
            refused.contains(&format!("has mode {mode:04o}")),
            "{refused}"
        );
        assert_eq!(mode_of(directory.path()), mode, "it is left as it is");
    }
    for mode in [0o700, 0o600, 0o500, 0o000, 0o755, 0o701] {
        let directory = directory(mode);
        make_owner_only(directory.path()).unwrap();
        assert_eq!(mode_of(directory.path()), 0o700, "of {mode:04o}");
    }
}

/// The umask is of the whole process, so a process of its own has it.
#[test]
fn directories_do_not_depend_on_the_umask() {
    const FOLDER: &str = "GYRE_TEST_FOLDER";
    if let Some(folder) = std::env::var_os(FOLDER) {
        rustix::process::umask(Mode::from_bits_retain(0o177));
        make_directory(&Path::new(&folder).join("made")).unwrap();
        gyre_storage::create_folder(&Path::new(&folder).join("out/log")).unwrap();
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (_, module) = module_path!().split_once("::").unwrap();
    let name = format!("{module}::directories_do_not_depend_on_the_umask");
    let ended = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", &name])
        .env(FOLDER, folder.path())
        .status();
    assert!(ended.unwrap().success());
    for made in ["made", "out", "out/log"] {
        assert_eq!(mode_of(&folder.path().join(made)), 0o700, "{made}");
    }
}

#[test]
fn a_link_or_a_file_in_place_of_the_directory_is_refused() {
    let directory = directory(0o700);
    let (link, file) = (directory.path().join("link"), directory.path().join("file"));
    symlink(directory.path(), &link).unwrap();
    fs::write(&file, b"").unwrap();
    for path in [link, file] {
        let refused = make_owner_only(&path).unwrap_err().to_string();
        assert!(refused.contains("is not a directory"), "{refused}");
    }
}
