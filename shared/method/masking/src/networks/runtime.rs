//! Finds and opens the library of ONNX Runtime at run time. It computes networks fastest.

use std::{
    env,
    error::Error as _,
    ffi::OsString,
    fs::{self, DirEntry},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use ort::{
    LoadDynamicError,
    environment::Environment,
    logging::LogLevel,
    session::{Session, builder::SessionBuilder},
};
use thiserror::Error;

/// The command that installs it in the user's data folder: the release of `models/onnxruntime.txt`.
/// The library does not depend on the version of Python.
pub const INSTALL: &str = "python3 -m pip install --no-deps --python-version 3.12 --target \"${XDG_DATA_HOME:-$HOME/.local/share}/gyre/onnxruntime\" onnxruntime==1.31.1";
const VARIABLE: &str = "ORT_DYLIB_PATH";
/// The folder that [`INSTALL`] creates in Gyre's data folder; beside the program it has the same
/// name.
const INSTALLED: &str = "onnxruntime";
/// Positions of the library in a named folder: the folder itself, the package, the parent of the
/// package.
const PLACES: [&str; 3] = ["", "capi", "onnxruntime/capi"];
const LIBRARY: &str = "libonnxruntime.so";
/// The folder of the packages among which Gyre's own Python package is, in a process that uses it.
static PACKAGES: OnceLock<PathBuf> = OnceLock::new();

#[derive(Debug, Error)]
pub enum RuntimeError {
    #[error(
        "ONNX Runtime is not installed: `{INSTALL}` installs it; masking.runtime or {VARIABLE} names one in another place; \
         masking.backend = \"rten\" does not need it"
    )]
    Missing,
    #[error("{0}")]
    Unusable(String),
}

/// Returns the path of the library: named by `configured` (`masking.runtime`) or by the
/// environment, installed by [`INSTALL`], beside this program, or a package of the Python that
/// Gyre is installed in. A library is code, so no folder is searched that is not the user's own or
/// the program's; the current one may be anybody's.
pub fn find(configured: Option<&Path>) -> Result<PathBuf, RuntimeError> {
    find_in(configured, env::var_os(VARIABLE), &installed_in())
}

fn find_in(
    configured: Option<&Path>,
    variable: Option<OsString>,
    installed_in: &[PathBuf],
) -> Result<PathBuf, RuntimeError> {
    let variable = variable.filter(|path| !path.is_empty()).map(PathBuf::from);
    let named = match (configured, variable) {
        (Some(path), _) => Some(("masking.runtime", path.to_owned())),
        (None, Some(path)) => Some((VARIABLE, path)),
        (None, None) => None,
    };
    if let Some((named_by, path)) = named {
        let shown = path.display();
        return library_at(&path).ok_or_else(|| {
            RuntimeError::Unusable(format!(
                "{named_by} is {shown}, but there is no {LIBRARY}: correct it, or leave it out and run `{INSTALL}`"
            ))
        });
    }
    installed_in
        .iter()
        .filter_map(|folder| library_at(&folder.join(INSTALLED)))
        // An older one was installed for other programs.
        .find(|library| !is_too_old(library))
        .ok_or(RuntimeError::Missing)
}

/// Returns the folders of an installed library: the user's data, the folder of this program, then
/// the packages of Python beside it.
fn installed_in() -> Vec<PathBuf> {
    let program = env::current_exe().ok();
    let program =
        program.and_then(|program| Some(program.canonicalize().ok()?.parent()?.to_owned()));
    let data = data_folder(env::var_os("XDG_DATA_HOME"), env::var_os("HOME"));
    let packages = program.as_deref().map(packages_beside).unwrap_or_default();
    let named = PACKAGES.get().cloned();
    data.into_iter()
        .chain(program)
        .chain(named)
        .chain(packages)
        .collect()
}

/// Names the folder of the packages among which Gyre's own Python package is: [`find`] looks there
/// too. Only the first call counts.
pub fn search_packages(folder: PathBuf) {
    PACKAGES.get_or_init(|| folder);
}

