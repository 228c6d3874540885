//! Scans in the memory of numpy arrays.

use gyre_datasets::ReadError;
use gyre_geometry::{
    PolarScan, ScanSlot, Sense, SweepGeometry,
    samples::{MAX_RATE_RADPS, MAX_SPEED_MPS, Sample, SampleKind},
    scan::flag,
};
use ndarray::{Ix1, Ix2, IxDyn};
use numpy::{
    PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyDict, PySlice},
};

use crate::{
    errors,
    lock::Guarded,
    numpy_arrays::{converted, given, readable},
    opened::Opened,
};

const POWER: &str = "a C-contiguous array of uint8 with shape (azimuths, range bins)";
const ANGLES: &str = "one float32 for each azimuth, rad";
const STAMPS: &str = "one int64 for each azimuth, ns";
const FLAGS: &str = "one uint8 for each azimuth";

/// One sweep of a radar: the powers of `azimuths` x `range bins`, with the angle and the time of
/// each azimuth.
///
/// `Dataset` reads scans of recordings. This constructor makes one of arrays of your own, without
/// copying `power`:
///
/// power: uint8 (azimuths, range bins), C-contiguous; nearest bin first. stamp_ns: the time of the
/// scan, ns: the middle of the sweep. range_resolution_m: the depth of a range bin, m. clockwise:
/// whether azimuths increase clockwise, seen from above. azimuth_stamp_ns: int64 (azimuths,), the
/// time of each azimuth, ns; or else sweep_s: the duration of the sweep, s, whose azimuths are
/// measured evenly in time. azimuth_rad: float32 (azimuths,), the angles from straight ahead in the
/// sense of rotation, rad; without them the first is straight ahead, and all are spaced evenly over
/// a turn. azimuth_flags: uint8 (azimuths,), the properties of each azimuth: 1 measured, 2 rising
/// chirp, 4 the chirp is known; without them all are measured. range_offset_m: m; the centre of bin
/// b is at (b + 0.5) * range_resolution_m + range_offset_m. doppler_s: metres to add to a range for
/// each m/s of closing speed; 0: unknown. gyro: the samples of a gyro since a turn before the
/// sweep: pairs of a time, ns, and a yaw rate, rad/s, counter-clockwise, in the order of their
/// times. wheels: likewise the wheels' speed, m/s.
///
/// Arrays that are written to while a scan is registered by another thread give undefined motions.
#[pyclass(module = "gyre", frozen)]
pub struct Scan {
    geometry: SweepGeometry,
    /// The memory of all bytes; `power` is a view of it.
    bytes: Py<PyAny>,
    /// The powers, uint8 (azimuths, range bins), nearest bin first: a view without the metadata
    /// that a file has before each row. Changes in it affect the registration.
    #[pyo3(get)]
    power: Py<PyAny>,
    /// The angle of each azimuth from straight ahead, float32 (azimuths,), rad, in the sense of
    /// rotation.
    #[pyo3(get)]
    azimuth_rad: Py<PyAny>,
    /// The time of each azimuth, int64 (azimuths,), ns.
    #[pyo3(get)]
    azimuth_stamp_ns: Py<PyAny>,
    /// Flags of each azimuth, uint8 (azimuths,): 1 measured, 2 rising chirp, 4 the chirp is known.
    #[pyo3(get)]
    azimuth_flags: Py<PyAny>,
    /// The index in the dataset; None for a scan of arrays.
    #[pyo3(get)]
    index: Option<usize>,
    /// Of a gyro and of wheels, since a turn before the sweep.
    samples: Vec<Sample>,
}

