//! Finds ONNX Runtime's library and opens it. Nothing of Gyre is linked against it: who uses no learned mask needs none.

use std::{
    env,
    error::Error as _,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
};

use ort::{LoadDynamicError, environment::Environment, logging::LogLevel};
use thiserror::Error;

/// What installs it, in Gyre's folder. The package's library serves any Python, so one version of the package will do.
pub const INSTALL: &str = "python3 -m pip install --no-deps --python-version 3.12 --target onnxruntime -r models/onnxruntime.txt";
/// The environment variable that may name it.
const VARIABLE: &str = "ORT_DYLIB_PATH";
/// The folder that [`INSTALL`] makes.
const INSTALLED: &str = "onnxruntime";
/// Where the library is in a folder that is named: by itself, in the package, in the package's own folder.
const PLACES: [&str; 3] = ["", "capi", "onnxruntime/capi"];
const LIBRARY: &str = "libonnxruntime.so";
/// From a binary in `target/release/deps` up to the project.
const ABOVE_THE_EXECUTABLE: usize = 4;

/// Why there is no ONNX Runtime.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// It is nowhere.
    #[error(
        "a learned mask needs ONNX Runtime, which is not installed: `{INSTALL}` in Gyre's folder installs it; \
         one that is elsewhere is named by masking.runtime or {VARIABLE}; masking.kind = \"threshold\" needs none"
    )]
    Missing,
    /// It is not where it is said to be.
    #[error(
        "{named_by} is {path}, but there is no {LIBRARY}: correct it, or leave it out and run `{INSTALL}`"
    )]
    NotThere {
        /// What says so.
        named_by: &'static str,
        /// Where.
        path: PathBuf,
    },
    /// It is too old.
    #[error(
        "ONNX Runtime at {path} is version {version}, but at least 1.{} is needed: `{INSTALL}` installs one",
        ort::MINOR_VERSION
    )]
    TooOld {
        /// Its place.
        path: PathBuf,
        /// Its version.
        version: String,
    },
    /// It is something else, or broken, or for another machine.
    #[error("{path} cannot be used as ONNX Runtime: {reason}; `{INSTALL}` installs one")]
    Unusable {
        /// Its place.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

/// The library: what `configured` (`masking.runtime`) names, or the environment, or what [`INSTALL`] installed.
///
/// # Errors
/// [`RuntimeError::NotThere`] where a name leads nowhere, [`RuntimeError::Missing`] where nothing names it and it is not installed.
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
        return library_at(&path).ok_or(RuntimeError::NotThere { named_by, path });
    }
    installed_in
        .iter()
        .find_map(|folder| library_at(&folder.join(INSTALLED)))
        .ok_or(RuntimeError::Missing)
}

/// Folders in which [`INSTALL`] may have been run: the current one, those above this program, and the user's own.
fn installed_in() -> Vec<PathBuf> {
    let current = env::current_dir().ok();
    let program = env::current_exe().ok();
    let above = program
        .iter()
        .flat_map(|program| program.ancestors().skip(1).take(ABOVE_THE_EXECUTABLE));
    let home = || env::var_os("HOME").map(|home| Path::new(&home).join(".local/share"));
    let data = env::var_os("XDG_DATA_HOME")
        .filter(|data| !data.is_empty())
        .map(PathBuf::from)
        .or_else(home);
    let own = data.map(|data| data.join("gyre"));
    current
        .into_iter()
        .chain(above.map(Path::to_owned))
        .chain(own)
        .collect()
}

/// The library itself, or that in a folder; absolute, since stages may be started elsewhere.
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
        // The newest, where several versions lie side by side.
        files
            .filter_map(|file| Some((version(&file)?, file)))
            .max()
            .map(|(_, file)| file)
    })
}

/// The version behind `libonnxruntime.so`; none of its numbers where there is none.
fn version(file: &Path) -> Option<Vec<u32>> {
    let behind = file.file_name()?.to_str()?.strip_prefix(LIBRARY)?;
    let mut numbers = behind.split('.');
    numbers.next().filter(|between| between.is_empty())?;
    numbers.map(|number| number.parse().ok()).collect()
}

/// Opens the library. A process has one: later calls return what the first one that succeeded opened.
///
/// # Errors
/// A file that is no library of ONNX Runtime, or of one that is too old.
pub fn open(path: &Path) -> Result<Environment, RuntimeError> {
    static OPENED: Mutex<Option<Environment>> = Mutex::new(None);
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(environment) = &*opened {
        return Ok(environment.clone());
    }
    let unusable = |reason: String| RuntimeError::Unusable {
        path: path.to_owned(),
        reason,
    };
    let builder = ort::init_from(path).map_err(|error| match error {
        LoadDynamicError::BadVersion { version_str, path } => RuntimeError::TooOld {
            path,
            version: version_str,
        },
        LoadDynamicError::Dlopen { error, .. } => {
            let reason = error
                .source()
                .map_or_else(|| error.to_string(), ToString::to_string);
            // The system's linker names the file first.
            unusable(
                reason
                    .trim_start_matches(&format!("{}: ", path.display()))
                    .to_owned(),
            )
        }
        LoadDynamicError::MissingApi { .. } => {
            unusable("it does not have ONNX Runtime's functions".to_owned())
        }
        LoadDynamicError::InvalidVersionString => unusable("its version is not text".to_owned()),
    })?;
    // Errors reach us as such; what it prints besides belongs into the run's log.
    let log = |level, _: &str, _: &str, place: &str, message: &str| match level {
        LogLevel::Error | LogLevel::Fatal => tracing::warn!(place, "ONNX Runtime: {message}"),
        _ => tracing::debug!(place, "ONNX Runtime: {message}"),
    };
    let environment = builder
        .with_telemetry(false)
        .with_logger(Arc::new(log))
        .build();
    let environment = environment.map_err(|error| unusable(error.to_string()))?;
    environment.set_log_level(LogLevel::Error);
    Ok(opened.insert(environment).clone())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A folder with an empty file of this name.
    fn folder_with(file: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().canonicalize().unwrap().join(file);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, "").unwrap();
        (folder, file)
    }

    #[test]
    fn the_configuration_wins_over_the_environment_and_that_over_what_is_installed() {
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
    fn what_is_named_and_not_there_is_not_looked_for_elsewhere() {
        let (project, _) = folder_with("onnxruntime/capi/libonnxruntime.so");
        let installed_in = [project.path().to_owned()];
        let error = find_in(Some(Path::new("/no/such")), None, &installed_in)
            .unwrap_err()
            .to_string();
        assert!(error.contains("masking.runtime is /no/such"), "{error}");
        let error = find_in(None, Some("/no/such".into()), &installed_in)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("ORT_DYLIB_PATH is /no/such") && error.contains(INSTALL),
            "{error}"
        );
    }

    #[test]
    fn the_newest_of_several_is_taken_and_nothing_that_is_no_library() {
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

    #[test]
    fn without_a_library_the_sentence_has_the_command_that_installs_it() {
        let (folder, _) = folder_with("onnxruntime/capi/libonnxruntime_providers_shared.so");
        let error = find_in(None, None, &[folder.path().to_owned()])
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("not installed") && error.contains(INSTALL) && !error.contains('\n'),
            "{error}"
        );
    }

    #[test]
    fn a_file_that_is_no_library_is_refused() {
        let (_folder, file) = folder_with("libonnxruntime.so");
        let error = open(&file).unwrap_err().to_string();
        assert!(
            error.contains("cannot be used as ONNX Runtime") && error.contains(INSTALL),
            "{error}"
        );
    }
}