fn packages_beside(bin: &Path) -> Vec<PathBuf> {
    let lib = bin.parent().map(|environment| environment.join("lib"));
    let entries = lib.and_then(|lib| fs::read_dir(lib).ok());
    let entries = entries.into_iter().flatten().flatten();
    let versions = entries.filter(|entry| {
        let name = entry.file_name();
        name.to_string_lossy().starts_with("python3.")
    });
    let packages = |version: DirEntry| {
        ["site-packages", "dist-packages"].map(|name| version.path().join(name))
    };
    let mut found: Vec<PathBuf> = versions.flat_map(packages).collect();
    found.sort();
    found
}

/// Returns the folder of Gyre's data. A relative path would be in the current folder and is
/// ignored, as the XDG specification demands.
fn data_folder(data_home: Option<OsString>, home: Option<OsString>) -> Option<PathBuf> {
    let absolute =
        |path: Option<OsString>| path.map(PathBuf::from).filter(|path| path.is_absolute());
    let data = absolute(data_home).or_else(|| Some(absolute(home)?.join(".local/share")))?;
    Some(data.join("gyre"))
}

/// Returns the library at a path or in a folder, absolute, since stages may be started in another
/// folder.
fn library_at(path: &Path) -> Option<PathBuf> {
    let path = path.canonicalize().ok()?;
    if path.is_file() {
        return Some(path);
    }
    PLACES.iter().find_map(|place| {
        let files = fs::read_dir(path.join(place))
            .ok()?
            .flatten()
            .map(|file| file.path());
        files
            .filter_map(|file| Some((version(&file)?, file)))
            .max()
            .map(|(_, file)| file)
    })
}

/// Returns the version after `libonnxruntime.so`; empty without one.
fn version(file: &Path) -> Option<Vec<u32>> {
    let suffix = file.file_name()?.to_str()?.strip_prefix(LIBRARY)?;
    let mut numbers = suffix.split('.');
    numbers.next().filter(|between| between.is_empty())?;
    numbers.map(|number| number.parse().ok()).collect()
}

/// Returns whether the name of a library contains an older version than the required one.
fn is_too_old(file: &Path) -> bool {
    let version = version(file).filter(|version| version.len() > 1);
    version.is_some_and(|version| version < vec![1, ort::MINOR_VERSION])
}

/// Opens the library. A process opens only one: later calls return the first one that succeeded.
pub fn open(path: &Path) -> Result<Environment, RuntimeError> {
    static OPENED: Mutex<Option<Environment>> = Mutex::new(None);
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(environment) = &*opened {
        return Ok(environment.clone());
    }
    let named = path.display();
    let unusable = |reason: &str| {
        RuntimeError::Unusable(format!(
            "{named} cannot be used as ONNX Runtime: {reason}; `{INSTALL}` installs one"
        ))
    };
    let builder = ort::init_from(path).map_err(|error| match error {
        LoadDynamicError::BadVersion { version_str, path } => RuntimeError::Unusable(format!(
            "ONNX Runtime at {} is version {version_str}, but at least 1.{} is needed: `{INSTALL}` installs one",
            path.display(),
            ort::MINOR_VERSION
        )),
        LoadDynamicError::Dlopen { error, .. } => {
            let reason = error.source().map_or_else(|| error.to_string(), ToString::to_string);
            // The dynamic linker's message starts with the file.
            unusable(reason.trim_start_matches(&format!("{named}: ")))
        }
        LoadDynamicError::MissingApi { .. } => unusable("it does not have ONNX Runtime's functions"),
        LoadDynamicError::InvalidVersionString => unusable("its version is not text"),
    })?;
    // Errors are returned; other messages go to the run's log.
    let log = |level, _: &str, _: &str, location: &str, message: &str| match level {
        LogLevel::Error | LogLevel::Fatal => tracing::warn!(location, "ONNX Runtime: {message}"),
        _ => tracing::debug!(location, "ONNX Runtime: {message}"),
    };
    let environment = builder
        .with_telemetry(false)
        .with_logger(Arc::new(log))
        .build();
    let environment = environment.map_err(|error| unusable(&error.to_string()))?;
    environment.set_log_level(LogLevel::Error);
    Ok(opened.insert(environment).clone())
}