impl Scan {
    /// Decodes a scan of a dataset straight into arrays of numpy.
    pub fn read(
        py: Python<'_>,
        dataset: &Guarded<Opened>,
        index: usize,
    ) -> PyResult<Result<Self, ReadError>> {
        let limits = dataset.with(py, |dataset| dataset.scans.limits())?;
        let bytes = PyArray1::<u8>::zeros(py, limits.bytes, false);
        let azimuth_rad = PyArray1::<f32>::zeros(py, limits.azimuths, false);
        let stamps = PyArray1::<i64>::zeros(py, limits.azimuths, false);
        let flags = PyArray1::<u8>::zeros(py, limits.azimuths, false);
        let read = {
            let (mut bytes, mut angles) = (bytes.readwrite(), azimuth_rad.readwrite());
            let (mut stamps, mut flags) = (stamps.readwrite(), flags.readwrite());
            let slot = ScanSlot {
                bytes: bytes.as_slice_mut()?,
                azimuth_rad: angles.as_slice_mut()?,
                stamp_ns: stamps.as_slice_mut()?,
                flags: flags.as_slice_mut()?,
            };
            dataset.with(py, |dataset| dataset.read(index, slot))?
        };
        let (geometry, samples) = match read {
            Ok(read) => read,
            Err(error) => return Ok(Err(error)),
        };
        let first = |array: Bound<'_, PyAny>| -> PyResult<Py<PyAny>> {
            if array.len()? == geometry.azimuths {
                return Ok(array.unbind());
            }
            let part = PySlice::new(py, 0, geometry.azimuths as isize, 1);
            Ok(array.get_item(part)?.unbind())
        };
        Ok(Ok(Self {
            geometry,
            power: power(bytes.as_any(), &geometry)?.unbind(),
            bytes: bytes.into_any().unbind(),
            azimuth_rad: first(azimuth_rad.into_any())?,
            azimuth_stamp_ns: first(stamps.into_any())?,
            azimuth_flags: first(flags.into_any())?,
            index: Some(index),
            samples,
        }))
    }

    /// Returns the samples of the gyro and of the wheels.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    pub fn borrowed<'py>(&self, py: Python<'py>) -> PyResult<Borrowed<'py>> {
        Ok(Borrowed {
            geometry: self.geometry,
            bytes: readable::<u8, IxDyn>(self.bytes.bind(py), "power", POWER)?,
            azimuth_rad: readable(self.azimuth_rad.bind(py), "azimuth_rad", ANGLES)?,
            stamp_ns: readable(self.azimuth_stamp_ns.bind(py), "azimuth_stamp_ns", STAMPS)?,
            flags: readable(self.azimuth_flags.bind(py), "azimuth_flags", FLAGS)?,
        })
    }

    /// Checks a scan of given arrays.
    fn check(&self, py: Python<'_>) -> PyResult<()> {
        let borrowed = self.borrowed(py)?;
        let scan = borrowed.view()?;
        let azimuths = self.geometry.azimuths;
        for (name, len) in [
            ("azimuth_rad", scan.azimuth_rad.len()),
            ("azimuth_stamp_ns", scan.stamp_ns.len()),
            ("azimuth_flags", scan.flags.len()),
        ] {
            if len != azimuths {
                return Err(errors::scan(format!(
                    "{name} has {len} elements, but power has {azimuths} azimuths"
                )));
            }
        }
        scan.check().map_err(errors::scan)?;
        scan.check_times().map_err(errors::scan)
    }
}

pub struct Borrowed<'py> {
    geometry: SweepGeometry,
    bytes: PyReadonlyArrayDyn<'py, u8>,
    azimuth_rad: PyReadonlyArray1<'py, f32>,
    stamp_ns: PyReadonlyArray1<'py, i64>,
    flags: PyReadonlyArray1<'py, u8>,
}

impl Borrowed<'_> {
    /// Returns the scan. Its numbers are not checked.
    pub fn view(&self) -> PyResult<PolarScan<'_>> {
        Ok(PolarScan {
            geometry: self.geometry,
            bytes: self.bytes.as_slice()?,
            azimuth_rad: self.azimuth_rad.as_slice()?,
            stamp_ns: self.stamp_ns.as_slice()?,
            flags: self.flags.as_slice()?,
        })
    }
}

fn power<'py>(bytes: &Bound<'py, PyAny>, geometry: &SweepGeometry) -> PyResult<Bound<'py, PyAny>> {
    let py = bytes.py();
    let keywords = PyDict::new(py);
    keywords.set_item("buffer", bytes)?;
    keywords.set_item("offset", geometry.first_byte)?;
    keywords.set_item("strides", (geometry.stride, 1))?;
    let (shape, dtype) = ((geometry.azimuths, geometry.bins), numpy::dtype::<u8>(py));
    let array = py.import("numpy")?.getattr("ndarray")?;
    array.call((shape, dtype), Some(&keywords))
}

