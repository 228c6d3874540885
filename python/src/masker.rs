//! Masks.

use gyre_geometry::{PolarScan, SparsePoint, Twist, continues};
use gyre_masking::Sweep;
use gyre_matching::odometry::OdometryError;
use gyre_radar::{LostAzimuthFinder, PlacedRows};
use ndarray::ArrayViewMut2;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyUntypedArray};
use pyo3::{exceptions::PyTypeError, prelude::*, types::PySlice};

use crate::{
    config::Config,
    errors,
    lock::Guarded,
    numpy_arrays::{readable, sliceable},
    scan::Scan,
};

pub const FIELDS: [&str; 5] = ["x_m", "y_m", "time_s", "weight", "doppler_s"];

/// Rasterises and masks scans, and extracts their sparse points.
#[pyclass(module = "gyre", frozen)]
pub struct Masker {
    masker: Guarded<State>,
    n: usize,
    capacity: usize,
    pairs: bool,
}

struct State {
    masker: gyre_masking::Masker,
    /// Puts rows where they were measured, if azimuths of a scan were lost.
    finder: LostAzimuthFinder,
    rows: PlacedRows,
    /// The number and the time of the last masked scan.
    last: Option<(u64, i64)>,
}

/// A masked scan: what `Masker.mask` returns.
#[pyclass(module = "gyre", frozen, get_all)]
pub struct Masked {
    /// The raster of powers, motion-compensated and masked: float32 (n, n), row 0 far ahead, column
    /// 0 far to the left. A cell is `raster.cell_m` wide, and the sensor is in the middle.
    raster: Py<PyArray2<f32>>,
    /// The raster of the previous scan, masked for this pair, float32 (n, n), if the mask takes two
    /// scans; else None.
    previous: Option<Py<PyArray2<f32>>>,
    /// The strongest returns as measured, a structured array with the float32 fields `x_m` and
    /// `y_m` in the sensor's frame at the time of the azimuth, `time_s` relative to the scan's
    /// stamp, `weight` from 0 to 1, and `doppler_s`.
    points: Py<PyAny>,
    /// The factors of a learned mask, float32 (n, n) from 0 to 1; None without a network.
    factors: Option<Py<PyArray2<f32>>>,
}

/// Returns the first points of an array of their fields, one after the other: a view.
pub fn points<'py>(
    fields: &Bound<'py, PyArray1<f32>>,
    count: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let dtype: Vec<(&str, &str)> = FIELDS.into_iter().map(|field| (field, "f4")).collect();
    let used = PySlice::new(fields.py(), 0, (count * FIELDS.len()) as isize, 1);
    fields.get_item(used)?.call_method1("view", (dtype,))
}

pub fn fields_of<'py>(points: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray1<'py, f32>> {
    let py = points.py();
    let none = self::points(&PyArray1::from_vec(py, Vec::new()), 0)?;
    let are_points = points.is_instance_of::<PyUntypedArray>()
        && points.getattr("ndim")?.extract::<usize>()? == 1
        && points.getattr("dtype")?.eq(none.getattr("dtype")?)?;
    if !are_points {
        return Err(PyTypeError::new_err(
            "points are expected as Odometry.points or Masked.points has them",
        ));
    }
    let numpy = py.import("numpy")?;
    let together = numpy.call_method1("ascontiguousarray", (points,))?;
    let fields = together.call_method1("view", (numpy::dtype::<f32>(py),))?;
    let fields = sliceable::<f32>(&fields)?;
    readable(&fields, "points", "a structured array of points")
}

impl State {
    /// Masks a scan into the rasters, writes its points, and returns their number and the factors
    /// of a network.
    fn mask(
        &mut self,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
        raster: ArrayViewMut2<'_, f32>,
        previous: Option<ArrayViewMut2<'_, f32>>,
        points: &mut [SparsePoint],
    ) -> Result<(usize, Option<ndarray::Array2<f32>>), OdometryError> {
        scan.check()?;
        scan.check_times()?;
        let stamp_ns = scan.geometry.stamp_ns;
        let follows = self.last.filter(|last| continues(last.1, stamp_ns));
        if follows.is_none() {
            self.finder.reset();
        }
        let lost = self.finder.find(scan, twist);
        let scan = self.rows.place(scan, &lost);
        let sweep = Sweep {
            number: self.last.map_or(0, |(last, _)| last + 1),
            scan,
            twist,
        };
        let follows = follows.map(|(last, _)| last);
        let twist = self.masker.mask(&sweep, follows, raster, previous)?;
        self.last = Some((sweep.number, stamp_ns));
        let count = self.masker.points(&scan, twist, points)?;
        let factors = self.masker.factors(0);
        Ok((count, factors.map(|factors| factors.to_owned())))
    }
}

#[pymethods]
impl Masker {
    #[new]
    #[pyo3(signature = (config=None))]
    fn new(py: Python<'_>, config: Option<&Bound<'_, Config>>) -> PyResult<Self> {
        let config = Config::method(config).odometry;
        let make = || gyre_masking::Masker::new(&config.raster, &config.points, &config.masking);
        let masker = py.detach(make).map_err(errors::config)?;
        Ok(Self {
            n: config.raster.n,
            capacity: config.points.capacity,
            pairs: masker.scans() == 2,
            masker: Guarded::new(
                "Masker",
                State {
                    masker,
                    finder: LostAzimuthFinder::default(),
                    rows: PlacedRows::default(),
                    last: None,
                },
            ),
        })
    }

    /// Masks a scan. `velocity` is the sensor's velocity for motion compensation: x forward and y
    /// left in m/s, and the yaw rate counter-clockwise in rad/s; without it nothing is compensated.
    ///
    /// Where azimuths of a scan were lost is found by the scan of the call before and the velocity.
    ///
    /// If the mask takes two scans, the previous scan is the one of the call before; a scan that is
    /// not later, or later by more than 10 s, is its own previous scan. A scan that cannot be used
    /// raises ScanError, and a network that fails Error.
    #[pyo3(signature = (scan, velocity=None))]
    fn mask(
        &self,
        py: Python<'_>,
        scan: &Bound<'_, Scan>,
        velocity: Option<[f64; 3]>,
    ) -> PyResult<Masked> {
        let borrowed = scan.get().borrowed(py)?;
        let scan = borrowed.view()?;
        let twist = velocity.map(|[vx_mps, vy_mps, yaw_rate_radps]| Twist {
            vx_mps,
            vy_mps,
            yaw_rate_radps,
        });
        let zeros = || PyArray2::<f32>::zeros(py, (self.n, self.n), false);
        let (raster, previous) = (zeros(), self.pairs.then(zeros));
        let fields = PyArray1::<f32>::zeros(py, self.capacity * FIELDS.len(), false);
        let (count, factors) = {
            let mut raster = raster.readwrite();
            let mut previous = previous.as_ref().map(|previous| previous.readwrite());
            let mut fields = fields.readwrite();
            let raster = raster.as_array_mut();
            let previous = previous.as_mut().map(|previous| previous.as_array_mut());
            let points = bytemuck::cast_slice_mut(fields.as_slice_mut()?);
            let masked = self.masker.with(py, |state| {
                state.mask(&scan, twist, raster, previous, points)
            });
            masked?.map_err(errors::registration)?
        };
        Ok(Masked {
            raster: raster.unbind(),
            previous: previous.map(Bound::unbind),
            points: points(&fields, count)?.unbind(),
            factors: factors.map(|factors| PyArray2::from_owned_array(py, factors).unbind()),
        })
    }
}