/// Returns a builder of sessions whose results are the same to the byte each time.
pub fn session(environment: &Environment, threads: usize) -> ort::Result<SessionBuilder> {
    let builder = Session::builder(environment)?
        .with_intra_threads(threads)?
        .with_inter_threads(1)?;
    // No spinning: between scans the other stages need the processor.
    Ok(builder
        .with_intra_op_spinning(false)?
        .with_deterministic_compute(true)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder_with(file: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().canonicalize().unwrap().join(file);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, "").unwrap();
        (folder, file)
    }

    #[test]
    fn the_configuration_precedes_the_environment_and_that_the_installed_library() {
        let (named, first) = folder_with("libonnxruntime.so.1.31.1");
        let (package, second) = folder_with("onnxruntime/capi/libonnxruntime.so.1.31.1");
        let (project, third) = folder_with("onnxruntime/onnxruntime/capi/libonnxruntime.so.1.31.1");
        let installed_in = [PathBuf::from("/nowhere"), project.path().to_owned()];
        let variable = || Some(package.path().as_os_str().to_owned());
        assert_eq!(
            find_in(Some(&first), variable(), &installed_in).unwrap(),
            first
        );
        assert_eq!(
            find_in(Some(named.path()), variable(), &installed_in).unwrap(),
            first
        );
        assert_eq!(find_in(None, variable(), &installed_in).unwrap(), second);
        assert_eq!(
            find_in(None, Some(OsString::new()), &installed_in).unwrap(),
            third
        );
        assert_eq!(find_in(None, None, &installed_in).unwrap(), third);
    }

    #[test]
    fn the_data_of_a_user_are_in_no_relative_folder() {
        let of = |data_home: &str, home: &str| {
            let folder = data_folder(Some(data_home.into()), Some(home.into()));
            folder.map(|folder| folder.display().to_string())
        };
        for relative in ["", ".", "gyre/.."] {
            assert_eq!(of(relative, relative), None, "{relative}");
            let home = of(relative, "/home/a");
            assert_eq!(home.as_deref(), Some("/home/a/.local/share/gyre"));
        }
        assert_eq!(of("/data", "").as_deref(), Some("/data/gyre"));
    }

    #[test]
    fn the_library_is_found_among_the_packages_of_the_environment_of_the_program() {
        let package = "lib/python3.12/site-packages/onnxruntime/capi/libonnxruntime.so.1.31.1";
        let (environment, library) = folder_with(package);
        let found_from = |bin: &str| {
            let packages = packages_beside(&environment.path().join(bin));
            find_in(None, None, &packages).ok()
        };
        assert_eq!(found_from("bin"), Some(library));
        assert_eq!(found_from("bin/deeper"), None);
        assert_eq!(found_from("no/such"), None);
    }

    #[test]
    fn a_library_that_is_too_old_is_passed_over_unless_it_is_named() {
        let (old, library) = folder_with("onnxruntime/capi/libonnxruntime.so.1.9.0");
        let (new, newer) = folder_with("onnxruntime/capi/libonnxruntime.so.1.31.1");
        let folders = [old.path().to_owned(), new.path().to_owned()];
        assert_eq!(find_in(None, None, &folders).unwrap(), newer);
        assert!(matches!(
            find_in(None, None, &folders[..1]),
            Err(RuntimeError::Missing)
        ));
        assert_eq!(find_in(Some(old.path()), None, &folders).unwrap(), library);
    }

    #[test]
    fn the_command_installs_the_release_of_the_requirements() {
        let requirements = include_str!("../../../../../models/onnxruntime.txt");
        let release = INSTALL.rsplit(' ').next().unwrap();
        assert!(requirements.contains(&format!("\n{release} ")), "{release}");
    }

    #[test]
    fn the_newest_of_several_libraries_is_taken() {
        let (folder, newest) = folder_with("libonnxruntime.so.1.31.1");
        for other in [
            "libonnxruntime.so",
            "libonnxruntime.so.1.9.0",
            "libonnxruntime.so9",
            "libonnxruntime.so.2.txt",
        ] {
            fs::write(folder.path().join(other), "").unwrap();
        }
        assert_eq!(find_in(Some(folder.path()), None, &[]).unwrap(), newest);
    }
}