/// Returns the layout of powers that can be read in place.
fn layout(power: &Bound<'_, PyAny>) -> PyResult<SweepGeometry> {
    let array = given::<u8, Ix2>(power, "power", POWER)?;
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(
            "power is not C-contiguous, and is not copied silently: pass np.ascontiguousarray(power)",
        ));
    }
    let [azimuths, bins] = [array.shape()[0], array.shape()[1]];
    if azimuths == 0 || bins == 0 {
        return Err(errors::scan(format!(
            "power has shape ({azimuths}, {bins}), but a scan has azimuths and range bins"
        )));
    }
    Ok(SweepGeometry {
        azimuths,
        bins,
        stride: bins,
        ..SweepGeometry::default()
    })
}

fn stamps<'py>(
    py: Python<'py>,
    geometry: &SweepGeometry,
    given: Option<&Bound<'py, PyAny>>,
    sweep_s: Option<f64>,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    match (given, sweep_s) {
        (Some(stamps), None) => converted(stamps, "azimuth_stamp_ns", STAMPS),
        (None, Some(sweep_s)) => Ok(PyArray1::from_vec(py, even_stamps_ns(geometry, sweep_s)?)),
        _ => Err(errors::scan(
            "the times of the azimuths are needed: pass either azimuth_stamp_ns, one int64 for each, or sweep_s, the duration of the sweep",
        )),
    }
}

/// Returns times of azimuths at equal intervals, with the scan's time as their mean.
fn even_stamps_ns(geometry: &SweepGeometry, sweep_s: f64) -> PyResult<Vec<i64>> {
    if !(sweep_s > 0.0 && sweep_s <= 10.0) {
        let sentence = format!("sweep_s is {sweep_s}, but must be above 0 and at most 10 s");
        return Err(errors::scan(sentence));
    }
    let (stamp_ns, azimuths) = (geometry.stamp_ns, geometry.azimuths);
    let (sweep_ns, n) = ((sweep_s * 1e9) as i64, azimuths.max(1) as i64);
    let start_ns = stamp_ns.saturating_sub(sweep_ns * (n - 1) / (2 * n));
    let stamps =
        (0..azimuths as i64).map(|azimuth| start_ns.saturating_add(sweep_ns * azimuth / n));
    Ok(stamps.collect())
}

/// Times, ns, and values.
type Pairs = Vec<(i64, f64)>;

fn samples(rates: Pairs, speeds: Pairs) -> PyResult<Vec<Sample>> {
    let rates = rates.into_iter().map(|(ns, of)| Sample::yaw_rate(ns, of));
    let speeds = speeds.into_iter().map(|(ns, of)| Sample::speed(ns, of));
    let expected = format!("rates are at most {MAX_RATE_RADPS} rad/s");
    let mut samples = checked("gyro", rates.collect(), &expected)?;
    let expected = format!("speeds are at most {MAX_SPEED_MPS} m/s");
    samples.extend(checked("wheels", speeds.collect(), &expected)?);
    samples.sort_by_key(Sample::order);
    Ok(samples)
}

fn checked(name: &str, samples: Vec<Sample>, expected: &str) -> PyResult<Vec<Sample>> {
    let is_later = |pair: &[Sample]| pair[0].stamp_ns < pair[1].stamp_ns;
    if !samples.windows(2).all(is_later) {
        return Err(errors::scan(format!("the times of {name} must increase")));
    }
    match samples.iter().position(|sample| !sample.is_valid()) {
        None => Ok(samples),
        Some(at) => Err(errors::scan(format!(
            "{name} is no finite number, or too large, in pair {at}: {expected}"
        ))),
    }
}

fn pairs(samples: &[Sample], kind: SampleKind, value: usize) -> Vec<(i64, f64)> {
    let of_kind = samples.iter().filter(|sample| sample.is(kind));
    let pair = |sample: &Sample| (sample.stamp_ns, sample.values[value]);
    of_kind.map(pair).collect()
}

fn even_angles_rad(azimuths: usize) -> Vec<f32> {
    let step = std::f64::consts::TAU / azimuths as f64;
    let angle = |azimuth| (azimuth as f64 * step) as f32;
    (0..azimuths).map(angle).collect()
}

