//! Recordings.

use std::{
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};

use gyre_configuration::radar_constants;
use gyre_datasets::{DatasetOptions, ScanSamples, check_first_scan};
use numpy::PyArray1;
use pyo3::{exceptions::PyIndexError, prelude::*, types::PyTuple};

use crate::{config::Config, errors, lock::Guarded, opened::Opened, scan::Scan};

/// Damaged scans in a row that are skipped: the default of `source.max_unreadable` of a run.
const MAX_UNREADABLE: usize = 10;

/// Opens a recording: a folder of a format that Gyre knows, an MCAP file of `gyre record`, or a bag
/// of ROS 2.
///
/// With a section `gyro` or `wheels` in `config` the scans have the samples that it names.
///
/// The constants of the radar come from the section `dataset` of `config`. Without `config` they
/// come from the format, or from the recording's `dataset.toml`, as in `Config.of`. Raises
/// ReadError.
#[pyfunction]
#[pyo3(signature = (data, config=None))]
pub fn open(
    py: Python<'_>,
    data: PathBuf,
    config: Option<&Bound<'_, Config>>,
) -> PyResult<Dataset> {
    let method = Config::method(config);
    let options = config.map(|_| method.dataset);
    let opened = py.detach(|| -> PyResult<Opened> {
        let found = || radar_constants(&data, &DatasetOptions::default());
        let options = options.map_or_else(found, Ok).map_err(errors::automatic)?;
        let mut scans = gyre_recording::open(&data, &options).map_err(errors::open)?;
        let samples = ScanSamples::open(&method.odometry.sensors.sampled(), &data, scans.as_mut());
        let samples = samples.map_err(errors::log)?;
        if method.odometry.sensors.doppler.is_used() {
            check_first_scan(scans.as_mut()).map_err(errors::doppler)?;
        }
        Ok(Opened { scans, samples })
    })?;
    let scans = &opened.scans;
    Ok(Dataset {
        format: scans.format().name(),
        len: scans.len(),
        first: scans.first(),
        data,
        config: config.map(|config| config.clone().unbind()),
        dataset: Arc::new(Guarded::new("Dataset", opened)),
    })
}

/// Returns the file of the ground truth of a recording, if there is one at a usual path; else None.
#[pyfunction]
pub fn find_ground_truth(data: PathBuf) -> Option<PathBuf> {
    gyre_datasets::find_ground_truth(&data)
}

/// The scans of a recording, ordered by time.
///
/// `dataset[i]` decodes scan i, and raises ReadError if it cannot be read. Iteration plays the
/// scans as `gyre run` does: it begins at `first`, skips damaged scans with a SkippedScanWarning,
/// and raises ReadError after ten of them in a row, or where a file cannot be read.
///
/// A pickled dataset is opened again where it is unpickled, as in a process of `multiprocessing`.
#[pyclass(module = "gyre", frozen)]
pub struct Dataset {
    data: PathBuf,
    config: Option<Py<Config>>,
    /// The name of the format, as in `oxford`.
    #[pyo3(get)]
    format: &'static str,
    len: usize,
    /// The index of the first scan that can be read; not 0 in a recording of a run that was
    /// resumed.
    #[pyo3(get)]
    first: usize,
    dataset: Arc<Guarded<Opened>>,
}

#[pymethods]
impl Dataset {
    /// The files of the scans, in order; of an MCAP recording its parts, of a bag of ROS 2 its
    /// files.
    #[getter]
    fn files(&self, py: Python<'_>) -> PyResult<Vec<PathBuf>> {
        self.dataset
            .with(py, |dataset| dataset.scans.files().to_vec())
    }

    /// The time of each scan as far as it is known without decoding it, int64 (scans,), ns; -1
    /// where it is not.
    #[getter]
    fn stamp_ns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let stamps = self.dataset.with(py, |dataset| {
            let stamp = |index| dataset.scans.nominal_stamp_ns(index).unwrap_or(-1);
            (0..dataset.scans.len()).map(stamp).collect()
        })?;
        Ok(PyArray1::from_vec(py, stamps))
    }

    /// The median time between two scans, ns.
    #[getter]
    fn period_ns(&self, py: Python<'_>) -> PyResult<i64> {
        self.dataset.with(py, |dataset| dataset.scans.period_ns())
    }

    /// Observations of the reader: whole sentences.
    #[getter]
    fn notes(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.dataset
            .with(py, |dataset| dataset.scans.notes().to_vec())
    }

    fn __len__(&self) -> usize {
        self.len
    }

    fn __getitem__(&self, py: Python<'_>, index: isize) -> PyResult<Scan> {
        let counted = match index < 0 {
            true => self.len.checked_add_signed(index),
            false => usize::try_from(index).ok(),
        };
        let Some(index) = counted.filter(|index| *index < self.len) else {
            let sentence = format!("there is no scan {index}: the dataset has {}", self.len);
            return Err(PyIndexError::new_err(sentence));
        };
        Scan::read(py, &self.dataset, index)?.map_err(errors::read)
    }

    fn __iter__(&self) -> Scans {
        self.scans(None, None)
    }

    /// Iterates over `count` scans from number `first` on, as iteration over the dataset does over
    /// all: by default it begins at the first scan that can be read, and ends with the last one.
    #[pyo3(signature = (first=None, count=None))]
    fn scans(&self, first: Option<usize>, count: Option<usize>) -> Scans {
        let first = first.unwrap_or(self.first);
        Scans {
            dataset: self.dataset.clone(),
            next: AtomicUsize::new(first.min(self.len)),
            end: count.map_or(self.len, |count| first.saturating_add(count).min(self.len)),
        }
    }

    /// Returns how `pickle` opens the dataset again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let open = py.import("gyre")?.getattr("open")?;
        (open, (&self.data, &self.config)).into_pyobject(py)
    }

    fn __repr__(&self) -> String {
        let (data, format, len) = (self.data.display(), self.format, self.len);
        format!("<gyre.Dataset {data}: {format}, {len} scans>")
    }
}

/// An iteration over a dataset.
#[pyclass(module = "gyre", frozen)]
pub struct Scans {
    dataset: Arc<Guarded<Opened>>,
    next: AtomicUsize,
    end: usize,
}

#[pymethods]
impl Scans {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Scan>> {
        let mut skipped = 0;
        loop {
            let index = self.next.fetch_add(1, Ordering::Relaxed);
            if index >= self.end {
                self.next.store(self.end, Ordering::Relaxed);
                return Ok(None);
            }
            match Scan::read(py, &self.dataset, index)? {
                Ok(scan) => return Ok(Some(scan)),
                Err(error) if error.is_io() || skipped == MAX_UNREADABLE => {
                    return Err(errors::read(error));
                }
                Err(error) => errors::warn_of_skipped(py, error)?,
            }
            skipped += 1;
        }
    }
}