#[pymethods]
impl Scan {
    #[new]
    #[pyo3(signature = (power, *, stamp_ns, range_resolution_m, clockwise, azimuth_stamp_ns=None, sweep_s=None, azimuth_rad=None,
        azimuth_flags=None, range_offset_m=0.0, doppler_s=0.0, gyro=None, wheels=None))]
    #[allow(clippy::too_many_arguments)] // They are keywords.
    fn new(
        power: &Bound<'_, PyAny>,
        stamp_ns: i64,
        range_resolution_m: f32,
        clockwise: bool,
        azimuth_stamp_ns: Option<&Bound<'_, PyAny>>,
        sweep_s: Option<f64>,
        azimuth_rad: Option<&Bound<'_, PyAny>>,
        azimuth_flags: Option<&Bound<'_, PyAny>>,
        range_offset_m: f32,
        doppler_s: f32,
        gyro: Option<Vec<(i64, f64)>>,
        wheels: Option<Vec<(i64, f64)>>,
    ) -> PyResult<Self> {
        let py = power.py();
        let geometry = SweepGeometry {
            range_resolution_m,
            range_offset_m,
            doppler_s,
            sense: match clockwise {
                true => Sense::Clockwise,
                false => Sense::CounterClockwise,
            },
            stamp_ns,
            ..layout(power)?
        };
        let stamps = stamps(py, &geometry, azimuth_stamp_ns, sweep_s)?;
        let angles = match azimuth_rad {
            Some(angles) => converted(angles, "azimuth_rad", ANGLES)?,
            None => PyArray1::from_vec(py, even_angles_rad(geometry.azimuths)),
        };
        let flags = match azimuth_flags {
            Some(flags) => given::<u8, Ix1>(flags, "azimuth_flags", FLAGS)?,
            None => PyArray1::from_vec(py, vec![flag::MEASURED; geometry.azimuths]),
        };
        let scan = Self {
            geometry,
            bytes: power.clone().unbind(),
            power: power.clone().unbind(),
            azimuth_rad: angles.into_any().unbind(),
            azimuth_stamp_ns: stamps.into_any().unbind(),
            azimuth_flags: flags.into_any().unbind(),
            index: None,
            samples: samples(gyro.unwrap_or_default(), wheels.unwrap_or_default())?,
        };
        scan.check(py)?;
        Ok(scan)
    }

    /// The time of the scan, ns: the middle of the sweep.
    #[getter]
    fn stamp_ns(&self) -> i64 {
        self.geometry.stamp_ns
    }

    /// The depth of a range bin, m.
    #[getter]
    fn range_resolution_m(&self) -> f32 {
        self.geometry.range_resolution_m
    }

    /// The offset of the ranges, m: the centre of bin b is at (b + 0.5) * range_resolution_m +
    /// range_offset_m.
    #[getter]
    fn range_offset_m(&self) -> f32 {
        self.geometry.range_offset_m
    }

    /// Metres to add to a range for each m/s of closing speed; 0: unknown.
    #[getter]
    fn doppler_s(&self) -> f32 {
        self.geometry.doppler_s
    }

    /// Returns whether azimuths increase clockwise, seen from above.
    #[getter]
    fn clockwise(&self) -> bool {
        self.geometry.sense == Sense::Clockwise
    }

    /// The samples of the gyro that come with the scan: pairs of a time, ns, and a yaw
    /// rate, rad/s, counter-clockwise, with its bias.
    #[getter]
    fn gyro(&self) -> Vec<(i64, f64)> {
        pairs(&self.samples, SampleKind::Gyro, 2)
    }

    /// The samples of the wheels that come with the scan: pairs of a time, ns, and a speed, m/s.
    #[getter]
    fn wheels(&self) -> Vec<(i64, f64)> {
        pairs(&self.samples, SampleKind::Wheels, 0)
    }

    fn __repr__(&self) -> String {
        let of = &self.geometry;
        let (azimuths, bins, stamp_ns) = (of.azimuths, of.bins, of.stamp_ns);
        let resolution_m = of.range_resolution_m;
        format!("<gyre.Scan {azimuths} x {bins} at {resolution_m} m, stamp_ns={stamp_ns}>")
    }
}
